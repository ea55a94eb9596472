"""``camera-monitor advise``: settings from options and EXIF, one JSON object per picture, mistakes in one line."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from control_makers import performance
from PIL import Image, ImageFilter

from pipeline.camera import sensor as sensors
from pipeline.camera.exposure import Camera
from pipeline.cli import main
from pipeline.cli.commands.advise import command
from pipeline.cli.frames.shot_settings import exif, seconds, shot_settings
from pipeline.condition import ConditionMonitor
from pipeline.control import advice
from pipeline.errors import InputError
from pipeline.streams import stream


@pytest.mark.parametrize(
    ("text", "value"), [("4ms", 0.004), ("250us", 250e-6), ("1/250s", 0.004), ("0.5 s", 0.5), ("1/2ms", 0.0005)]
)
def test_advise_reads_times(text, value):
    assert seconds(text, "--exposure") == pytest.approx(value)


@pytest.mark.parametrize("text", ["4", "ms", "-4ms", "0ms", "1/0s", "4 minutes"])
def test_advise_refuses_times_without_unit_or_sense(text):
    with pytest.raises(InputError, match=r"--exposure .* e\.g\. 4ms"):
        seconds(text, "--exposure")


def test_advise_takes_settings_from_exif_and_options_win(tmp_path):
    picture = Image.new("L", (8, 8))
    tags = Image.Exif()
    tags.get_ifd(0x8769)[33434] = 0.008
    tags.get_ifd(0x8769)[34855] = 400
    picture.save(tmp_path / "a.jpg", exif=tags)
    assert exif(tmp_path / "a.jpg") == (pytest.approx(0.008), 400.0)
    assert shot_settings(tmp_path / "a.jpg", None, None) == (pytest.approx(0.008), 400.0)
    assert shot_settings(tmp_path / "a.jpg", "2ms", None) == (pytest.approx(0.002), 400.0)
    assert {seconds(text, "") for text in ("50us", "0.05ms", "1/20000s")} == {50e-6}  # the shortest that advise takes
    picture.save(tmp_path / "b.png")
    assert shot_settings(tmp_path / "b.png", None, 100.0) == (None, 100.0)
    broken = Image.Exif()
    broken.get_ifd(0x8769)[33434] = 0.0
    broken.get_ifd(0x8769)[34855] = 0
    picture.save(tmp_path / "c.jpg", exif=broken)
    assert exif(tmp_path / "c.jpg") == (None, None)


def write_inputs(folder):
    """frame.png, noisy squares, and surface.npz."""
    performance().save(folder / "surface.npz")
    coarse = stream(1, "advise").random((28, 28))
    picture = np.kron(coarse, np.ones((8, 8))) * 200 + 5 * stream(2, "advise").standard_normal((224, 224))
    Image.fromarray(np.clip(picture, 0, 255).astype(np.uint8)).save(folder / "frame.png")


def test_advise_answers_in_json(tmp_path):
    write_inputs(tmp_path)
    requested = ["--exposure", "2ms", "--iso", "800", "--speed", "760", "--surface", str(tmp_path / "surface.npz")]
    done = CliRunner().invoke(command, [str(tmp_path / "frame.png"), *requested])
    assert done.exit_code == 0, done.output
    row = json.loads(done.stdout.strip().splitlines()[-1])
    assert row["motion_px"] == pytest.approx(1.52) and row["exposure_ms"] == 2.0 and row["iso"] == 800.0
    assert 100 <= row["best_iso"] <= 3200 and row["reason"]
    assert row["action"] == "move" and 0 < row["best_ap_percent"] <= 100 and row["low_percent"] <= row["ap_percent"]


@pytest.mark.parametrize("name", ["imx255", "automotive_3um"])
def test_the_constants_of_a_sensor_hold_at_its_base_iso(tmp_path, monkeypatch, name):
    """A frame at ISO 800 has the noise of one at gain 2 where the constants are of ISO 400."""
    write_inputs(tmp_path)
    whole, cameras = advice.advise, []
    monkeypatch.setattr(
        advice, "advise", lambda image, state, camera, *rest, **named: cameras.append(camera) or whole(
            image, state, camera, *rest, **named
        )
    )  # fmt: skip
    given = [str(tmp_path / "frame.png"), "--exposure", "8ms", "--iso", "800", "--speed", "760", "--sensor", name]
    given += ["--surface", str(tmp_path / "surface.npz"), "--base-iso", "400"]
    assert CliRunner().invoke(command, given).exit_code == 0
    at_gain_2 = Camera(sensors.named(name)).sigma_dn_at(0.2, 2.0, 0.008)
    assert cameras[0].formation.sigma_dn_at(0.2, 8.0, 0.008) == pytest.approx(at_gain_2)


def test_the_lens_of_a_calibrated_camera_is_no_motion(tmp_path, monkeypatch):
    monkeypatch.setenv("CAMERA_MONITOR_HOME", str(tmp_path / "home"))
    write_inputs(tmp_path)
    soft = Image.open(tmp_path / "frame.png").filter(ImageFilter.GaussianBlur(1.2))
    soft.save(tmp_path / "frame.png")
    picture, surface = str(tmp_path / "frame.png"), ["--surface", str(tmp_path / "surface.npz")]
    given = [picture, "--exposure", "4ms", "--iso", "400", *surface]
    assert CliRunner().invoke(main, ["calibrate", "soft", picture]).exit_code == 0
    whole, relative = (
        json.loads(CliRunner().invoke(command, [*given, *options]).stdout) for options in ([], ["--camera", "soft"])
    )
    assert whole["motion_px"] > 2 > relative["motion_px"]
    soft.resize((256, 224)).save(tmp_path / "other.png")
    done = CliRunner().invoke(command, [str(tmp_path / "other.png"), *given[1:], "--camera", "soft"])
    assert done.exit_code == 0 and "another size means another camera" in done.stderr


@pytest.mark.parametrize(
    "given",
    [
        ["--exposure", "8ms", "--iso", "100", "--exposure-max", "6ms"],
        ["--exposure", "1ms", "--iso", "6400", "--iso-max", "800"],
        ["--exposure", "100ms", "--iso", "50"],
        ["--exposure", "34ms", "--iso", "100"],
    ],
)
@pytest.mark.parametrize("flat", [False, True])
def test_settings_outside_the_limits_move_inside(tmp_path, given, flat):
    write_inputs(tmp_path)
    if flat:  # nothing to estimate from
        Image.new("L", (224, 224), 120).save(tmp_path / "frame.png")
    requested = [*given, "--speed", "100", "--surface", str(tmp_path / "surface.npz")]
    done = CliRunner().invoke(command, [str(tmp_path / "frame.png"), *requested])
    assert done.exit_code == 0, done.output
    row = json.loads(done.stdout)
    longest = 6.0 if "--exposure-max" in given else 33.0
    assert row["best_exposure_ms"] <= longest and 100 <= row["best_iso"] <= (800 if "--iso-max" in given else 3200)
    assert row["action"] == ("abstained" if flat else "move") and "outside the limits" in row["reason"]


def test_limits_that_exclude_every_setting_are_refused_in_units_and_stated_in_the_help(tmp_path):
    write_inputs(tmp_path)
    requested = [str(tmp_path / "frame.png"), "--exposure", "4ms", "--iso", "100", "--exposure-max", "1us"]
    done = CliRunner().invoke(main, ["advise", *requested])
    assert done.exit_code == 2
    assert "--exposure-max 1us: expected at least 50 us, the shortest time advised" in done.output
    words = " ".join(CliRunner().invoke(main, ["advise", "--help"]).output.split())
    assert "from 50 us and ISO 100 to --exposure-max and --iso-max" in words
    assert "longest exposure time allowed [default: 33ms]" in words and "[default: 3200.0" in words


@pytest.mark.parametrize("at_most_dn", [4.0, float("nan")])
def test_a_bound_of_the_noise_serves_where_there_is_no_estimate(tmp_path, monkeypatch, at_most_dn):
    write_inputs(tmp_path)
    whole = ConditionMonitor.frame

    def without_noise(self, image, codec="", quantiser=None):
        seen = whole(self, image)
        nan = np.full_like(seen.noise.summary.value, np.nan)
        summary = replace(seen.noise.summary, value=nan, low=nan, high=nan)
        return replace(seen, noise=replace(seen.noise, summary=summary, at_most_dn=at_most_dn))

    requested = [str(tmp_path / "frame.png"), "--exposure", "16ms", "--iso", "100", "--speed", "760"]
    requested += ["--surface", str(tmp_path / "surface.npz")]
    known = json.loads(CliRunner().invoke(command, requested).stdout)
    monkeypatch.setattr(ConditionMonitor, "frame", without_noise)
    row = json.loads(CliRunner().invoke(command, requested).stdout)
    assert row["sigma_dn"] is None and row["ap_percent"] is None
    if np.isnan(at_most_dn):
        assert row["action"] == "abstained" and row["gain_percent"] is None and row["sigma_at_most_dn"] is None
        return
    assert row["action"] == "move" and row["best_exposure_ms"] < 16 and row["gain_percent"] > 0
    assert row["sigma_at_most_dn"] == at_most_dn and row["low_percent"] < row["high_percent"]
    assert "shorter exposure" in row["reason"] and "4 DN" in row["reason"]
    assert known["sigma_at_most_dn"] >= known["sigma_dn"]
    assert known["gain_percent"] == pytest.approx(known["best_ap_percent"] - known["ap_percent"], abs=0.02)


def test_a_bad_file_is_named_and_the_others_are_answered(tmp_path):
    write_inputs(tmp_path)
    (tmp_path / "a.png").write_bytes(b"none")
    Image.new("L", (8, 8)).save(tmp_path / "b.png")
    (tmp_path / "c.png").write_bytes((tmp_path / "frame.png").read_bytes())
    files = [str(tmp_path / f"{name}.png") for name in ("a", "b", "c", "frame")]
    requested = ["--exposure", "4ms", "--iso", "400", "--speed", "760", "--surface", str(tmp_path / "surface.npz")]
    done = CliRunner().invoke(main, ["advise", *files, *requested])
    assert done.exit_code == 2
    assert [json.loads(line)["picture"] for line in done.stdout.splitlines()] == files[2:]
    lines = done.stderr.splitlines()
    assert len(lines) == 3 and "2 files or frames" in lines[2]
    assert [line.split(": ")[:2] for line in lines[:2]] == [["set aside", file] for file in files[:2]]
    picture = files[2]
    done = CliRunner().invoke(main, ["advise", picture, "--surface", str(tmp_path / "surface.npz")])
    assert done.exit_code == 2 and f"set aside: {picture}: its exposure time and ISO are in no EXIF data" in done.stderr


@pytest.mark.parametrize(
    ("stored", "given", "missing"),
    [
        ({}, [], "its exposure time and ISO are in no EXIF data; give --exposure and --iso"),
        ({}, ["--iso", "100"], "its exposure time is in no EXIF data; give --exposure"),
        ({}, ["--exposure", "4ms"], "its ISO is in no EXIF data; give --iso"),
        ({34855: 400}, [], "its exposure time is in no EXIF data; give --exposure"),
        ({33434: 0.008}, [], "its ISO is in no EXIF data; give --iso"),
    ],
)
def test_only_the_settings_that_are_missing_are_named(tmp_path, stored, given, missing):
    write_inputs(tmp_path)
    tags = Image.Exif()
    for tag, value in stored.items():
        tags.get_ifd(0x8769)[tag] = value
    Image.open(tmp_path / "frame.png").save(tmp_path / "a.jpg", exif=tags)
    requested = [str(tmp_path / "a.jpg"), *given, "--surface", str(tmp_path / "surface.npz")]
    done = CliRunner().invoke(main, ["advise", *requested])
    assert done.exit_code == 2 and f"set aside: {tmp_path / 'a.jpg'}: {missing}\n" in done.stderr
