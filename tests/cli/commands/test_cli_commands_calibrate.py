"""``camera-monitor calibrate``: stored calibrations from scenes and charts, and their use by ``--camera``."""

from __future__ import annotations

import errno
import json
import re

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from control_makers import performance
from data_makers import gaussian_mtf, picture
from plug_in_makers import plug_in
from star_makers import synthesise

from pipeline.blur import camera_calibration, create
from pipeline.blur.base import WithoutEmptyFrequencies
from pipeline.blur.spectral import Spectral
from pipeline.camera.characterisation.slanted_edge import measure
from pipeline.camera.characterisation.star_centre import point_of_symmetry
from pipeline.camera.mtf import FREQUENCIES
from pipeline.cli import main
from pipeline.cli.calibration import camera_store
from pipeline.cli.calibration.contrast import refuse_without_contrast
from pipeline.condition import ConditionMonitor
from pipeline.condition.estimate import readable_patches
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


def edge(upright, size_px=120, slope=0.08):
    fine = np.arange(size_px * 6) / 6
    slanted = ((fine[None] - slope * fine[:, None]) > size_px * 0.45).astype(np.float64)
    wide = cv2.GaussianBlur(slanted, (0, 0), 6 * SIGMA_PX)
    image = wide.reshape(size_px, 6, size_px, 6).mean(axis=(1, 3)) * 0.6 + 0.2
    return image if upright else image.T


def test_two_edges_give_both_axes_and_the_stored_camera_is_used(tmp_path, home):
    files = [save(tmp_path / f"{upright}.png", edge(upright)) for upright in (True, False)]
    done = call("calibrate", "front", *files, "--chart", "edge")
    assert done.exit_code == 0 and "replaces" not in done.output, done.output
    again = call("calibrate", "front", *files, "--chart", "edge")
    assert "replaces the stored calibration of front" in again.output
    stored = camera_store.load("front")
    truth = gaussian_mtf(SIGMA_PX) * np.sinc(FREQUENCIES / 2)
    np.testing.assert_allclose(stored.sharp_mtf, truth, atol=0.03)
    (home / "cameras/.writing-a.json").touch()  # of a calibration that was killed
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
    assert "(relative to the calibration of the camera front)" in content["verdict"]["sentence"]
    np.testing.assert_allclose(rows[1], np.clip(rows[0] / np.array(stored.sharp_mtf), 0, 1), atol=1e-3)
    assert stored.size_px is None and "448x320" not in done.stderr  # a crop of a chart says nothing of the frames


def test_edges_of_a_large_tilt_are_pointed_out(tmp_path):
    files = [save(tmp_path / f"{upright}.png", edge(upright, slope=0.25 if upright else 0.1)) for upright in (1, 0)]
    done = call("calibrate", "front", *files, "--chart", "edge")
    assert done.exit_code == 0, done.output
    (warning,) = done.stderr.splitlines()
    assert "1.png: edge: tilted by 14 degrees" in warning and "horizontal MTF is right for round blur only" in warning


def test_an_output_that_takes_nothing_loses_no_calibration(tmp_path, monkeypatch):
    def full(message, err=False):
        if not err:
            raise OSError(errno.ENOSPC, "No space left on device")

    files = [save(tmp_path / f"{upright}.png", edge(upright)) for upright in (True, False)]
    monkeypatch.setattr("click.echo", full)
    assert call("calibrate", "front", *files, "--chart", "edge").exit_code == 2
    assert camera_store.load("front").frames == 2


def test_edges_may_have_different_sizes_and_old_sizes_of_charts_are_ignored(tmp_path):
    upright = save(tmp_path / "v.png", edge(True, 300)[:, 87:212])
    flat = save(tmp_path / "h.png", edge(False, 300)[87:212])
    done = call("calibrate", "front", upright, flat, "--chart", "edge")
    assert done.exit_code == 0, done.output
    np.testing.assert_allclose(
        camera_store.load("front").sharp_mtf, gaussian_mtf(SIGMA_PX) * np.sinc(FREQUENCIES / 2), atol=0.03
    )
    path = camera_store.path_of("front")
    path.write_text(json.dumps({**json.loads(path.read_text()), "size_px": [300, 125]}))
    assert camera_store.load("front").size_px is None


def test_the_mtf_of_a_camera_that_sharpens_is_stored_as_1_at_most(tmp_path):
    """Estimates of its sharp frames are 1 at most: division by more would find blur in them."""
    sharpened = [edge(upright) for upright in (True, False)]
    sharpened = [0.2 + 0.6 * (image + 2 * (image - cv2.GaussianBlur(image, (0, 0), 2.0))) for image in sharpened]
    assert measure(sharpened[0]).mtf.max() > 1.2
    files = [save(tmp_path / f"{index}.png", image) for index, image in enumerate(sharpened)]
    done = call("calibrate", "front", *files, "--chart", "edge")
    assert done.exit_code == 0
    assert np.max(camera_store.load("front").sharp_mtf) == 1
    overshoot = measure(np.rint(sharpened[0] * 255) / 255).mtf
    told = re.match(r"warning: overshoot to (.*): the camera sharpens; stored as 1.00", done.stderr)
    assert told and float(told[1]) == pytest.approx(overshoot.max(), abs=0.03)
    printed = next(line for line in done.stdout.splitlines() if line.startswith("horizontal"))
    np.testing.assert_allclose([float(value) for value in printed.split()[1:]], overshoot, atol=0.006)
    plain = [save(tmp_path / f"plain{number}.png", edge(upright)) for number, upright in enumerate((True, False))]
    assert "sharpens" not in call("calibrate", "front", *plain, "--chart", "edge").stderr


def test_the_overshoot_of_a_star_is_told_too(tmp_path):
    sharp = cv2.GaussianBlur(synthesise(520, 520, 36, amplitude=0.2, supersample=4).astype(np.float64), (0, 0), 0.5)
    image = sharp + (sharp - cv2.GaussianBlur(sharp, (0, 0), 2.0))
    done = call("calibrate", "front", save(tmp_path / "star.png", image), "--chart", "star", "--rays", 36)
    assert done.exit_code == 0, done.output
    assert "the camera sharpens" in done.stderr and np.max(camera_store.load("front").sharp_mtf) == 1


def test_a_chart_too_noisy_for_its_contrast_is_refused_unless_pictures_are_averaged(tmp_path, home):
    """A single picture errs by .12 at .59 of Nyquist, the mean of twelve by a third of that."""

    def faint(number, upright):
        noise = stream(0, "faint", number, upright).normal(0, 4 / 255, (120, 120))
        return save(tmp_path / f"{number}{upright}.png", 0.4 + 0.1 * (edge(upright) - 0.2) / 0.6 + noise)

    files = [faint(number, upright) for number in range(12) for upright in (True, False)]
    done = call("calibrate", "front", *files[:2], "--chart", "edge")
    assert done.exit_code == 2 and "--chart edge: the horizontal MTF is too noisy: standard error 0.1" in done.output
    assert "of Nyquist, expected at most 0.05; take longer edges" in done.output
    assert not list(home.rglob("front.json"))
    assert call("calibrate", "front", *files, "--chart", "edge").exit_code == 0


def test_clipped_charts_are_refused_and_white_of_exactly_255_is_not(tmp_path):
    """Overexposed by a fifth an edge's MTF of 0.46 was stored as 0.62."""
    unit = [(edge(upright) - 0.2) / 0.6 for upright in (True, False)]

    def done(low, high):
        files = [save(tmp_path / f"{number}.png", low + (high - low) * image) for number, image in enumerate(unit)]
        return call("calibrate", "front", *files, "--chart", "edge")

    assert done(0.0, 1.0).exit_code == 0
    np.testing.assert_allclose(
        camera_store.load("front").sharp_mtf, gaussian_mtf(SIGMA_PX) * np.sinc(FREQUENCIES / 2), atol=0.03
    )
    for low, high, words in (
        (0.2, 1.2, "0.png: edge: clipped at white, which changes its MTF; expose less"),
        (-0.15, 0.8, "edge: clipped at black, which changes its MTF; expose longer, or raise the black level"),
        (-0.2, 1.2, "edge: clipped at black and white, which changes its MTF; use a chart of less contrast"),
    ):
        refused = done(low, high)
        assert refused.exit_code == 2 and words in refused.output, refused.output


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
    sharp = synthesise(760, 800, 60, centre_px=centre_px, supersample=4)
    image = cv2.GaussianBlur(sharp.astype(np.float64), (0, 0), SIGMA_PX)
    image += stream(0, "star").normal(0, 1 / 255, image.shape)
    assert point_of_symmetry(image) == pytest.approx(centre_px, abs=0.2)
    done = call("calibrate", "front", save(tmp_path / "star.png", image), "--chart", "star", "--rays", 60)
    assert done.exit_code == 0, done.output
    truth = gaussian_mtf(SIGMA_PX) * np.sinc(FREQUENCIES / 2)
    np.testing.assert_allclose(camera_store.load("front").sharp_mtf, truth / truth[:, :1], atol=0.02)


@pytest.mark.parametrize(("sigma_px", "doubted"), [(0.0, False), (1.4, False), (2.2, True), (3.0, True)])
def test_accepted_sharp_pictures_are_near_1_relative_to_themselves(tmp_path, sigma_px, doubted):
    image = picture("health").astype(float) / 255
    scene = save(tmp_path / "scene.png", cv2.GaussianBlur(image, (0, 0), sigma_px) if sigma_px else image)
    done = call("calibrate", "front", scene)
    assert done.exit_code == 0, done.output
    assert ("scene.png does not look sharp: contrast falls to half at 0.1" in done.stderr) == doubted
    done = call("health", scene, "--jsonl", "--camera", "front")
    assert done.exit_code == 0, done.output
    assert np.min(json.loads(done.stdout)["mtf"]) > 0.9
    assert ("1 of the 1 pictures that front was calibrated with do not look sharp" in done.stderr) == doubted
    verdict = call("health", scene, "--camera", "front").stdout
    assert "the calibration of the camera front" in verdict
    assert ("whose pictures do not all look sharp" in verdict) == doubted


def test_every_command_that_uses_a_calibration_from_blurred_pictures_warns(tmp_path, home):
    image = picture("health").astype(float) / 255
    scene = save(tmp_path / "scene.png", cv2.GaussianBlur(image, (0, 0), 3.0))
    sharp = save(tmp_path / "sharp.png", image)
    assert call("calibrate", "front", sharp, scene).exit_code == 0
    doubt = "1 of the 2 pictures that front was calibrated with do not look sharp"
    performance().save(tmp_path / "surface.npz")
    settings = ("--exposure", "4ms", "--iso", "400", "--surface", tmp_path / "surface.npz")
    done = call("advise", scene, *settings, "--camera", "front")
    assert done.exit_code == 0 and doubt in done.stderr
    folder = tmp_path / "frames"
    folder.mkdir()
    save(folder / "a.png", image)
    done = call("watch", folder, "--camera", "front", "--frames", "1", "--no-wait")
    events = [json.loads(line) for line in done.stdout.splitlines()]
    assert [doubt in event["reason"] for event in events if event["event"] == "warning"] == [True]

    file = home / "cameras" / "front.json"
    content = json.loads(file.read_text())
    earlier = {name: value for name, value in content.items() if name != "unsharp"}
    file.write_text(json.dumps(earlier))
    done = call("health", scene, "--jsonl", "--camera", "front")
    assert done.exit_code == 0 and "do not look sharp" not in done.stderr
    for wrong in (3, -1, "two"):
        file.write_text(json.dumps({**content, "unsharp": wrong}))
        done = call("health", scene, "--jsonl", "--camera", "front")
        assert done.exit_code == 2 and "not the calibration of a camera" in done.stderr


def test_pictures_without_contrast_are_refused(tmp_path, home):
    image = cv2.GaussianBlur(picture("health").astype(float) / 255, (0, 0), 8.0)
    scene = save(tmp_path / "scene.png", image)
    for options in ((), ("--calibrate-estimator",)):
        done = call("calibrate", "front", scene, *options)
        assert done.exit_code == 2 and "no contrast is left" in done.output and "Traceback" not in done.output
    soft = [save(tmp_path / f"soft {name}.png", cv2.GaussianBlur(edge(name, 160), (0, 0), 8.0)) for name in (0, 1)]
    done = call("calibrate", "front", *soft, "--chart", "edge")
    assert done.exit_code == 2 and "focus the camera" in done.output
    assert not list(home.glob("cameras/*"))


def test_pictures_that_are_blurred_further_to_correct_the_estimator_need_more_contrast(tmp_path, home, monkeypatch):
    """Six of 16 values of the MTF are empty: enough to divide by the others."""
    monkeypatch.setattr(camera_calibration, "calibrate", lambda *given: pytest.fail("takes minutes"))
    scene = save(tmp_path / "scene.png", cv2.GaussianBlur(picture("health").astype(float) / 255, (0, 0), 2.0))
    done = call("calibrate", "front", scene, "--calibrate-estimator")
    assert done.exit_code == 2 and "at 6 of 16 values" in done.output
    assert "or leave --calibrate-estimator out" in done.output and not list(home.glob("cameras/*"))
    assert call("calibrate", "front", scene).exit_code == 0


def test_the_lowest_frequency_needs_contrast_on_both_axes():
    for axis in (0, 1):
        mtf = np.full((2, 8), 0.5)
        mtf[axis, 1:] = 0.0
        refuse_without_contrast(mtf, "a chart", "focus", 0.5)
        mtf[:] = 0.5
        mtf[axis, 0] = 0.0
        with pytest.raises(InputError, match="a chart: no contrast is left .* at 1 of 16 values"):
            refuse_without_contrast(mtf, "a chart", "focus", 0.5)


def test_frequencies_without_contrast_take_the_relative_mtf_of_the_next_lower():
    plain = create("spectral")
    plain.sharp_mtf = np.array([[0.9, 0.8, 0.7, 0.5, 0.2, 0.05, 0.05, 0.05], [0.9] * 8])
    patches = (picture("health")[None, None, :192, :192] / 255).astype(np.float32)
    divided = plain.estimate(patches)
    result = WithoutEmptyFrequencies(plain).estimate(patches)
    np.testing.assert_array_equal(result.mtf[:, 1], divided.mtf[:, 1])
    np.testing.assert_array_equal(result.mtf[:, 0], divided.mtf[:, 0][:, [0, 1, 2, 3, 4, 4, 4, 4]])
    np.testing.assert_array_equal(result.low[:, 0, 5:], np.repeat(divided.low[:, 0, 4:5], 3, axis=1))


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


@pytest.mark.parametrize("options", [{"output": "relative"}, {}])
def test_a_camera_is_not_applied_to_answers_that_are_relative_already(options):
    """Of a chart, which serves any estimator, nothing else would tell."""
    camera = camera_store.StoredCamera(
        name="front", kind="edge chart", blur_estimator="spectral", weights_sha256={}, size_px=None, frames=1,
        sharp_mtf=[[0.8] * 8] * 2, fit=None, version="0",
    )  # fmt: skip
    monitor = ConditionMonitor(blur_options=options)
    if not options:
        camera_store.apply(camera, monitor)
    with pytest.raises(InputError, match="answers relative to the (generic lens|camera); expected"):
        camera_store.apply(camera, monitor)


def under_a_noisy_sky(name, height_px=448):
    """A scene of which 192 lines are shading and noise, below a bar of 40 lines."""
    image = picture(name, height_px=height_px).astype(float) / 255
    image[:232] = np.linspace(0.5, 0.7, 232)[:, None] + stream(0, "sky").normal(0, 12 / 255, (232, image.shape[1]))
    image[:40] = 16 / 255
    return image


@pytest.mark.parametrize("fitted", [False, True])
def test_scenes_are_read_where_sharp_frames_are(tmp_path, monkeypatch, fitted):
    """Patches of noise alone, or across a bar, are not: what was read there made blurred frames look sharp."""
    scene = save(tmp_path / "scene.png", under_a_noisy_sky("health"))
    (expected,) = readable_patches([cv2.imread(str(scene), 0) / np.float32(255)])
    assert len(expected) == 6  # the lower two rows of three
    patches = []

    def estimated_from(estimator, sharp_patches):
        patches.append(sharp_patches)
        raise InputError("enough")

    options = ()
    if fitted:
        options = ("--calibrate-estimator",)
        monkeypatch.setattr(camera_calibration, "calibrate", estimated_from)
    else:
        monkeypatch.setattr(Spectral, "divided", estimated_from)
    done = call("calibrate", "front", scene, *options)
    assert done.output == "error: enough\n"
    np.testing.assert_array_equal(patches[0], expected)


def test_pictures_that_give_no_estimate_are_named_and_not_counted(tmp_path, home):
    image = picture("health").astype(float) / 255
    scene, black = save(tmp_path / "scene.png", image), save(tmp_path / "black.png", 0 * image)
    clipped = save(tmp_path / "clipped.png", image > 0.5)
    done = call("calibrate", "front", scene, black, clipped)
    assert done.exit_code == 0, done.output
    for name, count in (("scene", 0), ("black", 1), ("clipped", 1)):
        assert done.stderr.count(f"{name}.png: no patch can be measured") == count, done.stderr
    with_others = camera_store.load("front")
    assert (with_others.frames, with_others.unsharp) == (1, 0)
    assert call("calibrate", "front", scene).exit_code == 0
    assert camera_store.load("front") == with_others
    for file, words in ((black, "no patch has structure that shows sharpness"), (clipped, "no patch can be measured")):
        refused = call("calibrate", "rear", file)
        assert refused.exit_code == 2 and words in refused.stderr.splitlines()[-1], refused.stderr
    assert [file.name for file in home.glob("cameras/*")] == ["front.json"]


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["a/b", "{}/a.png"], "camera name"),
        (["front\n", "{}/a.png"], "camera name"),
        (["front", "{}/a.png", "--chart", "star"], "--rays"),
        (["front", "{}/a.png", "--rays", "36"], "--rays"),
        (["front", "{}/a.png", "--chart", "star", "--rays", "35"], "even"),
        (["front", "{}/a.png", "--area", "0,0,9,9"], "--area is for"),
        (["front", "{}/a.png", "--chart", "edge", "--area", "0,0,9"], "X,Y,WIDTH,HEIGHT"),
        (["front", "{}/a.png", "--chart", "edge", "--calibrate-estimator"], "--calibrate-estimator is for"),
        (["front", "{}/flat.png", "--chart", "edge"], "differ by 0 DN"),
        (["front", "{}/flat.png", "--chart", "star", "--rays", "36"], "without structure"),
        (["front", "{}/a.png", "--chart", "star", "--rays", "16"], "24<=x<=2000"),
        (["front", "{}/a.png", "--chart", "star", "--rays", "72"], "a star of 72 rays must be 848 px across"),
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


def test_without_a_home_folder_none_is_stored_and_the_variable_is_named(monkeypatch):
    def homeless():
        raise RuntimeError("Could not determine home directory.")

    for variable in ("CAMERA_MONITOR_HOME", "XDG_CONFIG_HOME"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setattr(camera_store.Path, "home", homeless)
    assert camera_store.names() == []
    with pytest.raises(InputError, match="set CAMERA_MONITOR_HOME"):
        camera_store.load("front")


LEVEL_ESTIMATOR = """
import numpy as np
from pipeline.blur.base import BlurEstimate, Estimator


class Level(Estimator):
    def measure(self, patches, reason):
        mtf = np.full((len(patches), 2, 8), LEVEL)
        return BlurEstimate(mtf, np.zeros(len(patches), bool), np.full(len(patches), ""))
"""


def test_a_calibration_is_for_the_code_of_a_third_partys_estimator_that_it_was_made_with(tmp_path, home, monkeypatch):
    """Its answers with other code would be divided by those of the former."""
    points = {"blur": "level = level_of_mine:Level"}
    module = plug_in(tmp_path, monkeypatch, "level_of_mine", f"LEVEL = 0.5\n{LEVEL_ESTIMATOR}", **points)
    sharp = save(tmp_path / "sharp.png", picture("level", 480, 360) / 255)
    done = call("calibrate", "front", sharp, "--blur", "level")
    assert done.exit_code == 0, done.output
    assert call("health", sharp, "--camera", "front", "--blur", "level", "--no-trend").exit_code == 0
    stored = home / "cameras/front.json"
    content = json.loads(stored.read_text())
    assert list(content["weights_sha256"]) == [camera_store.CODE]
    module.write_text(module.read_text().replace("0.5", "0.25"))
    done = call("health", sharp, "--camera", "front", "--blur", "level", "--no-trend")
    words = "front was calibrated with other code of level; run camera-monitor calibrate front again"
    assert done.exit_code == 2 and words in done.output
    stored.write_text(json.dumps(content | {"weights_sha256": {}}))  # of an earlier version
    assert call("health", sharp, "--camera", "front", "--blur", "level", "--no-trend").exit_code == 0
