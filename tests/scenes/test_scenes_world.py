"""Rays and triangles: where they meet, beside closed forms and beside Embree's own coordinates."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.scenes.dataset import Viewpoint, plan
from pipeline.scenes.world import _meeting
from pipeline.streams import stream

TRIANGLE = np.array([[0, 0, 2], [4, 0, 2], [0, 1, 2]], np.float32)


@pytest.mark.parametrize(("u", "v"), [(0, 0), (1, 0), (0, 1), (0.25, 0.5), (1 / 3, 1 / 3)])
def test_a_ray_meets_a_triangle_at_its_barycentric_weights(u, v):
    point = (1 - u - v) * TRIANGLE[0] + u * TRIANGLE[1] + v * TRIANGLE[2]
    origin = np.array([0.3, -0.7, -1.5], np.float32)
    distance = np.linalg.norm(point - origin)
    direction = ((point - origin) / distance).astype(np.float32)
    answer = [values[0] for values in _meeting(origin[None], direction[None], TRIANGLE[None])]
    np.testing.assert_allclose(answer[:3], [u, v, distance], atol=2e-6)
    np.testing.assert_array_equal(answer[3], [0, 0, 4])


def test_weights_stay_in_the_triangle_where_a_ray_passes_its_edge():
    outside = np.array([[-1e-4, 0.5, 0], [2.1, 0.5, 0], [1, -1e-4, 0]], np.float32)
    up = np.tile(np.array([0, 0, 1], np.float32), (3, 1))
    u, v, distance, _ = _meeting(outside, up, np.tile(TRIANGLE, (3, 1, 1)))
    assert (u >= 0).all() and (v >= 0).all() and (u + v <= 1).all()
    np.testing.assert_allclose(distance, 2)


def test_a_street_is_hit_where_embree_hits_it():
    world = plan(Viewpoint("evaluation", 0), 0).world(0.0)
    direction = stream(1, "rays of the test").normal(size=(20_000, 3)) * (1, 1, 0.2)
    direction = (direction / np.linalg.norm(direction, axis=1, keepdims=True)).astype(np.float32)
    origin = np.tile(np.array([0, 0, 1.5], np.float32), (len(direction), 1))
    ours, embree = world.trace(origin, direction), world._scene.run(origin, direction, output=1)
    hit = ours.thing >= 0
    assert hit.mean() > 0.5
    np.testing.assert_array_equal(ours.thing, embree["geomID"])
    np.testing.assert_allclose(ours.distance_m[hit], embree["tfar"][hit], rtol=2e-5)
    for name in "uv":
        np.testing.assert_allclose(getattr(ours, name)[hit], embree[name][hit], atol=2e-3)
    lengths = np.linalg.norm(ours.geometric, axis=1) * np.linalg.norm(embree["Ng"], axis=1)
    along = (ours.geometric * embree["Ng"]).sum(1)[hit] / lengths[hit]
    assert np.abs(along).min() > 0.999
