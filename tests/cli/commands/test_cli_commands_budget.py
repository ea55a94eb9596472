"""``camera-monitor budget``: one JSON object per frame, words for people, an alarm over frames, mistakes named."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner, Result

from pipeline.camera import sensor as sensors
from pipeline.camera.exposure import Camera
from pipeline.camera.tone_curve import decode
from pipeline.cli import main
from pipeline.cli.commands.budget import longest_run, words
from pipeline.condition.noise_budget import FrameBudget
from pipeline.experiments.real_noise.records import DARK_FILE
from pipeline.streams import stream

RECORD = Path(__file__).resolve().parents[3] / "reports/recorded/real-sensor"
SETTINGS = ("--sensor", "automotive_3um", "--exposure", "8ms", "--iso", "800")


def call(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["budget", *(str(argument) for argument in arguments)])


def save(path: Path, gain: float = 8.0, seed: int = 0, **changes: Any) -> Path:
    """A frame of the automotive sensor at 8 ms, equally bright at any gain."""
    camera = replace(
        Camera(sensors.named("automotive_3um"), radiance_at_full_scale=1.0, reference_exposure_s=0.008), **changes
    )
    grey = np.linspace(0.15, 0.85, 384)[None, :] * np.ones((256, 1))
    image = camera.expose(decode(grey, camera.gamma) / gain, 0.008, gain, stream(seed, "budget")).image
    assert cv2.imwrite(str(path), np.rint(image * 255).astype(np.uint8))
    return path


def rows(done: Result) -> list[dict[str, Any]]:
    return [json.loads(line) for line in done.stdout.splitlines()]


def test_a_frame_of_its_sensor_is_as_expected(tmp_path: Path):
    done = call(save(tmp_path / "a.png"), *SETTINGS)
    assert done.exit_code == 0, done.output
    (row,) = rows(done)
    assert row["verdict"] == "agrees" and row["ratio"] == pytest.approx(1.0, abs=0.1) and row["gain"] == 8.0
    shares = [row[f"{name}_fraction"] for name in ("photon", "dark", "readout", "pattern", "rounding")]
    assert sum(shares) == pytest.approx(1.0, abs=1e-3) and max(shares) == row["photon_fraction"]
    assert row["words"].startswith("As the sensor explains (") and "Photon noise is" in row["words"]


def test_frames_in_a_row_that_depart_are_an_alarm(tmp_path: Path):
    for number in range(3):
        save(tmp_path / f"{number}.png", 16.0, number)
    done = call(tmp_path, *SETTINGS, "--alarm-frames", 3)
    assert done.exit_code == 3 and "alarm: noise departs from the sensor in 3 frames in a row" in done.stderr
    assert [row["verdict"] for row in rows(done)] == ["more"] * 3
    assert "the gain were 2 times that assumed" in rows(done)[0]["words"]
    assert call(tmp_path, *SETTINGS, "--alarm-frames", 4).exit_code == 0
    assert call(tmp_path, *SETTINGS[:-1], 1600, "--alarm-frames", 1).exit_code == 0


def test_runs_pass_over_frames_that_are_not_known():
    assert longest_run([]) == 0 == longest_run(["agrees", "unknown", "undecided"])
    assert longest_run(["more", "unknown", "more", "less", "less", "undecided", "less", "agrees", "less"]) == 3


def test_linear_pictures_of_a_hot_sensor(tmp_path: Path):
    file = save(tmp_path / "a.png", gamma=1.0, temperature_k=373.15)
    cold, hot = (rows(call(file, *SETTINGS, "--gamma", 1, *more))[0] for more in ([], ["--temperature", 100]))
    assert hot["verdict"] == "agrees" and hot["ratio"] == pytest.approx(1.0, abs=0.1)
    assert hot["dark_fraction"] > 5 * cold["dark_fraction"] > 0 and hot["expected_dn"] > cold["expected_dn"]


def test_a_recorded_sensor_brings_its_pattern_and_its_temperature(tmp_path: Path):
    file, settings = save(tmp_path / "a.png"), ("--exposure", "8ms", "--iso", "100", "--sensor", RECORD)
    recorded, corrected = (rows(call(file, *settings, *more))[0] for more in ([], ["--prnu", 0]))
    assert recorded["pattern_fraction"] > 0.2 and corrected["pattern_fraction"] == 0.0
    refused = call(file, *settings, "--temperature", 20)
    assert refused.exit_code == 2 and "--temperature 20" in refused.output and len(refused.output.splitlines()) == 1


def test_linear_pictures_of_a_recorded_sensor_have_its_black_level(tmp_path: Path):
    file, record = save(tmp_path / "a.png"), tmp_path / "record"
    shutil.copytree(RECORD, record)
    dark = pd.read_csv(record / DARK_FILE)
    dark.assign(offset_dn=20.0, zero_fraction=0.0).to_csv(record / DARK_FILE, index=False)
    settings = (file, "--exposure", "8ms", "--iso", "100", "--sensor", record, "--gamma")
    recorded, none = (rows(call(*settings, 1, *more))[0]["expected_dn"] for more in ([], ["--black-dn", 0]))
    assert recorded < 0.95 * none
    developed, same = (rows(call(*settings, 2.2, *more))[0]["expected_dn"] for more in ([], ["--black-dn", 0]))
    assert developed == same
    assert call(*settings, 1, "--black-dn", 255).exit_code == 2


def test_what_is_unknown_is_null_and_says_why(tmp_path: Path):
    assert cv2.imwrite(str(tmp_path / "black.png"), np.zeros((256, 256), np.uint8))
    (row,) = rows(call(tmp_path / "black.png", *SETTINGS))
    assert row["verdict"] == "unknown" and row["ratio"] is None and row["photon_fraction"] is None
    assert row["words"].startswith("Not compared with the sensor: noise has no estimate")


def test_settings_below_the_base_gain_set_a_file_aside(tmp_path: Path):
    done = call(save(tmp_path / "a.png"), *SETTINGS, "--base-iso", 1600)
    assert done.exit_code == 2 and f"set aside: {tmp_path / 'a.png'}: gain is a factor of at least 1" in done.stderr


def test_words_of_an_uncertain_and_of_a_denoised_picture() -> None:
    budget = FrameBudget(0.0, 3.0, 0.0, 0.0, 4.0, {"photon": 1.0}, 9, "undecided")
    assert "too uncertain to be compared with the sensor (0.0 DN, 3.0 expected, interval 0.0 to 12.0 DN)" in words(
        budget
    )
    denoised = words(replace(budget, ratio_high=0.1, verdict="less"))
    assert denoised.startswith(
        "Less noise than the sensor explains (0.0 DN, 3.0 expected): no single change explains it"
    )
