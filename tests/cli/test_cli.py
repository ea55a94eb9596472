"""The command line as people meet it: quick help, one clear line for mistakes, files that are what they say."""

import json
import os
import re
import signal
import subprocess
import sys
import time

import click
import cv2
import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from data_makers import make_folder, make_kitti, make_sim, make_udacity, picture

from pipeline import noise
from pipeline.camera.psf import create, kinds
from pipeline.cli import COMMANDS, main
from pipeline.cli.commands.corrupt import command as corrupt_command
from pipeline.noise.base import NoiseEstimate
from pipeline.signals import handled
from pipeline.streams import stream


def call(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def noisy(path, sigma_dn, name="a"):
    smooth = cv2.GaussianBlur(picture(name), (0, 0), 3).astype(float)
    image = np.clip(smooth * 0.6 + 50 + stream(0, "cli test", name).normal(0, sigma_dn, smooth.shape), 0, 255)
    assert cv2.imwrite(str(path), np.rint(image).astype(np.uint8))
    return path


def test_help_names_every_command_and_is_quick():
    start = time.perf_counter()
    done = subprocess.run([sys.executable, "-m", "pipeline.cli", "--help"], capture_output=True, text=True)
    assert time.perf_counter() - start < 10  # a second on an idle machine; see benchmarks for the figure
    assert done.returncode == 0
    assert all(name in done.stdout for name in COMMANDS)


@pytest.mark.parametrize(("before", "exit_code"), [(signal.SIG_IGN, 0), (signal.SIG_DFL, 130)])
def test_the_end_of_its_terminal_ends_a_command_unless_nohup_started_it(monkeypatch, before, exit_code):
    @click.command
    def waiting():
        signal.raise_signal(signal.SIGHUP)

    monkeypatch.setattr("pipeline.cli.commands.doctor.command", waiting)
    with handled([signal.SIGHUP], before):
        assert call("doctor").exit_code == exit_code


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_explains_itself(name):
    done = call(name, "--help")
    assert done.exit_code == 0
    assert len(done.output.splitlines()) > 5


def test_a_module_that_python_has_kept_in_part_is_one_line(tmp_path):
    """As a full disk leaves it; click says "Aborted!" where the end of a file is met."""
    environment = {**os.environ, "PYTHONPYCACHEPREFIX": str(tmp_path)}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    command = [sys.executable, "-m", "pipeline.cli", "doctor", "--help"]
    subprocess.run(command, capture_output=True, check=True, env=environment)
    (compiled,) = tmp_path.rglob("cli/commands/doctor.*.pyc")
    compiled.write_bytes(compiled.read_bytes()[:1024])
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    line = f"error: {compiled}: cut short, as by a full disk; delete it\n"
    assert (done.returncode, done.stdout, done.stderr) == (2, "", line)


def test_a_typo_gets_a_hint():
    done = call("nois", "x.png")
    assert done.exit_code == 2
    assert "did you mean 'noise'" in done.output


@pytest.mark.parametrize("sigma_dn", [5.0, 15.0])
def test_noise_finds_what_was_added(tmp_path, sigma_dn):
    done = call("noise", noisy(tmp_path / "a.png", sigma_dn), "--csv", tmp_path / "t.csv", "--map", tmp_path / "maps")
    assert done.exit_code == 0, done.output
    level, at_most = (float(word) for word in done.output.splitlines()[1].split()[:2])
    assert abs(level - sigma_dn) < 0.1 * sigma_dn and level < at_most
    table = pd.read_csv(tmp_path / "t.csv")
    assert len(table) == 12  # 448 x 320 covered by 4 x 3 tiles
    assert (table["frame_sigma_dn"].round(2) == level).all()
    assert (table["sigma_at_most_dn"] >= table["sigma_dn"])[~table["abstained"]].all()
    assert cv2.imread(str(tmp_path / "maps/a.png.noise.png")).shape == (320, 448, 3)
    white, correlation = (float(word) for word in done.output.splitlines()[1].split()[6:8])
    assert (table["frame_white_sigma_dn"].round(2) == white).all() and white == pytest.approx(sigma_dn, rel=0.1)
    assert (table["frame_noise_correlation"].round(2) == correlation).all() and abs(correlation) < 0.05
    assert (table["white_sigma_dn"] <= table["sigma_dn"] + 1e-4)[~table["abstained"]].all()
    assert table["noise_correlation"].notna().equals(~table["abstained"])


def test_a_frame_without_noise_level_has_no_number_on_its_map(tmp_path, monkeypatch):
    class MostlyCompressed:
        def estimate(self, patches):
            reason = np.full(len(patches), "compressed", object)
            reason[0] = ""
            sigma_dn = np.full(len(patches), np.nan)
            sigma_dn[0] = 9.0
            bound = np.full(len(patches), 12.5)
            return NoiseEstimate(sigma_dn, sigma_dn, sigma_dn, reason != "", reason, at_most_dn=bound)

    path = noisy(tmp_path / "a.png", 5.0)
    monkeypatch.setattr(noise, "create", lambda name: MostlyCompressed())
    done = call("noise", path, "--csv", tmp_path / "t.csv", "--map", tmp_path / "maps")
    assert done.exit_code == 0, done.output
    assert done.output.splitlines()[1].split()[:8] == ["-", "12.50", "-", "-", "12", "11", "-", "-"]
    table = pd.read_csv(tmp_path / "t.csv")
    assert table["sigma_dn"][0] == 9.0 and table["frame_sigma_dn"].isna().all()  # so that tile is not to be trusted
    assert (table["sigma_at_most_dn"] == 12.5).all()
    drawn, image = (cv2.imread(str(file)).astype(int) for file in (tmp_path / "maps/a.png.noise.png", path))
    assert np.ptp(drawn[:128, :128], axis=2).max() == 0  # crossed out, without a colour
    assert (drawn != image).any()


def test_noise_reads_videos(tmp_path):
    writer = cv2.VideoWriter(str(tmp_path / "v.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 10, (448, 320))
    for number in range(4):
        writer.write(cv2.cvtColor(picture(str(number)), cv2.COLOR_GRAY2BGR))
    writer.release()
    done = call("noise", tmp_path / "v.avi", "--every", 2)
    assert done.exit_code == 0, done.output
    assert "v.avi#0" in done.output
    assert "v.avi#2" in done.output
    assert "v.avi#1" not in done.output


def test_noise_sets_a_broken_file_aside_and_fails(tmp_path):
    noisy(tmp_path / "good.png", 5.0)
    (tmp_path / "bad.png").write_bytes((tmp_path / "good.png").read_bytes()[:2000])
    done = call("noise", tmp_path)
    assert done.exit_code == 2
    assert "good.png" in done.output
    assert "set aside" in done.output
    assert "bad.png" in done.output


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["noise", "absent.png"], "absent.png"),
        (["noise", "{}", "--estimator", "pcaa"], "did you mean 'pca'"),
        (["noise", "{}", "--tile", "47"], "--tile 47: the noise estimator adaptive takes tiles of at least 48 px"),
        (["noise", "{}", "--tile", "31", "--estimator", "pca"], "pca takes tiles of at least 32 px"),
        (["corrupt", "{}", "--out", "{}/out", "--noise-source", "fotons"], "photon"),
        (["corrupt", "{}", "--out", "{}/out", "--blur", "defocus"], "--size-px"),
        (["corrupt", "{}", "--out", "{}/out", "--size-px", "3"], "--blur"),
        (["corrupt", "{}", "--out", "{}/out", "--sigma-dn", "-3"], "--sigma-dn"),
        (["dataset", "kity", "{}"], "did you mean 'kitti'"),
        (["dataset", "kitti", "{}/nothing"], "nothing"),
        (["health", "absent\r\x85.png"], r"absent\r\x85.png: no such file"),
        (["dataset", "kitti", "{}", "one\r\x85more"], r"one\r\x85more"),
    ],
)
def test_mistakes_are_one_line_that_names_them(tmp_path, arguments, word):
    noisy(tmp_path / "a.png", 5.0)
    done = call(*(argument.replace("{}", str(tmp_path)) for argument in arguments))
    assert done.exit_code == 2
    assert word in done.output
    assert "Traceback" not in done.output
    assert len(done.output.splitlines()) <= 2  # a table's header may come before


@pytest.mark.parametrize(("estimator", "least_px"), [("pca", 32), ("wavelet", 16)])
def test_pictures_that_are_too_small_are_told_what_the_estimator_needs(tmp_path, estimator, least_px):
    for side in (1, least_px - 1, least_px):
        noisy(tmp_path / f"{side}.png", 5.0)
        image = cv2.imread(str(tmp_path / f"{side}.png"))[:side, :side]
        cv2.imwrite(str(tmp_path / f"{side}.png"), image)
    done = call("noise", tmp_path, "--estimator", estimator, "--tile", least_px)
    aside = [line for line in done.stderr.splitlines() if line.startswith("set aside")]
    assert [line.split(": ", 2)[2] for line in aside] == [
        f"too small: {side}x{side} px, expected at least {least_px} px on either side" for side in (1, least_px - 1)
    ]
    assert [line.split()[-1] for line in done.stdout.splitlines()[1:]] == [str(tmp_path / f"{least_px}.png")]


def test_a_video_of_small_frames_is_set_aside_once(tmp_path):
    writer = cv2.VideoWriter(str(tmp_path / "v.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 10, (40, 24))
    for _ in range(3):
        writer.write(np.full((24, 40, 3), 90, np.uint8))
    writer.release()
    done = call("noise", tmp_path / "v.avi", "--estimator", "pca")
    aside = [line for line in done.stderr.splitlines() if line.startswith("set aside")]
    assert len(aside) == 1 and "v.avi: too small: 40x24 px, expected at least 32 px" in aside[0]


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


def test_dataset_says_what_it_found(tmp_path):
    done = call("dataset", "kitti", make_kitti(tmp_path / "kitti", frames=3))
    assert done.exit_code == 0, done.output
    assert "3 usable frames" in done.output
    table = [line.split() for line in done.output.splitlines()[1:5]]
    assert table[0][:3] == ["class", "objects", "ignored"]
    assert table[1] == ["Car", "3", "3", "40.0", "75.0", "110.0", "20.0", "45.0", "70.0", "object:", "car"]
    assert table[0][-2:] == ["to", "detectors"] and table[2][-1] == "ignored"
    make_folder(tmp_path / "folder", frames=4)
    next((tmp_path / "folder").rglob("*.png")).write_bytes(b"")
    done = call("dataset", "folder", tmp_path / "folder")
    assert done.exit_code == 2
    assert "set aside" in done.output


def test_dataset_says_what_each_word_is_to_detectors(tmp_path):
    root = make_folder(tmp_path / "folder", frames=2)
    (root / "labels/frame-0.txt").write_text("Car 10 10 90 90\ncar 20 20 60 90\npersons 30 20 60 90\nbus 1 1 9 9\n")
    done = call("dataset", "folder", root)
    assert done.exit_code == 0, done.output
    roles = {line.split()[0]: line.split("  ")[-1] for line in done.output.splitlines()[2:7]}
    assert roles == {"car": "object: car", "Car": "left out", "persons": "left out", "bus": "left out"} | {
        "traffic": "ignored"
    }
    mistaken = [line.strip() for line in done.output.splitlines() if "to detectors: write" in line]
    assert [line.partition(" to detectors")[0] for line in mistaken] == [
        "1  boxes of 'Car' are no 'car'",
        "1  boxes of 'persons' are no 'person'",
    ]


def test_dataset_counts_the_pictures_of_other_formats_that_it_passes_over(tmp_path):
    make_folder(tmp_path / "folder", frames=2)
    for name in ("a.heic", "b.HEIC", "c.dng", ".d.dng"):
        (tmp_path / "folder" / name).write_bytes(b"x")
    done = call("dataset", "folder", tmp_path / "folder")
    assert done.exit_code == 0, done.output
    counts = [line.split()[:2] for line in done.output.splitlines() if "are no frames" in line]
    assert counts == [["1", ".dng"], ["2", ".heic"]]


def test_dataset_counts_the_pictures_of_sub_folders_that_it_passes_over(tmp_path):
    frames = make_folder(tmp_path / "folder", frames=2) / "images"
    content = (frames / "frame-0.png").read_bytes()
    for name in (
        "day/a.png",
        "night/late/b.PNG",
        "night/late/.c.png",
        ".thumbnails/d.png",
        "night/e.txt",
        "../f/g.png",
    ):
        (frames / name).parent.mkdir(parents=True, exist_ok=True)
        (frames / name).write_bytes(content)
    done = call("dataset", "folder", tmp_path / "folder")
    assert done.exit_code == 0, done.output
    lines = [line.split() for line in done.output.splitlines() if "are no frames" in line]
    assert [(line[0], line[6]) for line in lines] == [("2", "images/day"), ("1", "such")]
    assert "1  pictures beside the folder images such as f/g.png are no frames" in done.output


@pytest.mark.parametrize(
    ("moved", "searched", "there"),
    [
        ("images/train", "images", "which holds no file; pictures lie in {}/images/train (2), where none is read"),
        ("Images", ".", "which holds no file; pictures lie in {}/Images (2), where none is read: move"),
        ("images/.thumbnails", "images", "which holds no file. Any folder of"),
    ],
)
def test_dataset_without_a_picture_says_where_it_looked_and_what_is_there(moved, searched, there, tmp_path):
    root = make_folder(tmp_path / "folder", frames=2)
    (root / "images").rename(root / "old")
    (root / moved).parent.mkdir(exist_ok=True)
    (root / "old").rename(root / moved)
    done = call("dataset", "folder", root)
    assert done.exit_code == 2 and len(done.stderr.splitlines()) == 1
    assert f"no pictures in {root / searched}, {there.format(root)}" in done.stderr


def test_dataset_of_formats_that_it_does_not_read_names_them(tmp_path):
    root = make_folder(tmp_path / "folder", frames=2)
    for path in (root / "images").iterdir():
        path.rename(path.with_suffix(".AVIF"))
    (root / "images/list.csv").write_text("x")
    done = call("dataset", "folder", root)
    assert f"no pictures in {root / 'images'}, which holds 2 .avif files, 1 .csv file. Any folder of PNG" in done.stderr


@pytest.mark.parametrize(("kind", "make"), [("kitti", make_kitti), ("sim", make_sim), ("udacity", make_udacity)])
def test_dataset_does_not_point_out_sub_folders_of_the_layout(kind, make, tmp_path):
    done = call("dataset", kind, make(tmp_path))
    assert done.exit_code == 0, done.output
    assert "are no frames" not in done.output
