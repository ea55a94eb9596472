"""``camera-monitor health`` on pictures, folders and videos: what it prints, what it writes, how it fails."""

import csv
import json
import os
from functools import partial

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from data_makers import picture

from pipeline.blur import camera_calibration
from pipeline.camera.mtf import FREQUENCIES
from pipeline.cli import main
from pipeline.cli.analysis.ahead import WAITING, estimated_ahead
from pipeline.cli.analysis.rows import NOISE_PARTS, undecided
from pipeline.cli.options.numbers import LARGEST_MTF50
from pipeline.datasets.decoding.video_coding import Coding
from pipeline.errors import InputError
from pipeline.streams import stream

pytestmark = pytest.mark.usefixtures("plain_pictures")


def call(*arguments):
    return CliRunner().invoke(main, ["health", *(str(argument) for argument in arguments)])


def table(output):
    """Lines of the table, its header first, behind the verdict."""
    lines = output.splitlines()
    return lines[next(number for number, text in enumerate(lines) if text.split()[:2] == ["sigma", "DN"]) :]


def write(path, sigma_dn, blur_px=0.0):
    image = cv2.GaussianBlur(picture("health"), (0, 0), 0.8).astype(float) * 0.8 + 25
    if blur_px:
        image = cv2.GaussianBlur(image, (0, 0), blur_px)
    image += stream(0, "health", sigma_dn).normal(0, sigma_dn, image.shape)
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), np.rint(np.clip(image, 0, 255)).astype(np.uint8))
    return path


def test_noise_and_blur_are_told_in_numbers_pictures_and_files(tmp_path, drawn):
    write(tmp_path / "in/a.png", 8.0)
    write(tmp_path / "in/b.png", 0.0, blur_px=3.0)
    done = call(tmp_path / "in", "--out", tmp_path / "out", "--map")
    assert done.exit_code == 0, done.output
    assert done.stdout.startswith("Median of 2 frames: ")
    assert len(table(done.output)) >= 3
    with (tmp_path / "out/health.csv").open() as file:
        noisy, blurred = csv.DictReader(file)
    assert abs(float(noisy["sigma_dn"]) - 8) < 0.8
    assert float(noisy["sigma_low_dn"]) < 8 < float(noisy["sigma_high_dn"])
    assert float(blurred["sigma_dn"]) < 0.5
    assert float(noisy["white_sigma_dn"]) == pytest.approx(8, rel=0.1) and float(noisy["noise_correlation"]) < 0.1
    for way in ("horizontal", "vertical"):
        assert float(blurred[f"mtf50_{way}"]) < 0.2 < float(noisy[f"mtf50_{way}"])
    assert noisy["picture"] in done.output
    content = json.loads((tmp_path / "out/health.json").read_text())
    assert np.shape(content["pictures"][0]["mtf"]) == (2, 8)
    for name in NOISE_PARTS:
        assert content["pictures"][0][name] == float(noisy[name])
    assert len(content["frequencies_of_nyquist"]) == 8
    for name in ("a", "b"):
        drawn = cv2.imread(str(tmp_path / f"out/{name}.png.health.png"))
        assert min(drawn.shape[:2]) > 400
        assert (drawn.max(axis=2).astype(int) - drawn.min(axis=2) > 40).mean() > 0.05  # maps are in colour


def deep(folder, names, factor):
    """16-bit pictures of 8-bit values times a factor."""
    folder.mkdir(exist_ok=True)
    for name in names:
        image = cv2.imread(str(write(folder / name, 4.0)), cv2.IMREAD_UNCHANGED).astype(np.uint16)
        assert cv2.imwrite(str(folder / name), image * np.uint16(factor))
    return folder


@pytest.mark.parametrize("command", ["health", "noise"])
@pytest.mark.parametrize("suffix", ["png", "tiff"])
def test_values_of_twelve_bits_in_sixteen_are_pointed_out_once(tmp_path, command, suffix):
    folder = deep(tmp_path / "in", [f"a.{suffix}", f"b.{suffix}"], 16)
    done = CliRunner().invoke(main, [command, str(folder)])
    assert done.exit_code == 0, done.output
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("hint: ")]
    assert line.startswith(f"hint: {folder / f'a.{suffix}'}: all values are below 4096, it looks like 12-bit values")
    assert "a guess" in line and "multiply its values by 16" in line
    if command == "health":
        assert "16-bit pictures that look like 12-bit values, 16 times too dark then: 2 (a guess)." in done.stdout
        assert "Frames flagged: dark 2" in done.stdout


@pytest.mark.parametrize("factor", [1, 257])
def test_pictures_that_use_their_range_are_not(tmp_path, factor):
    folder = deep(tmp_path / "in", ["a.png"], factor) if factor > 1 else write(tmp_path / "a.png", 4.0)
    done = call(folder)
    assert done.exit_code == 0 and "hint" not in done.stderr and "look like" not in done.stdout


def test_without_map_only_the_page_has_maps(tmp_path):
    source = write(tmp_path / "a.png", 4.0)
    done = call(source, "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    assert {path.name for path in (tmp_path / "out").iterdir() if path.name[0] != "."} == {
        "health.csv", "health.html", "health.json", "health.jsonl",
    }  # fmt: skip
    assert 'alt="' + str(source) + " with maps" in (tmp_path / "out/health.html").read_text()
    assert "--map needs --out" in call(source, "--map").output


@pytest.mark.parametrize("threads", [1, 3])
def test_frames_estimated_ahead_keep_their_order_and_few_are_held(threads):
    taken: list[int] = []

    class Analysis:
        def estimate(self, image, coding):
            assert coding.quantiser == image[0, 0]
            if image[0, 0] == 4:
                raise InputError("too dark")
            return int(image[0, 0])

    def frames():
        for number in range(12):
            taken.append(number)
            image = None if number == 7 else np.full((2, 2), number, np.float32)
            yield f"{number}", image, "cut short", Coding("hevc", number)

    results = []
    for name, _, estimate in estimated_ahead(Analysis(), frames(), threads):
        assert len(taken) - len(results) <= threads + 1 + WAITING
        try:
            results.append((name, estimate()))
        except InputError as error:
            results.append((name, str(error)))
    expected = [(str(number), number) for number in range(12)]
    expected[4], expected[7] = ("4", "too dark"), ("7", "cut short")
    assert results == expected


def test_pictures_of_one_name_do_not_overwrite_each_other(tmp_path):
    one, other = write(tmp_path / "1/a.png", 2.0), write(tmp_path / "2/a.png", 12.0)
    done = call(one, other, "--out", tmp_path / "out", "--map")
    assert done.exit_code == 0, done.output
    assert len(list((tmp_path / "out").glob("*.health.png"))) == 2


def test_the_cameras_own_blur_is_divided_out(tmp_path):
    soft = write(tmp_path / "a.png", 0.0, blur_px=1.2)

    def mtf50(*options):
        assert call(soft, "--out", tmp_path / "out", *options).exit_code == 0
        return json.loads((tmp_path / "out/health.json").read_text())["pictures"][0]["mtf"][0][6]

    assert mtf50("--sharp", soft) > mtf50() + 0.2


def test_a_video_is_read_frame_by_frame(tmp_path):
    writer = cv2.VideoWriter(str(tmp_path / "v.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 10, (448, 320))
    for number in range(3):
        writer.write(cv2.cvtColor(picture(str(number)), cv2.COLOR_GRAY2BGR))
    writer.release()
    done = call(tmp_path / "v.avi", "--every", 2, "--noise", "pca")
    assert done.exit_code == 0, done.output
    assert [line.rsplit("#")[-1] for line in table(done.output) if "v.avi#" in line] == ["0", "2"]


def test_a_frame_that_tells_nothing_says_so(tmp_path):
    cv2.imwrite(str(tmp_path / "white.png"), np.full((320, 448), 255, np.uint8))
    done = call(tmp_path / "white.png", "--out", tmp_path / "out", "--map")
    assert done.exit_code == 0, done.output
    assert done.stdout.startswith("Blur unknown; noise unknown.")
    line = table(done.output)[1]
    assert line.split()[0] == "-"
    assert "noise" in line and "blur" in line and "0/" in line
    assert (tmp_path / "out/white.png.health.png").exists()


def test_a_broken_file_is_set_aside_and_the_rest_is_done(tmp_path):
    good = write(tmp_path / "good.png", 5.0)
    (tmp_path / "bad.png").write_bytes(good.read_bytes()[:3000])
    done = call(tmp_path)
    assert done.exit_code == 2
    assert "good.png" in done.output
    assert "set aside" in done.output and "bad.png" in done.output


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["absent.png"], "absent.png"),
        (["{}/a.png", "--blur", "spectrum"], "did you mean 'spectral'"),
        (["{}/a.png", "--noise", "celwise"], "did you mean 'cellwise'"),
        (["{}/a.png", "--sharp", "{}/white.png"], "sharp"),
        (["{}/a.png", "--sharp", "{}/a.png", "--generic-lens"], "--generic-lens is instead of --sharp"),
        (["{}/a.png", "--blur", "pmp", "--generic-lens"], "--generic-lens is for the blur estimator spectral"),
    ],
)
def test_mistakes_are_one_line_that_names_them(tmp_path, arguments, word):
    write(tmp_path / "a.png", 5.0)
    cv2.imwrite(str(tmp_path / "white.png"), np.full((320, 448), 255, np.uint8))
    done = call(*(argument.replace("{}", str(tmp_path)) for argument in arguments))
    assert done.exit_code == 2
    assert word in done.output
    assert "Traceback" not in done.output


@pytest.mark.full("a calibration of a network takes 6 s")
def test_the_camera_can_be_fitted(tmp_path, monkeypatch):
    sooner = partial(camera_calibration.calibrate, samples=300)
    monkeypatch.setattr("pipeline.condition.estimate.calibrate", sooner)
    soft = write(tmp_path / "soft.png", 0.0, blur_px=1.0)

    def mtf(*options):
        done = call(soft, "--out", tmp_path / "out", *options)
        assert done.exit_code == 0, done.output
        return np.mean(json.loads((tmp_path / "out/health.json").read_text())["pictures"][0]["mtf"])

    assert mtf("--sharp", soft, "--calibrate-estimator") > mtf() + 0.2  # nothing was added to it
    refused = call(soft, "--calibrate-estimator")
    assert refused.exit_code != 0
    assert "--sharp" in refused.output


def test_the_mtf_is_relative_to_a_generic_lens_on_request(tmp_path):
    """Blur beyond that of a generic lens is less than all of it: the MTF is higher."""
    soft = write(tmp_path / "soft.png", 0.0, blur_px=1.0)
    mtf = []
    for options in ((), ("--generic-lens",)):
        done = call(soft, "--out", tmp_path / "out", *options)
        assert done.exit_code == 0, done.output
        mtf.append(np.array(json.loads((tmp_path / "out/health.json").read_text())["pictures"][0]["mtf"]))
    total, added = mtf
    assert (added >= total - 0.02).all()
    assert added.mean() > total.mean() + 0.02


def test_a_damaged_video_is_reported_after_its_good_frames(tmp_path):
    writer = cv2.VideoWriter(str(tmp_path / "v.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 10, (448, 320))
    for number in range(6):
        writer.write(cv2.cvtColor(picture(str(number)), cv2.COLOR_GRAY2BGR))
    writer.release()
    whole = (tmp_path / "v.avi").read_bytes()
    (tmp_path / "v.avi").write_bytes(whole[: int(len(whole) * 0.6)])
    done = call(tmp_path / "v.avi", "--noise", "pca", "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert "frames it declares are missing" in done.output
    content = json.loads((tmp_path / "out/health.json").read_text())
    assert 2 <= len(content["pictures"]) < 6 and len(content["set_aside"]) == 1


def test_json_tells_sharper_than_the_range_from_unknown(tmp_path):
    cv2.imwrite(str(tmp_path / "sharp.png"), picture("health"))
    cv2.imwrite(str(tmp_path / "white.png"), np.full((320, 448), 255, np.uint8))
    write(tmp_path / "blurred.png", 0.0, blur_px=3.0)
    done = call(tmp_path, "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    rows = json.loads((tmp_path / "out/health.json").read_text())["pictures"]
    status = {row["picture"].rsplit("/")[-1]: row["mtf50_horizontal_status"] for row in rows}
    assert status == {"sharp.png": "above_range", "white.png": "unknown", "blurred.png": "measured"}
    assert {row["mtf50_horizontal"] is None for row in rows if "blurred" not in row["picture"]} == {True}


@pytest.mark.parametrize(("side_px", "reason"), [(12, "too small"), (100, "a side is shorter than 192 px")])
def test_small_pictures_get_their_name_and_a_reason(tmp_path, side_px, reason):
    cv2.imwrite(str(tmp_path / "small.png"), picture("health")[:side_px, :side_px])
    done = call(tmp_path / "small.png")
    assert done.exit_code == (2 if side_px < 32 else 0)
    assert any("small.png" in text and reason in text for text in done.output.splitlines()), done.output


def test_sharp_frames_that_are_not_sharp_or_of_another_size_get_a_warning(tmp_path):
    soft, other = write(tmp_path / "soft.png", 0.0, blur_px=3.0), tmp_path / "other.png"
    sharp = tmp_path / "sharp.png"
    cv2.imwrite(str(sharp), picture("health"))
    cv2.imwrite(str(other), picture("health")[:300])
    done = call(sharp, "--sharp", soft)
    assert done.exit_code == 0 and "soft.png does not look sharp" in done.output
    done = call(other, "--sharp", sharp)
    assert "does not look sharp" not in done.output
    assert "other.png is 448x300 px" in done.output and "448x320" in done.output


@pytest.mark.parametrize("bar_px", [0, 60])
def test_health_and_noise_agree_by_default(tmp_path, bar_px):
    path = write(tmp_path / "a.png", 6.0)
    boxed = cv2.copyMakeBorder(cv2.imread(str(path), 0), bar_px, bar_px, 0, 0, cv2.BORDER_CONSTANT, value=16)
    cv2.imwrite(str(path), boxed)
    done = call(path, "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    (row,) = json.loads((tmp_path / "out/health.json").read_text())["pictures"]
    noise = CliRunner().invoke(main, ["noise", str(path)])
    level, at_most = map(float, noise.output.splitlines()[1].split()[:2])
    assert (level, at_most) == pytest.approx((row["sigma_dn"], row["sigma_at_most_dn"]), abs=0.006)
    assert row["sigma_dn"] == pytest.approx(6, abs=0.6)


def test_health_and_noise_take_the_same_tiles_of_a_large_frame(tmp_path):
    noise_dn = stream(0, "large frame").normal(0, 6, (640, 1280))
    path = tmp_path / "large.png"
    cv2.imwrite(str(path), np.rint(np.linspace(60, 190, 1280) + noise_dn).clip(0, 255).astype(np.uint8))
    for options, tiles in (((), 50), (("--tiles", 12), 12)):
        done = call(path, "--out", tmp_path / "out", *options)
        assert done.exit_code == 0, done.output
        (row,) = json.loads((tmp_path / "out/health.json").read_text())["pictures"]
        noise = CliRunner().invoke(main, ["noise", str(path), *map(str, options), "--csv", str(tmp_path / "tiles.csv")])
        assert row["noise_patches"] == tiles == len((tmp_path / "tiles.csv").read_text().splitlines()) - 1
        assert abs(float(noise.output.splitlines()[1].split()[0]) - row["sigma_dn"]) < 0.006
        assert row["sigma_dn"] == pytest.approx(6, abs=0.4)


def test_best_quality_estimates_blur_by_the_fused_estimator(tmp_path, monkeypatch):
    from pipeline.blur import fused
    from pipeline.blur.fusion import gate as fusion_gate
    from pipeline.learning import weights

    gate = fusion_gate.FusionGate()
    gate.begin()
    weights.save(tmp_path / "gate.safetensors", gate.state_dict(), fusion_gate.ARCHITECTURE, interval=3.0)
    monkeypatch.setattr(fused, "RELEASED", tmp_path / "gate.safetensors")
    path = write(tmp_path / "in/a.png", 0.0, blur_px=3.0)
    mtf = {}
    for quality in ("fast", "best"):
        done = call(path, "--quality", quality, "--out", tmp_path / quality)
        assert done.exit_code == 0, done.output
        (shown,) = json.loads((tmp_path / quality / "health.json").read_text())["pictures"]
        mtf[quality] = np.array(shown["mtf"])
    assert 0.002 < np.abs(mtf["best"] - mtf["fast"]).max() < 0.3


def test_best_quality_and_another_estimator_exclude_each_other(tmp_path):
    done = call(write(tmp_path / "a.png", 0.0), "--quality", "best", "--blur", "gbb")
    assert done.exit_code != 0 and "leave --blur gbb out" in str(done.output) + str(done.exception)


def test_json_on_standard_output_is_the_whole_run(tmp_path):
    write(tmp_path / "in/a.png", 8.0)
    (tmp_path / "in/b.png").write_bytes(b"none")
    done = call(tmp_path / "in", "--json", "--out", tmp_path / "out")
    assert done.exit_code == 2
    content = json.loads(done.stdout)
    assert content == json.loads((tmp_path / "out/health.json").read_text())
    assert len(content["pictures"]) == 1 and "b.png" in content["set_aside"][0]
    lines = call(tmp_path / "in/a.png", "--jsonl")
    assert lines.exit_code == 0
    assert [abs(json.loads(text)["sigma_dn"] - 8) < 0.8 for text in lines.stdout.splitlines()] == [True]
    assert "choose one" in call(tmp_path / "in/a.png", "--jsonl", "--json").output


@pytest.mark.parametrize(
    ("options", "code", "alarms"),
    [
        (["--alarm-sigma-dn", 7], 3, "noise"),
        (["--alarm-sigma-dn", 9], 0, ""),
        (["--alarm-mtf50", 0.3], 3, "blur horizontal, blur vertical"),
        (["--alarm-mtf50", 0.02], 0, ""),
        (["--alarm-sigma-dn", "nan"], 2, None),
    ],
)
def test_thresholds_raise_an_alarm_by_exit_code_and_in_the_row(tmp_path, options, code, alarms):
    done = call(write(tmp_path / "a.png", 8.0, blur_px=3.0), "--jsonl", *options)
    assert done.exit_code == code, done.output
    if alarms is not None:
        assert json.loads(done.stdout.splitlines()[0])["alarms"] == alarms


@pytest.mark.parametrize("command", ["health", "watch"])
def test_a_limit_of_blur_beyond_what_is_measured_is_refused(tmp_path, command):
    source = write(tmp_path / "a.png", 0)
    done = CliRunner().invoke(main, [command, str(source), "--alarm-mtf50", "0.6"])
    assert done.exit_code == 2 and "MTF50 is measured up to 0.59 of Nyquist; give at most that" in done.output
    assert LARGEST_MTF50 <= FREQUENCIES[-1] < LARGEST_MTF50 + 0.01


def test_what_is_unknown_raises_no_alarm_but_is_stated(tmp_path):
    limits = ("--alarm-sigma-dn", 1, "--alarm-mtf50", 0.5)
    cv2.imwrite(str(tmp_path / "white.png"), np.full((320, 448), 255, np.uint8))
    done = call(tmp_path / "white.png", *limits)
    counts = "noise in 1, blur horizontal in 1, blur vertical in 1 of 1 frames"
    assert done.exit_code == 0 and f"Alarms undecided for want of an estimate: {counts}." in done.output
    assert "undecided: noise, blur horizontal, blur vertical" in table(done.output)[-1]
    lines = call(tmp_path / "white.png", "--jsonl", *limits)
    assert json.loads(lines.stdout)["undecided"] == "noise, blur horizontal, blur vertical"
    assert lines.stderr == f"warning: Alarms undecided for want of an estimate: {counts}.\n"
    assert json.loads(call(tmp_path / "white.png", "--json", *limits).stdout)["undecided_frames"] == 1
    assert "undecided" not in call(tmp_path / "white.png").output  # no limits were given


@pytest.mark.parametrize(
    ("sigma_dn", "low_dn", "at_most_dn", "limits"),
    [(3.0, 2.0, 9.0, ["noise"]), (4.5, 4.0, 6.0, []), (3.0, 2.0, 5.0, []), (9.0, 7.0, 12.0, []),
     (0.1, 0.0, 4.0, []), (0.1, 0.0, 6.0, ["noise"]),
     (np.nan, np.nan, 4.0, []), (np.nan, np.nan, 5.0, []), (np.nan, np.nan, 6.0, ["noise"]),
     (np.nan, np.nan, np.nan, ["noise"])],
)  # fmt: skip
def test_a_bound_of_noise_decides_where_it_keeps_the_limit(sigma_dn, low_dn, at_most_dn, limits):
    """Of noise that is unknown, not detected or perhaps much more: that there may be more is no alarm, nor none."""
    row = {"sigma_dn": sigma_dn, "sigma_low_dn": low_dn, "sigma_at_most_dn": at_most_dn, "abstained": {}}
    row["sigma_high_dn"] = at_most_dn if np.isfinite(sigma_dn) else np.nan
    row |= {"noise_patches": 30, "mtf50_horizontal": np.nan, "mtf50_vertical": np.inf}
    assert undecided(row, 5.0, None) == limits
    assert undecided(row, None, 0.2) == ["blur horizontal"] and undecided(row, None, None) == []


def test_frozen_and_dark_frames_are_flagged_and_alarm_on_request(tmp_path):
    still = cv2.cvtColor(picture("frozen"), cv2.COLOR_GRAY2BGR)
    writer = cv2.VideoWriter(str(tmp_path / "v.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 10, (448, 320))
    for _ in range(8):  # the encoder settles on a quality in the first frames
        writer.write(still)
    writer.release()
    done = call(tmp_path / "v.avi", "--jsonl", "--noise", "pca")
    assert done.exit_code == 0, done.output
    rows = [json.loads(text) for text in done.stdout.splitlines()]
    assert all(row["flags"] == ("frozen" if row["repeats"] >= 3 else "") for row in rows)
    assert rows[0]["flags"] == "" and rows[-1]["flags"] == "frozen"
    cv2.imwrite(str(tmp_path / "dark.png"), picture("health") // 12)
    done = call(tmp_path / "dark.png", "--jsonl", "--noise", "pca", "--alarm-flags")
    assert done.exit_code == 3 and json.loads(done.stdout.splitlines()[0])["alarms"] == "dark"


def test_pictures_of_one_folder_that_repeat_are_frozen_as_a_video_is(tmp_path):
    series, unrelated, alone = (tmp_path / name for name in ("series", "unrelated", "alone"))
    for number in range(5):
        for folder, text in ((series, "still"), (unrelated, f"{number}"), (alone / f"{number}", "still")):
            folder.mkdir(parents=True, exist_ok=True)
            cv2.imwrite(str(folder / f"{number}.png"), picture(text, 256, 224))
    done = call(series, unrelated, *sorted(alone.iterdir()), "--jsonl", "--noise", "pca")
    assert done.exit_code == 0, done.output
    flags = [json.loads(text)["flags"] for text in done.stdout.splitlines()]
    assert flags == ["", "", "", "frozen", "frozen", *[""] * 10]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
def test_a_pipe_is_called_one(tmp_path):
    os.mkfifo(tmp_path / "frames")
    done = call(tmp_path / "frames")
    assert done.exit_code == 2 and "frames: a pipe or device; expected a file or folder" in done.output


@pytest.mark.parametrize(
    ("error", "code", "words"), [(KeyboardInterrupt(), 130, "interrupt"), (InputError("no plug-in"), 2, "no plug-in")]
)
def test_a_run_that_ends_before_its_first_frame_says_why(tmp_path, monkeypatch, error, code, words):
    """Of one that ends before any can be measured, nothing is written; of another the page, without a frame."""

    def refuse(*given, **options):
        raise error

    path, out = write(tmp_path / "a.png", 5.0), tmp_path / "out"
    cases = {
        "pipeline.condition.ConditionMonitor": set(),
        "pipeline.condition.frame_flags.measure": {"health.json", "health.html"},
    }
    for function, results in cases.items():
        with monkeypatch.context() as patch:
            patch.setattr(function, refuse)
            done = call(path, "--out", out)
        assert done.exit_code == code and words in done.output.lower() and "Traceback" not in done.output
        assert {file.name for file in out.iterdir() if file.suffix in (".json", ".html")} == results
    content = json.loads((out / "health.json").read_text())
    assert content["pictures"] == [] and content["complete"] == (code == 2)  # a frame that is refused is set aside


@pytest.mark.parametrize(("later_px", "alarmed"), [(64, True), (48, False)])
def test_frames_of_another_size_have_a_trend_of_their_own(tmp_path, later_px, alarmed):
    """As of a camera that is switched to a mode with more noise."""
    generator = stream(0, "modes")
    for number in range(150):
        side, sigma_dn = (64, 6.0) if number < 110 else (later_px, 9.0)
        levels = generator.normal(128, sigma_dn * (1 + 0.05 * generator.standard_normal()), (side, side))
        assert cv2.imwrite(str(tmp_path / f"{number:03d}.png"), np.clip(np.rint(levels), 0, 255).astype(np.uint8))
    done = call(tmp_path, "--noise", "pca", "--reference-frames", 100, "--json")
    assert bool(json.loads(done.stdout)["trend_alarms"]) == alarmed
    assert done.exit_code == (3 if alarmed else 0)
