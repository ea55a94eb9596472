"""Pictures through a named camera from the command line: colour in, colour out, truth from several shots."""

import json

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from data_makers import picture
from PIL import Image

from pipeline.camera.processing import temporal_noise
from pipeline.cli import main


def call(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


@pytest.fixture
def source(tmp_path):
    smooth = cv2.GaussianBlur(picture("a"), (0, 0), 3)
    coloured = np.stack([smooth // 2 + 30, smooth // 2 + 60, smooth // 2 + 90], axis=-1)
    assert cv2.imwrite(str(tmp_path / "a.png"), coloured)
    return tmp_path / "a.png"


def test_the_truth_is_what_shots_of_other_seeds_show(tmp_path, source):
    shots = []
    for seed in (1, 2, 3, 4):
        out = tmp_path / f"out{seed}"
        done = call("corrupt", source, "--pipeline", "phone", "--iso", 1600, "--seed", seed, "--out", out)
        assert done.exit_code == 0, done.output
        shots.append(cv2.imread(str(out / "a.png"), cv2.IMREAD_GRAYSCALE))
    truth = json.loads((tmp_path / "out1/a.json").read_text())
    seen = temporal_noise.measure(np.stack(shots)[:, :320, :448])
    assert truth["sigma_dn"] == pytest.approx(seen.sigma_dn, rel=0.05) and truth["sigma_dn"] > 1
    assert truth["correlation"] == pytest.approx(seen.correlation, abs=0.05)
    assert truth["white_sigma_dn"] < truth["sigma_dn"]
    assert (truth["pipeline"], truth["iso"], truth["shots"]) == ("phone", 1600, 4)
    assert f"{truth['sigma_dn']:.2f}" in call(
        "corrupt", source, "--pipeline", "phone", "--iso", 1600, "--out", tmp_path / "again"
    ).output  # fmt: skip
    assert (tmp_path / "again/a.png").read_bytes() == (tmp_path / "out1/a.png").read_bytes()


def test_colours_stay_and_equal_names_do_not_collide(tmp_path, source):
    (tmp_path / "b").mkdir()
    (tmp_path / "b/a.png").write_bytes(source.read_bytes())
    options = ["--pipeline", "reflex", "--iso", 100, "--out", tmp_path / "out"]
    done = call("corrupt", source, tmp_path / "b/a.png", *options)
    assert done.exit_code == 0, done.output
    assert sorted(path.name for path in (tmp_path / "out").glob("a*.png")) == ["a-2.png", "a.png"]
    means = cv2.imread(str(tmp_path / "out/a.png")).mean(axis=(0, 1))
    assert means[0] + 15 < means[1] and means[1] + 15 < means[2]


def test_odd_sides_are_cut_with_a_note_and_sizes_in_the_truth(tmp_path):
    for name, width, height in (("a", 61, 45), ("b", 61, 46), ("c", 60, 46)):
        assert cv2.imwrite(str(tmp_path / f"{name}.png"), picture(name, width, height))
    done = call("corrupt", tmp_path, "--pipeline", "machine_vision", "--iso", 0, "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    assert done.stderr.count("cut off") == 1 and "a.png has 61x45 px; the colour mosaic has even sides" in done.stderr
    for name, size_in, size_out in (("a", [61, 45], [60, 44]), ("b", [61, 46], [60, 46]), ("c", [60, 46], [60, 46])):
        truth = json.loads((tmp_path / f"out/{name}.json").read_text())
        assert (truth["size_in_px"], truth["size_out_px"]) == (size_in, size_out)
        assert cv2.imread(str(tmp_path / f"out/{name}.png")).shape[1::-1] == tuple(size_out)


def test_what_is_unusual_about_pictures_is_pointed_out_once_as_without_a_pipeline(tmp_path):
    small = picture("a", 60, 46)
    turned = Image.Exif()
    turned[274] = 6
    for name in "ab":
        Image.fromarray(small).save(tmp_path / f"{name}_turned.png", exif=turned)
        Image.fromarray(np.dstack([small, small, small, small // 2])).save(tmp_path / f"{name}_transparent.png")
        assert cv2.imwrite(str(tmp_path / f"{name}_twelve.png"), small.astype(np.uint16) * 16)
    warnings = []
    for options in (["--sigma-dn", 3], ["--pipeline", "machine_vision", "--iso", 0, "--shots", 2]):
        done = call("corrupt", tmp_path, *options, "--out", tmp_path / "out")
        assert done.exit_code == 0, done.output
        warnings.append([line for line in done.stderr.splitlines() if line.startswith(("warning: ", "hint: "))])
    assert warnings[0] == warnings[1] and len(warnings[1]) == 3


def test_a_picture_that_is_too_small_is_called_so(tmp_path):
    assert cv2.imwrite(str(tmp_path / "a.png"), picture("a", 17, 17))
    done = call("corrupt", tmp_path / "a.png", "--pipeline", "phone", "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert "a.png: too small: 17x17 px, expected at least 24 px on either side" in done.stderr


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (["--pipeline", "fone"], "phone"),
        (["--pipeline", "phone", "--sigma-dn", "5"], "--sigma-dn"),
        (["--pipeline", "phone", "--iso", "50"], "--iso 50"),
        (["--iso", "800"], "--pipeline"),
    ],
)
def test_mistakes_are_one_line_that_names_them(tmp_path, source, options, word):
    done = call("corrupt", source, "--out", tmp_path / "out", *options)
    assert done.exit_code == 2 and word in done.output and len(done.output.splitlines()) == 1
