"""The Sim dataset: pure functions of their key, splits apart, motion that is consistent, labels of known classes."""

from __future__ import annotations

import multiprocessing

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.scenes.dataset import MOMENT_S, MOMENTS, Viewpoint, plan, render
from pipeline.scenes.labels import LABELS

SHOWN = ((0, (0,)), (1, (0, 3)))  # viewpoints and their moments
TINY = {"samples": 1, "width_px": 112, "height_px": 96}


@pytest.fixture(scope="module")
def frames():
    return {number: [render(Viewpoint("train", number), m, 7, **TINY) for m in moments] for number, moments in SHOWN}


@pytest.fixture(scope="module", params=[0, 1])
def scene(request):
    """The plan of a viewpoint, made once for all its tests."""
    return plan(Viewpoint("train", request.param), 7)


def test_frames_have_the_stated_form(frames):
    for number, moments in SHOWN:
        for moment, frame in zip(moments, frames[number], strict=True):
            assert frame.name == f"train-{number:04d}-{moment}"
            assert frame.grey.shape == frame.radiance.shape == (96, 112)
            assert frame.grey.dtype == frame.radiance.dtype == np.float32
            assert frame.grey.min() >= 0 and frame.grey.max() <= 1
            assert (frame.radiance > 0).all() and np.isfinite(frame.radiance).all()
            assert frame.eight_bit().dtype == np.uint8
            assert 40 < frame.eight_bit().mean() < 200 and frame.eight_bit().std() > 30


def test_boxes_are_of_known_classes_and_lie_in_the_frame(frames):
    kinds = set()
    for several in frames.values():
        for frame in several:
            assert len(frame.boxes) > 3
            for box in frame.boxes:
                kinds.add(box.label)
                assert box.label in LABELS
                assert 0 <= box.x1 < box.x2 <= 112 and 0 <= box.y1 < box.y2 <= 96
                assert 0 < box.visible_fraction <= 1
                assert box.pixels <= (box.x2 - box.x1) * (box.y2 - box.y1) + 1e-9
                # the visible part lies within the whole (to one sample)
                low, high = np.array(box.amodal[:2]), np.array(box.amodal[2:])
                assert (np.array([box.x1, box.y1]) > low - 1.01).all() and (
                    np.array([box.x2, box.y2]) < high + 1.01
                ).all()
    assert kinds == set(LABELS)


def test_a_frame_is_a_function_of_its_key_alone(frames):
    plan.cache_clear()  # a later moment without the earlier ones
    again = render(Viewpoint("train", 1), 3, 7, **TINY)
    assert again.grey.tobytes() == frames[1][1].grey.tobytes()
    assert again.radiance.tobytes() == frames[1][1].radiance.tobytes()
    assert again.boxes == frames[1][1].boxes


def _bytes(number: int) -> bytes:
    return render(Viewpoint("train", number), 0, 7, **TINY).radiance.tobytes()


@pytest.mark.full("rendering again takes 10 s")
@pytest.mark.slow
def test_the_same_bytes_in_another_process(frames):
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        (there,) = pool.map(_bytes, [0])
    assert there == frames[0][0].radiance.tobytes()


def test_splits_and_numbers_give_different_scenes():
    scenes = [("train", 1), ("train", 3), ("evaluation", 1)]
    focal = {plan(Viewpoint(split, number), 7).camera.focal_px for split, number in scenes}
    assert len(focal) == len(scenes)


def test_streets_and_villages_alternate():
    assert [Viewpoint("train", n).scene for n in range(4)] == ["street", "village", "street", "village"]


def test_what_moves_moves_steadily_and_the_rest_stays(scene):
    times = np.arange(MOMENTS) * MOMENT_S
    moving = 0
    for actor in scene.actors:
        at = np.array([[s.x_m, s.y_m] for s in (actor.track.at(t) for t in times)])
        steps = np.linalg.norm(np.diff(at, axis=0), axis=1)
        assert np.allclose(steps, abs(actor.track.speed_mps) * MOMENT_S, atol=0.06)
        moving += steps[0] > 0.01
    assert moving >= 2
    eye = np.array([scene.camera.pose(t, 896, 768).position_m for t in times])
    assert np.allclose(np.linalg.norm(np.diff(eye, axis=0), axis=1), scene.camera.track.speed_mps * MOMENT_S, atol=0.01)


def test_the_same_objects_at_every_moment(scene):
    now, later = [actor.placed(0.0) for actor in scene.actors], [actor.placed(0.3) for actor in scene.actors]
    assert [a.name for a in now] == [b.name for b in later]
    assert len({a.name for a in now}) == len(now)
    for a, b in zip(now, later, strict=True):
        assert a.thing.label == b.thing.label and a.thing.kind == b.thing.kind
        assert dict(a.thing.tint) == dict(b.thing.tint)
        assert len(a.thing.mesh) == len(b.thing.mesh)
        if a.thing.label is None:
            assert a.position_m == b.position_m


def test_cars_do_not_stand_in_each_other(scene):
    from pipeline.scenes.layout.site import footprint_of

    cars = [p for p in (a.placed(0.0) for a in scene.actors) if p.thing.label == "car"]
    prints = [footprint_of(c.thing.mesh, c.position_m[0], c.position_m[1], c.yaw_rad) for c in cars]
    assert len(cars) >= 2
    assert not any(a.overlaps(b) for i, a in enumerate(prints) for b in prints[:i])


def test_bad_input_is_named():
    with pytest.raises(InputError, match="did you mean 'train'"):
        Viewpoint("trian", 0)
    with pytest.raises(InputError, match="expected 0 or more"):
        Viewpoint("train", -1)
    with pytest.raises(InputError, match="moment 4"):
        render(Viewpoint("train", 0), 4, 0)
    with pytest.raises(InputError, match="at least 32"):
        render(Viewpoint("train", 0), 0, 0, width_px=8)
