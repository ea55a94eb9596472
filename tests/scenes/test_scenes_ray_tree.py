"""Rays and triangles: where they meet, beside closed forms, all triangles in turn, Embree and other instructions."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pipeline.scenes import ray_tree
from pipeline.scenes.dataset import Viewpoint, plan
from pipeline.scenes.ray_tree import RayTree
from pipeline.streams import stream

ROOT = Path(__file__).resolve().parents[2]
TRIANGLE = np.array([[0, 0, 2], [4, 0, 2], [0, 1, 2]], np.float32)


def directions(count, name="rays of the test"):
    chosen = stream(1, name).normal(size=(count, 3))
    return (chosen / np.linalg.norm(chosen, axis=1, keepdims=True)).astype(np.float32)


def soup_of(count, size):
    """Triangles of about `size` in a cube of side 2 around the origin."""
    generator = stream(2, "triangles of the test")
    return (generator.uniform(-1, 1, (count, 1, 3)) + size * generator.normal(size=(count, 3, 3))).astype(np.float32)


def every(triangles, origin, direction):
    """First hits by trying all triangles, solving o + t d = p0 + u e1 + v e2."""
    corners = triangles.astype(np.float64)
    row, best = np.full(len(direction), -1), np.full(len(direction), np.inf)
    for ray, (start, along) in enumerate(zip(origin.astype(np.float64), direction.astype(np.float64), strict=True)):
        sides = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=2)
        matrix = np.concatenate([sides, np.broadcast_to(-along[:, None], (len(corners), 3, 1))], axis=2)
        u, v, t = np.linalg.solve(matrix, (start - corners[:, 0])[..., None])[..., 0].T
        distance = np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), t, np.inf)
        if np.isfinite(distance.min()):
            row[ray], best[ray] = distance.argmin(), distance.min()
    return row, best


@pytest.mark.parametrize(("u", "v"), [(0, 0), (1, 0), (0, 1), (0.25, 0.5), (1 / 3, 1 / 3)])
@pytest.mark.parametrize("side", [1, -1], ids=["from below", "from above"])
def test_a_ray_meets_a_triangle_at_its_barycentric_weights(u, v, side):
    inner = 0.999 * np.array([u, v]) + 0.0003  # rounding of the direction must not lead past the corner
    point = (1 - inner.sum()) * TRIANGLE[0] + inner[0] * TRIANGLE[1] + inner[1] * TRIANGLE[2]
    origin = np.array([0.3, -0.7, 2 - 3.5 * side], np.float32)
    distance = np.linalg.norm(point - origin)
    direction = ((point - origin) / distance).astype(np.float32)
    row, *answer = RayTree(TRIANGLE[None]).first(origin[None], direction[None])
    assert row[0] == 0
    np.testing.assert_allclose(np.ravel(answer), [*inner, distance], atol=2e-6)


@pytest.mark.parametrize(("count", "size"), [(1, 1.0), (2, 1.0), (9, 0.5), (300, 0.2), (3000, 0.05)])
def test_the_tree_finds_what_trying_every_triangle_finds(count, size):
    triangles, direction = soup_of(count, size), directions(200)
    origin = stream(3, "origins").uniform(-2, 2, (200, 3)).astype(np.float32)
    tree = RayTree(triangles)
    row, u, v, distance = tree.first(origin, direction)
    expected, nearest = every(triangles, origin, direction)
    np.testing.assert_array_equal(row, expected)
    np.testing.assert_allclose(distance, nearest, rtol=1e-9)
    assert count < 300 or (row >= 0).mean() > 0.1
    hit = row >= 0
    corners = triangles[row[hit]].astype(np.float64)
    weights = np.stack([1 - u - v, u, v], axis=1)[hit]
    along = origin[hit].astype(np.float64) + distance[hit, None] * direction[hit].astype(np.float64)
    np.testing.assert_allclose((weights[..., None] * corners).sum(axis=1), along, atol=1e-9)
    for reach in (np.inf, float(np.median(nearest[hit])) if hit.any() else 1.0):
        np.testing.assert_array_equal(tree.any(origin, direction, reach), nearest < reach)


def test_no_ray_slips_between_triangles_that_share_an_edge():
    """A closed sphere of triangles, looked at from inside, along its edges and through its corners too."""
    turn, height = np.meshgrid(np.linspace(0, 2 * np.pi, 41), np.linspace(0, np.pi, 21), indexing="ij")
    x, y = np.cos(turn) * np.sin(height), np.sin(turn) * np.sin(height)
    points = np.stack([x, y, np.cos(height)], axis=-1).astype(np.float32)
    points[-1] = points[0]  # the first meridian again, to the last digit
    points[:, 0], points[:, -1] = (0, 0, 1), (0, 0, -1)
    corner = [points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]]
    quads = [np.stack([corner[0], corner[1], corner[2]], -2), np.stack([corner[0], corner[2], corner[3]], -2)]
    tree = RayTree(np.concatenate(quads).reshape(-1, 3, 3))
    middles = (points[:-1] + points[1:]).reshape(-1, 3) / 2
    wanted = np.concatenate([directions(5000), middles / np.linalg.norm(middles, axis=1, keepdims=True)])
    wanted = wanted.astype(np.float32)
    assert (tree.first(np.zeros_like(wanted), wanted)[0] >= 0).all()
    assert tree.any(np.zeros_like(wanted), wanted).all()


def test_rays_along_the_axes_meet_flat_boxes():
    axes = np.concatenate([np.eye(3), -np.eye(3)]).astype(np.float32)
    squares = [np.roll([[-1, -1, at], [3, -1, at], [-1, 3, at]], axis, 1) for axis in range(3) for at in (-2, 2)]
    row, _, _, distance = RayTree(np.array(squares, np.float32)).first(np.zeros((6, 3), np.float32), axes)
    np.testing.assert_array_equal(distance, 2.0)
    assert sorted(row) == list(range(6))


def test_triangles_in_one_place_or_without_area_do_no_harm():
    same = np.repeat(TRIANGLE[None], 100, axis=0)
    point = np.repeat(np.array([[[1, 0.2, 1]]], np.float32), 3, axis=1)  # in front of them
    origin, up = np.array([[1, 0.2, 0]], np.float32), np.array([[0, 0, 1]], np.float32)
    row, _, _, distance = RayTree(np.concatenate([point, same])).first(origin, up)
    assert row[0] >= 1 and distance[0] == 2.0


def test_a_tree_is_never_deeper_than_its_room():
    """Triangles each a twentieth larger than the last, over 72 powers of ten: a bin is left with few of them."""
    scale = (1e-36 * 1.05 ** np.arange(3400))[:, None, None]
    generator = stream(4, "growing triangles")
    triangles = (scale * generator.normal(size=(len(scale), 3, 3))).astype(np.float32)
    tree = RayTree(triangles)
    deepest, waiting = 0, [(0, 0)]
    while waiting:
        box, level = waiting.pop()
        deepest = max(deepest, level)
        if tree._number[box] == 0:
            waiting += [(tree._begin[box], level + 1), (tree._begin[box] + 1, level + 1)]
    assert 64 < deepest < 64 + np.log2(len(triangles))
    origin, direction = np.zeros((50, 3), np.float32), directions(50)
    row, _, _, distance = tree.first(origin, direction)
    hit = row >= 0
    assert hit.any()
    met = triangles[row[hit]].astype(np.float64)
    normal = np.cross(met[:, 1] - met[:, 0], met[:, 2] - met[:, 0])
    along = (normal * met[:, 0]).sum(1) / (normal * direction[hit]).sum(1)
    np.testing.assert_allclose(distance[hit], along, rtol=1e-6)


def test_nothing_is_met_behind_or_beside():
    tree = RayTree(TRIANGLE[None])
    origin = np.array([[1, 0.2, 3], [5, 5, 0]], np.float32)
    up = np.tile(np.array([0, 0, 1], np.float32), (2, 1))
    row, _, _, distance = tree.first(origin, up)
    assert (row == -1).all() and np.isinf(distance).all() and not tree.any(origin, up).any()
    assert len(tree.first(origin[:0], up[:0])[0]) == 0


@pytest.mark.full("a street by two tracers takes 6 s")
def test_a_street_is_hit_where_embree_hits_it():
    """Embree computes in single precision: some rays in a hundred thousand pass an edge on its other side."""
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    world = plan(Viewpoint("evaluation", 0), 0).world(0.0)
    peer = EmbreeScene()
    for one in world.placed:
        TriangleMesh(peer, one.corners())
    direction = directions(20_000) * np.array([1, 1, 0.2], np.float32)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    origin = np.tile(np.array([0, 0, 1.5], np.float32), (len(direction), 1))
    ours, embree = world.trace(origin, direction), peer.run(origin, direction, output=1)
    assert (ours.thing >= 0).mean() > 0.5
    assert (ours.thing != embree["geomID"]).mean() < 5e-4
    hit = (ours.thing >= 0) & (ours.thing == embree["geomID"])
    near = np.abs(ours.distance_m[hit] / embree["tfar"][hit] - 1) < 2e-5
    assert near.mean() > 0.999
    lengths = np.linalg.norm(ours.geometric, axis=1) * np.linalg.norm(embree["Ng"], axis=1)
    along = (ours.geometric * embree["Ng"]).sum(1)[hit] / lengths[hit]
    assert (np.abs(along) > 0.999).mean() > 0.999
    free = world.occluded(origin, direction, 12.0)
    reach = np.full(len(direction), 12, np.float32)
    assert (free != (peer.run(origin, direction, reach, query="OCCLUDED") >= 0)).mean() < 5e-4


def hashed(tree):
    answers = tree.first(np.zeros((2000, 3), np.float32), directions(2000))
    return hashlib.sha256(b"".join(part.tobytes() for part in answers)).hexdigest()


def test_the_answers_do_not_depend_on_the_instruction_set(tmp_path):
    """Compiled for the oldest x86-64 (no AVX, no fused multiply-add) or this processor: the same bytes."""
    code = "from test_scenes_ray_tree import *\nprint(hashed(RayTree(soup_of(3000, 0.1))))"
    environment = os.environ | {
        "NUMBA_CPU_NAME": "generic", "NUMBA_CACHE_DIR": str(tmp_path),
        "PYTHONPATH": os.pathsep.join([str(ROOT), str(Path(__file__).parent)]),
    }  # fmt: skip
    ran = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert ran.stdout.split()[-1] == hashed(RayTree(soup_of(3000, 0.1)))
    assert list(tmp_path.rglob("*.nbc")), "it was not compiled anew"


def test_it_compiles_where_no_folder_can_be_written(monkeypatch):
    asked = []

    def njit(**options):
        asked.append(options)
        if options.pop("cache", False):
            raise RuntimeError("cannot cache function 'f': no locator available for file")
        return lambda function: function

    monkeypatch.setattr(ray_tree.numba, "njit", njit)
    assert ray_tree._compiled(abs) is abs
    assert asked == 2 * [{"nogil": True, "error_model": "numpy"}]
