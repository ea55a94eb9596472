"""Conditions of a sweep: the same physics as the camera model, one draw per frame, scenes and frames chosen."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from data_makers import make_folder, make_sim

from pipeline.camera import levels
from pipeline.datasets import conditions as module
from pipeline.datasets.conditions import conditions, evaluation_frames, kernels, scene_of
from pipeline.datasets.corrupted import CameraSettings
from pipeline.datasets.folder import Folder
from pipeline.streams import stream

LEVELS = (0.0, 5.0, 15.0)
BLURS = kernels("linear_motion", [0, 3, 21], [0, 45], "nominal", 1)


@pytest.fixture
def frame(tmp_path):
    return Folder("folder", make_folder(tmp_path / "data", frames=1)).frames()[0]


def test_the_sharp_kernel_comes_first_and_sizes_keep_their_directions():
    assert [(k.name, k.size_px, k.angle_deg) for k in BLURS] == [
        ("sharp", 0.0, 0.0),
        ("linear_motion_3_0", 3, 0),
        ("linear_motion_3_45", 3, 45),
        ("linear_motion_21_0", 21, 0),
        ("linear_motion_21_45", 21, 45),
    ]
    np.testing.assert_allclose(BLURS[1].psf, [[0, 0, 0], [1 / 3] * 3, [0, 0, 0]], atol=1e-6)  # 0 degrees: horizontal
    assert (BLURS[3].psf > 0.04).sum() == 21


@pytest.mark.parametrize("effect", ["dcsn", "readout", "sensor", "photon", "combined"])
@pytest.mark.parametrize("kind", ["physical", "authors"])
def test_every_image_is_the_camera_models_own(frame, effect, kind):
    """Bit for bit, though the optics are passed once: noise after the optics leaves the blurred light alone."""
    camera, sharp = CameraSettings(kind), frame.image()
    for kernel in (BLURS[0], BLURS[-1]):
        for level, shown in conditions(sharp, frame, kernel, effect, LEVELS, camera, 7):
            generator = stream(7, "conditions", "folder", frame.name, effect)
            psf = None if kernel.name == "sharp" else kernel.psf
            expected = levels.corrupt(sharp, effect, sigma_dn=level, generator=generator, psf=psf, camera=kind)
            np.testing.assert_array_equal(shown.image, expected.image)
            assert shown.level_dn == level


def test_the_optics_are_passed_once_for_all_levels(frame, monkeypatch):
    calls = []
    optics = module.through_optics
    monkeypatch.setattr(module, "through_optics", lambda *given: calls.append(1) or optics(*given))
    assert len(list(conditions(frame.image(), frame, BLURS[2], "dcsn", LEVELS, CameraSettings(), 1))) == 3
    assert len(calls) == 1


def test_levels_of_a_frame_scale_one_draw_and_frames_draw_their_own(frame):
    sharp = np.full((64, 64), 0.5, np.float32)

    def noise(one, kernel):
        shown = dict(conditions(sharp, one, kernel, "dcsn", (0.0, 10.0, 20.0), CameraSettings(), 1))
        assert shown[10.0].sigma_dn == pytest.approx(10.0, rel=1e-3)
        return [255 * (shown[level].image - shown[0.0].image) for level in (10.0, 20.0)]

    small, large = noise(frame, BLURS[0])
    assert np.corrcoef(small.ravel(), large.ravel())[0, 1] > 0.99
    blurred, _ = noise(frame, BLURS[3])
    assert np.corrcoef(small.ravel(), blurred.ravel())[0, 1] > 0.99  # the same draw behind every kernel
    other, _ = noise(dataclasses.replace(frame, name="other"), BLURS[0])
    assert abs(np.corrcoef(small.ravel(), other.ravel())[0, 1]) < 0.1


def test_more_moments_can_be_judged_than_the_index_holds(tmp_path):
    class Section(SimpleNamespace):
        def model_copy(self, update):
            return Section(**{**vars(self), **update})

    root = make_sim(tmp_path / "sim", viewpoints=2)
    section = Section(kind="sim", root=str(root), whitelist=None, limit=1, options={}, max_bad_share=0.0)
    frames = evaluation_frames(tmp_path, "sim", section, {"moments": "all"})
    assert len(frames) == 8
    chosen = evaluation_frames(tmp_path, "sim", section, {"moments": "all"}, 4)
    assert [frame.name[-6:] for frame in chosen] == ["0000-0", "0000-2", "0001-0", "0001-2"]
    assert len({scene_of("sim", frame.name) for frame in frames}) == 2
    assert scene_of("kitti", "000012") == "000012" and scene_of("folder", "street-3") == "street-3"
