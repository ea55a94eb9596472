"""``camera-monitor corrupt``: pictures at the level that was asked for, with their truth; nothing is overwritten."""

import json
import re

import cv2
import numpy as np
import pytest
from cli_makers import call, noisy

from pipeline.camera.psf import create, kinds
from pipeline.cli.commands.corrupt import command as corrupt_command


def test_the_help_of_corrupt_names_every_kind_of_blur(tmp_path):
    option = next(option for option in corrupt_command.params if option.name == "blur")
    assert re.findall(r"\w+", option.help.replace(" or ", " ")) == sorted(kinds())
    source = noisy(tmp_path / "a.png", 0.0)
    done = call("corrupt", source, "--out", tmp_path / "out", "--blur", "gaussian", "--mtf50", 0.3)
    assert done.exit_code == 0, done.output
    assert np.allclose(json.loads((tmp_path / "out/a.json").read_text())["mtf50"], 0.3, atol=0.02)


def test_corrupt_writes_the_picture_and_its_truth(tmp_path):
    source = noisy(tmp_path / "a.png", 0.0)
    options = ["--noise-source", "dcsn", "--sigma-dn", 8, "--blur", "defocus", "--mtf50", 0.3]
    done = call("corrupt", source, "--out", tmp_path / "out", *options)
    assert done.exit_code == 0, done.output
    truth = json.loads((tmp_path / "out/a.json").read_text())
    assert abs(truth["unclipped_sigma_dn"] - 8) < 0.16
    assert np.allclose(truth["mtf50"], 0.3, atol=0.02)
    assert abs(np.sum(truth["kernel"]) - 1) < 1e-5
    first = (tmp_path / "out/a.png").read_bytes()
    assert call("corrupt", source, "--out", tmp_path / "again", *options).exit_code == 0
    assert (tmp_path / "again/a.png").read_bytes() == first


@pytest.mark.parametrize(("noise_source", "less"), [("photon", True), ("combined", True), ("readout", False)])
def test_corrupt_says_why_blur_takes_noise_away(tmp_path, noise_source, less):
    source = noisy(tmp_path / "a.png", 0.0)
    options = ["--noise-source", noise_source, "--sigma-dn", 8, "--blur", "defocus", "--mtf50", 0.3]
    done = call("corrupt", source, "--out", tmp_path / "out", *options)
    reached = json.loads((tmp_path / "out/a.json").read_text())["unclipped_sigma_dn"]
    assert (reached < 7.6) == less == ("enters before the blur" in done.output)


def test_corrupt_at_level_zero_changes_nothing_and_never_overwrites_its_input(tmp_path):
    source = noisy(tmp_path / "a.png", 3.0)
    copied = call("corrupt", source, "--out", tmp_path / "out")
    assert copied.exit_code == 0 and "warning: these are copies; give --sigma-dn" in copied.stderr
    assert "copies" not in call("corrupt", source, "--out", tmp_path / "out", "--sigma-dn", "0").stderr
    assert (cv2.imread(str(tmp_path / "out/a.png"), 0) == cv2.imread(str(source), 0)).all()
    done = call("corrupt", source, "--out", tmp_path)
    assert done.exit_code == 2
    assert "overwrite" in done.output


@pytest.mark.parametrize(
    ("blur", "size_px", "copies"),
    [("defocus", 0, True), ("linear_motion", 0.5, True), ("nonlinear_motion", 1, True), ("gaussian", 0.2, True),
     ("defocus", 1.5, False)],
)  # fmt: skip
def test_corrupt_states_that_a_kernel_of_one_pixel_makes_copies(tmp_path, blur, size_px, copies):
    source, out = noisy(tmp_path / "a.png", 3.0), tmp_path / "out"
    options = ["--blur", blur, "--size-px", size_px]
    done = call("corrupt", source, "--out", out, *options)
    assert done.exit_code == 0, done.output
    assert (cv2.imread(str(out / "a.png"), 0) == cv2.imread(str(source), 0)).all() == copies
    assert (f"--blur {blur} --size-px {size_px:g} blurs nothing" in done.stderr) == copies
    assert ("these are copies; give --sigma-dn, a larger --size-px" in done.stderr) == copies
    noisier = call("corrupt", source, "--out", out, *options, "--sigma-dn", 2).stderr
    assert "copies" not in noisier and ("blurs nothing" in noisier) == copies


@pytest.mark.parametrize("camera", ["authors", "authors_2022"])
def test_defocus_by_the_authors_program_is_its_disc(tmp_path, camera):
    """Off centre, a pixel wider and with the sides of its canvas; motion is that of the physical camera."""
    source, kernels = noisy(tmp_path / "a.png", 3.0), {}
    for name, blur in (("physical", "linear_motion"), (camera, "linear_motion"), (camera, "defocus")):
        done = call("corrupt", source, "--out", tmp_path / "o", "--blur", blur, "--size-px", 7, "--camera", name)
        assert done.exit_code == 0, done.output
        kernels[name, blur] = np.array(json.loads((tmp_path / "o/a.json").read_text())["kernel"])
    assert (kernels[camera, "defocus"] == create("defocus", 7, camera="authors")).all()
    assert (kernels[camera, "linear_motion"] == kernels["physical", "linear_motion"]).all()


@pytest.mark.parametrize(
    ("options", "words"),
    [(("--size-px", 31), "--size-px 31: the authors' program draws discs on 33 x 33 px, up to a size below 30"),
     (("--mtf50", 0.3), "odd whole diameters only")],
)  # fmt: skip
def test_defocus_that_the_authors_program_cannot_draw_is_refused_in_one_line(tmp_path, options, words):
    source = noisy(tmp_path / "a.png", 3.0)
    done = call("corrupt", source, "--out", tmp_path / "o", "--blur", "defocus", *options, "--camera", "authors")
    assert done.exit_code == 2 and words in done.output and "--camera physical" in done.output
    assert len(done.output.strip().splitlines()) == 1
    done = call("corrupt", source, "--out", tmp_path / "o", "--blur", "gaussian", "--mtf50", 0.3, "--camera", "authors")
    assert done.exit_code == 0, done.output


def test_corrupt_writes_of_nothing_where_nothing_can_be_used(tmp_path):
    (tmp_path / "a.png").write_text("no picture")
    for options in (("--sigma-dn", "3"), ("--pipeline", "phone")):
        done = call("corrupt", tmp_path / "a.png", "--out", tmp_path / "out", *options)
        assert done.exit_code == 2 and "a.png could not be used" in done.stderr
        assert "written to" not in done.output and "copies" not in done.output
