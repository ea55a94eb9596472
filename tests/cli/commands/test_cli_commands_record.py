"""Records of noise from the command line: tables, provenance by hash, no path and no picture kept."""

import hashlib
import json

import cv2
import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from pipeline.cli import main
from pipeline.recording.provenance import content_sha256
from pipeline.streams import stream


def call(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


@pytest.fixture
def folder(tmp_path):
    mean = np.tile(np.linspace(60, 180, 256), (256, 1))
    (tmp_path / "pairs").mkdir()
    cv2.imwrite(str(tmp_path / "pairs/a_mean.png"), np.rint(mean).astype(np.uint8))
    noisy = mean + stream(1, "record").normal(0, 4, mean.shape)
    cv2.imwrite(str(tmp_path / "pairs/a_real.png"), np.rint(noisy).astype(np.uint8))
    return tmp_path / "pairs"


def test_a_record_has_the_numbers_and_names_its_pictures_by_hash(tmp_path, folder):
    out = tmp_path / "record"
    options = ["--estimator", "pca", "--estimator", "bf", "--source", "made here", "--to", out]
    done = call("record", "noise", "--pairs", f"white={folder}", *options)
    assert done.exit_code == 0, done.output
    summary = pd.read_csv(out / "noise_summary.csv").set_index("estimator")
    assert (summary["dataset"] == "white").all() and set(summary.index) == {"pca", "bf"}
    assert summary.loc["pca", "true_mae_dn"] < 0.3 and summary.loc["pca", "true_mean_dn"] == pytest.approx(4, rel=0.03)
    assert len(pd.read_csv(out / "noise_patches.csv")) == 2 * 4
    text = (out / "noise_provenance.json").read_text()
    provenance = json.loads(text)
    expected = hashlib.sha256((folder / "a_real.png").read_bytes()).hexdigest()
    assert provenance["datasets"]["white"]["a_real.png"] == expected and provenance["source"] == "made here"
    assert provenance["inputs_sha256"] == content_sha256(provenance)
    assert str(tmp_path) not in text
    assert sorted(path.suffix for path in out.iterdir()) == [".csv", ".csv", ".json"]
    first = (out / "noise_patches.csv").read_bytes()
    assert call("record", "noise", "--pairs", f"white={folder}", *options).exit_code == 0
    assert (out / "noise_patches.csv").read_bytes() == first


@pytest.mark.parametrize(
    ("pairs", "estimator", "word"),
    [("white", "pca", "NAME=FOLDER"), ("white={}/absent", "pca", "no folder"), ("white={}", "pcaa", "pca")],
)
def test_mistakes_are_one_line_that_names_them(tmp_path, folder, pairs, estimator, word):
    pairs = pairs.replace("{}", str(folder))
    out = tmp_path / "record"
    done = call("record", "noise", "--pairs", pairs, "--estimator", estimator, "--source", "x", "--to", out)
    assert done.exit_code == 2 and word in done.output and len(done.output.splitlines()) == 1
    assert not out.exists()


def write_raw(folder, name, exposure_ms, level, gain=0.05):
    """A raw frame of a ramp: shot noise, 10 electrons of dark noise."""
    generator = stream(1, "record raw", name, exposure_ms)
    electrons = generator.poisson(level / gain) + generator.normal(0, 10, level.shape)
    folder.mkdir(exist_ok=True)
    picture = np.clip(np.rint(gain * electrons), 0, 255).astype(np.uint8)
    assert cv2.imwrite(str(folder / f"{name}_{exposure_ms}ms_1.tif"), picture)


def test_a_sensor_is_measured_from_exposures_of_a_scene(tmp_path):
    ramp = np.tile(np.linspace(10, 230, 640), (480, 1))
    for exposure in (100, 200, 400):
        write_raw(tmp_path / "light", "scene", exposure, ramp * exposure / 400)
        write_raw(tmp_path / "dark", "dark", exposure, np.full((64, 64), 4 + 0.01 * exposure))
    options = ["--light", tmp_path / "light", "--dark", tmp_path / "dark", "--source", "made", "--to", tmp_path / "out"]
    done = call("record", "sensor", *options)
    assert done.exit_code == 0, done.output
    transfer = pd.read_csv(tmp_path / "out/sensor_transfer.csv", dtype={"plane": str})
    assert list(transfer["plane"]) == ["00", "01", "10", "11"]
    assert transfer["gain_dn_per_e"].to_numpy() == pytest.approx(0.05, rel=0.1)
    assert transfer["gain_dn_per_e"].mean() == pytest.approx(0.05, rel=0.04)
    assert "pattern %" in done.output and (transfer["pattern_fraction"] < 0.01).all()  # there is none
    dark = pd.read_csv(tmp_path / "out/sensor_dark.csv")
    assert dark["slope_dn_per_s"].mean() == pytest.approx(10, rel=0.05)
    assert len(json.loads((tmp_path / "out/sensor_provenance.json").read_text())["frames"]["light"]) == 3
    (tmp_path / "dark/unnamed.tif").write_bytes((tmp_path / "dark/dark_100ms_1.tif").read_bytes())
    done = call("record", "sensor", *options)
    assert done.exit_code == 2 and "no exposure" in done.output


@pytest.mark.parametrize("to", ["pairs", "pairs/record", "."])
def test_a_folder_that_is_holds_or_lies_inside_an_input_is_not_replaced(tmp_path, folder, to):
    before = sorted(tmp_path.rglob("*"))
    given = ["--pairs", f"white={folder}", "--estimator", "pca", "--source", "x", "--to", tmp_path / to]
    done = call("record", "noise", *given)
    assert done.exit_code == 2 and "inside the input" in done.output and len(done.output.splitlines()) == 1
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("recorded", [False, True])
def test_a_folder_with_other_files_than_a_record_is_not_replaced(tmp_path, folder, recorded):
    out = tmp_path / "out"
    given = ["--pairs", f"white={folder}", "--estimator", "pca", "--source", "x", "--to", out]
    if recorded:
        assert call("record", "noise", *given).exit_code == 0
    out.mkdir(exist_ok=True)
    (out / "notes.txt").write_text("kept")
    before = {path: path.read_bytes() for path in out.iterdir()}
    done = call("record", "noise", *given)
    assert done.exit_code == 2 and "notes.txt" in done.output and len(done.output.splitlines()) == 1
    assert {path: path.read_bytes() for path in out.iterdir()} == before


def test_raw_frames_are_not_replaced_by_their_record(tmp_path):
    write_raw(tmp_path / "light", "scene", 100, np.full((64, 64), 90.0))
    write_raw(tmp_path / "dark", "dark", 100, np.full((64, 64), 4.0))
    given = ["--light", tmp_path / "light", "--dark", tmp_path / "dark", "--source", "made", "--to", tmp_path / "dark"]
    done = call("record", "sensor", *given)
    assert done.exit_code == 2 and f"inside the input {tmp_path / 'dark'}" in done.output
    assert (tmp_path / "dark/dark_100ms_1.tif").is_file()


@pytest.mark.parametrize("group", ["record", "blur", "curves"])
def test_help_names_the_commands_that_need_a_checkout(group):
    commands = main.get_command(None, group).commands
    for name, command in commands.items():
        composes = "overrides" in [parameter.name for parameter in command.params]
        text = " ".join(call(group, name, "--help").output.split())
        assert ("in the top folder of a checkout of the repository" in text) == composes, name
    if group == "record":
        text = " ".join(call(group, "--help").output.split())
        assert "combined, denoised-blur, factors and noise-levels run in the top folder of a checkout" in text
