"""Roads, footprints, tracks and the plans made of them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.scenes.layout.ground import kerb, plane, ribbon
from pipeline.scenes.layout.ground_paint import RoadPaint, SoilPaint
from pipeline.scenes.layout.hills import hills
from pipeline.scenes.layout.plan import Key
from pipeline.scenes.layout.road import Road
from pipeline.scenes.layout.site import Footprint, Site, footprint_of
from pipeline.scenes.layout.traffic import Along, Stance, Straight
from pipeline.scenes.objects.base import Surface
from pipeline.scenes.shapes import box

BEND = Road(5.0, 1 / 80.0, 15.0, 25.0)


def test_a_road_without_curvature_is_the_x_axis():
    x, y, heading = Road().at([-40.0, 0.0, 33.3, 400.0], [0.0, 2.0, -1.0, 0.0])
    assert np.allclose(x, [-40, 0, 33.3, 400], atol=1e-9)
    assert np.allclose(y, [0, 2, -1, 0], atol=1e-9)
    assert np.allclose(heading, 0)


@given(s=st.floats(-39, 250), d=st.floats(-25, 25))
def test_locate_inverts_at(s, d):
    x, y, _ = BEND.at(s, d)
    back_s, back_d = BEND.locate(x, y)
    # Courses are steps of half a metre: beside a bend the nearest one is off by up to 0.36 m x curvature x d.
    assert back_s[0] == pytest.approx(s, abs=0.15)
    assert back_d[0] == pytest.approx(d, abs=0.02)


def test_a_bend_has_its_radius_and_unit_speed():
    s = np.array([60.0, 61.0, 100.0])
    x, y, heading = BEND.at(s)
    assert np.hypot(x[1] - x[0], y[1] - y[0]) == pytest.approx(1.0, abs=1e-3)
    assert (heading[2] - heading[0]) / 40.0 == pytest.approx(1 / 80.0, rel=1e-3)
    assert heading[0] > 0  # positive curvature bends left


rectangles = st.builds(
    Footprint, st.floats(-5, 5), st.floats(-5, 5), st.floats(-3.2, 3.2), st.floats(0.2, 3), st.floats(0.2, 3)
)


@given(a=rectangles, b=rectangles)
def test_overlap_agrees_with_sampling_and_is_symmetric(a, b):
    assert a.overlaps(b) == b.overlaps(a)
    grid = np.stack(np.meshgrid(np.linspace(-1, 1, 41), np.linspace(-1, 1, 41)), axis=-1).reshape(-1, 2)
    points = np.array([a.x_m, a.y_m]) + grid * [a.half_length_m, a.half_width_m] @ a.axes()
    inside = np.abs((points - [b.x_m, b.y_m]) @ b.axes().T) < [b.half_length_m, b.half_width_m]
    if inside.all(axis=1).any():
        assert a.overlaps(b)


def test_site_keeps_gaps():
    site = Site()
    assert site.claim(Footprint(0, 0, 0, 2, 1))
    assert site.free(Footprint(5, 0, 0, 2, 1), 0.9)
    assert not site.claim(Footprint(5, 0, 0, 2, 1), 1.1)
    assert site.claim(Footprint(5, 0, 0, 2, 1), 0.9)
    assert not site.claim(Footprint(0.5, 0.5, 0.7, 0.1, 0.1))


def test_footprint_follows_the_mesh():
    mesh = box([-1, -0.5, 0], [3, 0.5, 1], "brick")
    result = footprint_of(mesh, 10.0, 5.0, np.pi / 2)
    assert (result.x_m, result.y_m) == pytest.approx((10.0, 6.0), abs=1e-6)
    assert (result.half_length_m, result.half_width_m) == pytest.approx((2.0, 0.5), abs=1e-6)


@pytest.mark.parametrize("track", [
    Straight(Stance(1, 2, 0, 0.7), 3.0),
    Along(BEND, 40.0, -1.75, 8.0),
    Along(BEND, 40.0, 1.75, 8.0, against=True),
])  # fmt: skip
def test_tracks_move_forward_at_their_speed(track):
    now, then = track.at(0.0), track.at(0.05)
    moved = np.array([then.x_m - now.x_m, then.y_m - now.y_m])
    forward = np.array([np.cos(now.yaw_rad), np.sin(now.yaw_rad)])
    assert moved @ forward == pytest.approx(0.05 * track.speed_mps, rel=0.05)
    assert np.linalg.norm(moved) == pytest.approx(0.05 * track.speed_mps, rel=0.05)


@pytest.mark.parametrize("road", [Road(last_m=60), Road(5.0, -1 / 70.0, 5.0, 20.0, last_m=90)])
def test_ground_faces_up_and_carries_road_coordinates(road):
    strip = ribbon(road, -5.0, 5.0, 0.3, "asphalt")
    assert (strip.normal[..., 2] > 0.999).all()
    assert np.allclose(strip.position[..., 2], 0.3)
    s, d = road.locate(strip.position[..., 0].ravel(), strip.position[..., 1].ravel())
    assert np.allclose(strip.uv[..., 1].ravel(), d, atol=0.03)
    inside = strip.uv[..., 0].ravel() < road.last_m
    assert np.allclose(strip.uv[..., 0].ravel()[inside], s[inside], atol=0.05)
    for side in (1, -1):
        stone = kerb(road, side)
        upright = np.abs(stone.normal[:, 0, 2]) < 0.1
        x, y, _ = road.at(20.0, 0.0)
        towards = np.array([x, y]) - stone.position[upright].mean(axis=(1))[:, :2]
        near = np.linalg.norm(towards, axis=1) < 6.0
        assert ((stone.normal[upright][near][:, 0, :2] * towards[near]).sum(axis=1) > 0).all()


def test_planes_face_up():
    assert (plane((-1, -2), (3, 4), 0.0, "grass").normal[..., 2] == 1).all()


def test_hills_close_the_view_and_their_faces_look_out():
    mesh = hills(np.random.default_rng(1), 300.0, 20.0)
    reach = np.hypot(mesh.position[..., 0], mesh.position[..., 1])
    assert reach.min() > 290 and reach.max() < 400
    assert 15 < mesh.position[..., 2].max() < 90
    # from the origin, faces and shading normals agree on which side is out, but for the roughness of crowns
    cross = np.cross(mesh.position[:, 1] - mesh.position[:, 0], mesh.position[:, 2] - mesh.position[:, 0])
    assert ((cross * mesh.normal.mean(axis=1)).sum(axis=1) > 0).mean() > 0.9
    # no gap in the skyline: every direction meets something above the eye
    angle = np.arctan2(mesh.position[..., 1], mesh.position[..., 0]).ravel()
    height = mesh.position[..., 2].ravel()
    bins = np.digitize(angle, np.linspace(-0.95, 0.95, 60))
    assert min(height[bins == k].max() for k in range(1, 60)) > 4.0


def surface(uv: np.ndarray, albedo: float = 0.18) -> Surface:
    uv = uv.astype(np.float32)
    flat = np.zeros((len(uv), 3), np.float32)
    return Surface(flat, flat, uv, np.full(len(uv), albedo, np.float32), np.full(len(uv), 1e-3, np.float32))


def test_markings_are_where_they_belong():
    paint = RoadPaint(5.0, edge=True, crossing_m=14.0)
    along = np.linspace(0.1, 2.9, 400)
    centre, _ = paint(surface(np.stack([along, np.zeros(400)], 1)))
    gap, _ = paint(surface(np.stack([along + 24.0 + 3.0, np.zeros(400)], 1)))
    lane, _ = paint(surface(np.stack([along, np.full(400, 1.7)], 1)))
    assert np.median(centre) > 2.0 * np.median(gap)
    assert np.median(centre) > 2.0 * np.median(lane)
    zebra, _ = paint(surface(np.stack([np.full(400, 14.0), np.linspace(-4, 4, 400)], 1)))
    assert 0.35 < (zebra > 0.35).mean() < 0.6
    assert zebra.min() > 0 and zebra.max() < 0.9


def test_soils_mix_and_paths_are_worn():
    path = SoilPaint("dirt", bias=-9.0, path=((0.0, 0.0), (40.0, 0.0)), path_width_m=1.0)
    across = np.stack([np.full(200, 20.0), np.linspace(-10, 10, 200)], 1)
    albedo, f0 = path(surface(across, 0.05))
    on = np.abs(across[:, 1]) < 0.4
    off = np.abs(across[:, 1]) > 4.0
    assert albedo[on].mean() > 2 * albedo[off].mean()
    assert (f0 == 0).all() and (albedo > 0).all() and (albedo < 1).all()


def test_keys_name_different_streams():
    key, other = Key(0, "train", 3), Key(0, "evaluation", 3)
    assert key.stream("camera").random() == key.stream("camera").random()
    assert key.stream("camera").random() != other.stream("camera").random()
    assert key.stream("car", 1).random() != key.stream("car", 2).random()
