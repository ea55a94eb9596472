"""A frame under a condition: the camera model's physics, one draw scaled over levels, another corruption carried."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from data_makers import make_folder, make_kitti

from pipeline import noise as noise_estimators
from pipeline.camera import corruption, mtf
from pipeline.camera.settings import CameraSettings
from pipeline.datasets import open_dataset
from pipeline.datasets.folder import Folder
from pipeline.datasets.patches import Patch
from pipeline.experiments import corrupt as module
from pipeline.experiments.condition import Condition, grid, sweep_kernels
from pipeline.experiments.corrupt import SharpFrame
from pipeline.experiments.frames import TestFrame
from pipeline.experiments.run import Method, Registered, run
from pipeline.streams import stream

LEVELS = (0.0, 5.0, 15.0)
CAMERAS = {
    "physical": CameraSettings(),
    "authors": CameraSettings("authors"),
    "detector": CameraSettings(order="detector"),
    "linear": CameraSettings(light="linear"),
}
BLURS = sweep_kernels("linear_motion", [0, 3, 21], [0, 45], "nominal", 1)


@pytest.fixture
def frame(tmp_path):
    return Folder("folder", make_folder(tmp_path / "data", frames=1)).frames()[0]


def conditions(frame, kernel, noise_source, target_sigmas_dn, camera, seed):
    sharp = SharpFrame(frame, camera, seed)
    return [(level, sharp.under(Condition(kernel, noise_source, level)).formation) for level in target_sigmas_dn]


@pytest.mark.parametrize("noise_source", ["dcsn", "readout", "sensor", "photon", "combined"])
@pytest.mark.parametrize(
    "camera",
    [
        CameraSettings("physical"),
        CameraSettings("authors"),
        CameraSettings(order="detector"),
        CameraSettings(light="linear"),
    ],
    ids=["physical", "authors", "detector", "linear"],
)
def test_every_image_is_the_camera_models_own(frame, noise_source, camera):
    """Bit for bit, though the optics are passed once and the noise is drawn once for all levels and kernels."""
    sharp = SharpFrame(frame, camera, 7)
    for kernel in (BLURS[0], BLURS[-1]):
        for level in LEVELS:
            shown = sharp.under(Condition(kernel, noise_source, level))
            generator = stream(7, "conditions", "folder", frame.name, noise_source)
            psf = None if kernel.name == "sharp" else kernel.psf
            expected = corruption.corrupt(
                frame.image(),
                noise_source,
                sigma_dn=level,
                generator=generator,
                psf=psf,
                camera=camera.kind,
                order=camera.order,
                light=camera.light,
            )
            np.testing.assert_array_equal(shown.image, expected.image)
            tiles = [Patch(0, 0, 64), Patch(100, 80, 64)]
            if level:
                assert shown.unclipped_sigma_dn(tiles) == pytest.approx(
                    module.local_sigma(expected, tiles, "before"), rel=1e-4
                )


def test_the_optics_are_passed_and_the_noise_is_drawn_once_for_all_levels(frame, monkeypatch):
    passed, drawn = [], []
    optics, draw = module.through_optics, module.chain.draw
    monkeypatch.setattr(module, "through_optics", lambda *given: passed.append(1) or optics(*given))
    monkeypatch.setattr(module.chain, "draw", lambda *given, **options: drawn.append(1) or draw(*given, **options))
    sharp = SharpFrame(frame, CameraSettings(), 1)
    for kernel in BLURS[1:3]:
        for level in LEVELS:
            sharp.under(Condition(kernel, "dcsn", level))
    assert (len(passed), len(drawn)) == (2, 1)


def test_levels_of_a_frame_scale_one_draw_and_frames_draw_their_own(frame):
    grey = dataclasses.replace(frame)

    def noise(one, kernel):
        sharp = SharpFrame(one, CameraSettings(), 1)
        sharp.image = np.full((64, 64), 0.5, np.float32)
        shown = {level: sharp.under(Condition(kernel, "dcsn", level)).formation for level in (0.0, 10.0, 20.0)}
        assert shown[10.0].unclipped_sigma_dn == pytest.approx(10.0, rel=1e-3)
        return [255 * (shown[level].image - shown[0.0].image) for level in (10.0, 20.0)]

    small, large = noise(grey, BLURS[0])
    assert np.corrcoef(small.ravel(), large.ravel())[0, 1] > 0.99
    blurred, _ = noise(grey, BLURS[3])
    assert np.corrcoef(small.ravel(), blurred.ravel())[0, 1] > 0.99  # the same draw behind every kernel
    other, _ = noise(dataclasses.replace(grey, name="other"), BLURS[0])
    assert abs(np.corrcoef(small.ravel(), other.ravel())[0, 1]) < 0.1


def test_conditions_that_are_not_paired_draw_their_own(frame):
    sharp = SharpFrame(frame, CameraSettings(), 1, paired=False)
    sharp.image = np.full((64, 64), 0.5, np.float32)
    chosen = [Condition(kernel, "dcsn", level) for kernel in BLURS[:2] for level in (10.0, 20.0)]
    noises = [sharp.formation(condition).noise_dn.ravel() for condition in chosen]
    assert np.abs(np.corrcoef(noises) - np.eye(len(chosen))).max() < 0.1


def test_level_zero_without_a_kernel_is_the_frame_itself(frame):
    shown = SharpFrame(frame, CameraSettings(), 1).under(Condition(noise_source="combined"))
    assert shown.image.tobytes() == frame.image().tobytes()
    assert (shown.true_mtf == 1).all()


def test_seeds_differ_and_the_order_of_conditions_does_not_matter(frame):
    listed = grid(BLURS[:2], ["dcsn", "photon"], [10.0])
    one, again = SharpFrame(frame, CameraSettings(), 1), SharpFrame(frame, CameraSettings(), 1)
    images = {condition: one.under(condition).image for condition in listed}
    for condition in listed[::-1]:
        assert np.array_equal(images[condition], again.under(condition).image)
    assert not np.array_equal(images[listed[0]], SharpFrame(frame, CameraSettings(), 2).under(listed[0]).image)
    assert "folder" in one.formation(listed[0]).key


def test_earlier_frames_are_corrupted_alike_from_draws_of_their_own(tmp_path):
    frame = open_dataset("kitti", "kitti", make_kitti(tmp_path, frames=1)).frames()[0]
    sharp, condition = SharpFrame(frame, CameraSettings(), 1), Condition(BLURS[1], "dcsn", 10.0)
    assert len(sharp.earlier) == len(frame.previous) > 0
    noises = [moment.formation(condition).noise_dn for moment in (sharp, *sharp.earlier)]
    assert all(abs(np.corrcoef(noises[0].ravel(), noise.ravel())[0, 1]) < 0.1 for noise in noises[1:])


class Darker:
    """A corruption with a truth of its own: half the light, and a noise that somebody else has measured."""

    def __call__(self, sharp, frame, condition, seed):
        self.image = (sharp * 0.5).astype(np.float32)
        self.true_mtf = mtf.sample(condition.kernel.psf)
        return self

    def clipped_sigma_dn(self, patches):
        return np.full(len(patches), 3.0)

    def unclipped_sigma_dn(self, patches):
        return np.full(len(patches), np.nan)


def test_a_condition_carries_another_corruption_and_its_truth(frame):
    seen = []

    class Watching:
        def estimate(self, patches):
            seen.append(patches)
            return method.opened(0).estimate(patches)

    method = Method("pca", "sigma_dn", Registered(noise_estimators.create, "pca"))
    tiles = [Patch(0, 0, 128), Patch(128, 0, 128)]
    rows = run([TestFrame(frame, {"sigma_dn": tiles})], [Condition(experiment="darker", corruption=Darker())],
               [Method("watching", "sigma_dn", Watching())])  # fmt: skip
    assert np.array_equal(seen[0][0, 0], frame.image()[:128, :128] * np.float32(0.5))
    assert rows["truth"].tolist() == [3.0, 3.0] and rows["unclipped_truth"].isna().all()
    assert set(rows["experiment"]) == {"darker"}
