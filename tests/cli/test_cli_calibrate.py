"""``camera-monitor calibrate``: stored calibrations from scenes and charts, and their use by ``--camera``."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from data_makers import picture

from pipeline.camera import star
from pipeline.camera.mtf import FREQUENCIES, sample
from pipeline.camera.star_centre import point_of_symmetry
from pipeline.cli import camera_store, main
from pipeline.errors import InputError
from pipeline.streams import stream

SIGMA_PX = 0.9


@pytest.fixture(autouse=True)
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("CAMERA_MONITOR_HOME", str(tmp_path / "home"))
    return tmp_path / "home"


def call(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def save(path, image):
    assert cv2.imwrite(str(path), np.rint(np.clip(image, 0, 1) * 255).astype(np.uint8))
    return path


def gaussian_mtf(sigma_px=SIGMA_PX):
    kernel = cv2.getGaussianKernel(21, sigma_px)
    return sample(kernel @ kernel.T)


def edge(upright, size_px=120):
    fine = np.arange(size_px * 6) / 6
    slanted = ((fine[None] - 0.08 * fine[:, None]) > size_px * 0.45).astype(np.float64)
    wide = cv2.GaussianBlur(slanted, (0, 0), 6 * SIGMA_PX)
    image = wide.reshape(size_px, 6, size_px, 6).mean(axis=(1, 3)) * 0.6 + 0.2
    return image if upright else image.T


def test_two_edges_give_both_axes_and_the_stored_camera_is_used(tmp_path, home):
    files = [save(tmp_path / f"{upright}.png", edge(upright)) for upright in (True, False)]
    done = call("calibrate", "front", *files, "--chart", "edge")
    assert done.exit_code == 0, done.output
    stored = camera_store.load("front")
    truth = gaussian_mtf() * np.sinc(FREQUENCIES / 2)
    np.testing.assert_allclose(stored.sharp_mtf, truth, atol=0.03)
    assert (home / "cameras/front.json").is_file() and camera_store.names() == ["front"]
    image = cv2.GaussianBlur(picture("health").astype(float) / 255, (0, 0), SIGMA_PX)
    scene = save(tmp_path / "scene.png", image)
    rows = []
    for options in ((), ("--camera", "front")):
        done = call("health", scene, "--json", *options)
        assert done.exit_code == 0, done.output
        content = json.loads(done.stdout)
        rows.append(np.array(content["pictures"][0]["mtf"]))
    assert content["relative"] is True and content["camera"] == "front"
    np.testing.assert_allclose(rows[1], np.clip(rows[0] / np.array(stored.sharp_mtf), 0, 1), atol=1e-3)
    assert "scene.png is 448x320 px" in done.stderr


def test_areas_select_the_edges_of_one_picture(tmp_path):
    both = np.full((140, 280), 0.5)
    both[10:130, 10:130], both[10:130, 150:270] = edge(True), edge(False)
    file = save(tmp_path / "chart.png", both)
    areas = ["--area", "10,10,120,120", "--area", "150,10,120,120"]
    assert call("calibrate", "front", file, "--chart", "edge", *areas).exit_code == 0
    refused = call("calibrate", "front", file, "--chart", "edge", *areas[:2])
    assert refused.exit_code == 2 and "no nearly horizontal edge" in refused.output
    refused = call("calibrate", "front", file, "--chart", "edge", "--area", "200,10,120,120")
    assert refused.exit_code == 2 and "not inside" in refused.output


@pytest.mark.parametrize("centre_px", [(399.5, 379.5), (405.2, 374.7)])
def test_a_star_gives_the_mtf_with_its_centre_located(tmp_path, centre_px):
    sharp = star.synthesise(760, 800, 60, centre_px=centre_px, supersample=4)
    image = cv2.GaussianBlur(sharp.astype(np.float64), (0, 0), SIGMA_PX)
    image += stream(0, "star").normal(0, 1 / 255, image.shape)
    assert point_of_symmetry(image) == pytest.approx(centre_px, abs=0.2)
    done = call("calibrate", "front", save(tmp_path / "star.png", image), "--chart", "star", "--rays", 60)
    assert done.exit_code == 0, done.output
    truth = gaussian_mtf() * np.sinc(FREQUENCIES / 2)
    np.testing.assert_allclose(camera_store.load("front").sharp_mtf, truth / truth[:, :1], atol=0.02)


def test_sharp_scenes_are_stored_with_the_hash_of_the_weights_and_refuse_another_estimator(tmp_path):
    soft = cv2.GaussianBlur(picture("health").astype(float) / 255, (0, 0), SIGMA_PX)
    scene = save(tmp_path / "scene.png", soft)
    done = call("calibrate", "front", scene)
    assert done.exit_code == 0, done.output
    stored = camera_store.load("front")
    assert stored.kind == "sharp frames" and len(stored.weights_sha256["mtf_spectral.safetensors"]) == 64
    done = call("health", scene, "--jsonl", "--camera", "front")
    assert done.exit_code == 0, done.output
    assert np.mean(json.loads(done.stdout)["mtf"]) > 0.95  # nothing was added to it
    refused = call("health", scene, "--camera", "front", "--blur", "gbb")
    assert refused.exit_code == 2 and "calibrated for the estimator spectral" in refused.output
    path = camera_store.path_of("front")
    content = json.loads(path.read_text())
    content["weights_sha256"]["mtf_spectral.safetensors"] = "0" * 64
    path.write_text(json.dumps(content))
    refused = call("health", scene, "--camera", "front")
    assert refused.exit_code == 2 and "other weights" in refused.output


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["a/b", "{}/a.png"], "camera name"),
        (["front", "{}/a.png", "--chart", "star"], "--rays"),
        (["front", "{}/a.png", "--rays", "36"], "--rays"),
        (["front", "{}/a.png", "--chart", "star", "--rays", "35"], "even"),
        (["front", "{}/a.png", "--area", "0,0,9,9"], "--area is for"),
        (["front", "{}/a.png", "--chart", "edge", "--area", "0,0,9"], "X,Y,WIDTH,HEIGHT"),
        (["front", "{}/a.png", "--chart", "edge", "--calibrate-estimator"], "--calibrate-estimator is for"),
        (["front", "{}/flat.png", "--chart", "edge"], "differ by 0 DN"),
        (["front", "{}/flat.png", "--chart", "star", "--rays", "36"], "without structure"),
        (["front", "{}/a.png", "{}/small.png"], "one size at a time"),
        (["front", "{}/small.png"], "none is as large as a patch"),
    ],
)
def test_mistakes_are_one_line(tmp_path, home, arguments, word):
    save(tmp_path / "a.png", picture("a") / 255)
    save(tmp_path / "flat.png", np.full((300, 300), 0.5))
    save(tmp_path / "small.png", picture("a")[:100, :100] / 255)
    done = call("calibrate", *(argument.replace("{}", str(tmp_path)) for argument in arguments))
    assert done.exit_code == 2 and word in done.output and "Traceback" not in done.output
    assert not list(home.glob("cameras/*"))


def test_unknown_and_damaged_calibrations_are_refused(home):
    with pytest.raises(InputError, match="not calibrated"):
        camera_store.load("front")
    camera_store.path_of("front").parent.mkdir(parents=True)
    for text in ("{", "[]", json.dumps({"name": "front"}), json.dumps({"size_px": [1, 1], "of two\r\nlines": 1})):
        camera_store.path_of("front").write_text(text)
        with pytest.raises(InputError, match=r"\A.*not the calibration of a camera[^\r\n]*\Z"):
            camera_store.load("front")
