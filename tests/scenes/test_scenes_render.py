"""Pictures: shapes, ranges, the same bytes for any strip size, tone before the filter, lens across the border."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.scenes import render as module
from pipeline.scenes.light import Light
from pipeline.scenes.objects.base import SceneObject
from pipeline.scenes.pose import Pose
from pipeline.scenes.render import render
from pipeline.scenes.shapes import box
from pipeline.scenes.tone import LINEAR, Tone
from pipeline.scenes.world import Placed, World

POSE = Pose((0.0, 0.0, 1.5), focal_px=60.0, width_px=70, height_px=50)


@pytest.fixture(scope="module")
def world() -> World:
    ground = SceneObject(box([-5, -40, -1], [80, 40, 0], "cobble"))
    house = SceneObject(box([-2, -3, 0], [2, 3, 3], "brick"))
    car = SceneObject(box([-2, -0.9, 0], [2, 0.9, 1.4], "car_paint"), label="car")
    return World([Placed(ground, "ground"), Placed(house, "house", 0.4, (14, 4, 0)), Placed(car, "car", 1, (9, -2, 0))])


def test_pictures_have_the_stated_shape_and_range(world):
    picture = render(world, Light(), POSE, Tone(), samples=2)
    assert picture.grey.shape == picture.radiance.shape == (50, 70)
    assert picture.grey.dtype == picture.radiance.dtype == np.float32
    assert picture.grey.min() >= 0.0 and picture.grey.max() <= 1.0
    assert (picture.radiance > 0).all()
    assert picture.things.shape == (100, 140)
    assert set(np.unique(picture.things)) == {-1, 0, 1, 2}


def test_the_same_bytes_however_the_rays_are_batched(world, monkeypatch):
    whole = render(world, Light(), POSE, Tone(), samples=2)
    monkeypatch.setattr(module, "_RAYS_AT_ONCE", 1000)
    pieces = render(world, Light(), POSE, Tone(), samples=2)
    assert whole.grey.tobytes() == pieces.grey.tobytes()
    assert whole.radiance.tobytes() == pieces.radiance.tobytes()


def test_a_crop_of_the_view_sees_the_same_pixels(world):
    """The lens knows what lies outside the frame: a smaller frame is the middle of a larger one."""
    large = render(world, Light(), POSE, LINEAR, samples=2).radiance
    small_pose = Pose(POSE.position_m, focal_px=60.0, width_px=50, height_px=40)
    small = render(world, Light(), small_pose, LINEAR, samples=2).radiance
    assert np.allclose(large[5:-5, 10:-10], small, rtol=1e-3, atol=1e-3)


def test_many_samples_converge(world):
    few = render(world, Light(), POSE, LINEAR, samples=2).radiance
    more = render(world, Light(), POSE, LINEAR, samples=4).radiance
    assert np.abs(few - more).mean() < 0.05 * more.mean()


def test_tone_curve_acts_before_the_filter(world):
    """On areas of one radiance grey = tone(radiance); across edges the mean of grey levels is not the grey of means."""
    tone = Tone(0.4, 2.2)
    picture = render(world, Light(emissive=True), POSE, tone, samples=3)
    curved = tone(picture.radiance)
    flat = np.abs(curved - picture.grey) < 1e-4
    assert flat[:8].all()  # sky
    assert (curved >= picture.grey - 1e-5).all()  # concave curve: Jensen


def test_tone_is_monotone_clipped_and_linear_when_asked():
    radiance = np.linspace(-1, 5, 50).astype(np.float32)
    grey = Tone(0.4, 2.2)(radiance)
    assert (np.diff(grey) >= 0).all() and grey[0] == 0 and grey[-1] == 1
    assert np.allclose(LINEAR(np.array([0.25], np.float32)), 0.25)


@pytest.mark.parametrize("bad", [{"samples": 0}, {"samples": 99}, {"lens_sigma_px": -1.0}])
def test_bad_arguments_are_named(world, bad):
    with pytest.raises(InputError, match=next(iter(bad))):
        render(world, Light(), POSE, Tone(), **bad)
