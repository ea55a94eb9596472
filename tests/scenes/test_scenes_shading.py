"""Light on surfaces against closed forms: Lambert, shadow, ambient, Fresnel, haze; and the tables of a world."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.scenes.light import SUN_RADIUS_RAD, Light, ambient_directions
from pipeline.scenes.mesh import soup
from pipeline.scenes.objects.base import SceneObject
from pipeline.scenes.objects.materials import MATERIALS
from pipeline.scenes.shading import Directions, shade
from pipeline.scenes.sky import sky_radiance
from pipeline.scenes.world import Placed, World

CLEAR = Light(azimuth_rad=0.4, elevation_rad=0.8, haze_m=1e9)
MATTE = "hedge"  # no texture, no mirror


def slab(half: float, height: float, material: str = MATTE) -> SceneObject:
    corners = [[-half, -half, height], [half, -half, height], [half, half, height], [-half, half, height]]
    return SceneObject(
        soup(corners, [[0, 1, 2], [0, 2, 3]], material), tint={material: 0.3 / MATERIALS[material].albedo}
    )


def look_down(world: World, light: Light, at=(0.0, 0.0), height=5.0, samples=1, ambient=64) -> float:
    origin = np.array([at[0], at[1], height], np.float32)
    ray = np.array([[0.0, 0.0, -1.0]], np.float32)
    directions = Directions.of(light, samples, ambient)
    radiance, thing = shade(world, light, directions, origin, ray, np.zeros(1, int), 1e-4)
    assert thing[0] >= 0
    return float(radiance[0])


def test_an_open_plane_gets_lambert_sun_and_the_whole_sky():
    world = World([Placed(slab(200, 0), "ground")])
    radiance = look_down(world, CLEAR)
    sun = CLEAR.sun * np.sin(CLEAR.elevation_rad)
    # cosine-weighted hemisphere: the mean cosine of directions uniform in z^2 is 2/3, so twice it is 4/3
    z = ambient_directions(1, 64)[0, :, 2]
    sky = CLEAR.ambient * 2 * z.mean() + CLEAR.ambient * (0.12 * 0.4 + 0.05)
    assert radiance == pytest.approx(0.3 * (sun + sky), rel=1e-4)


def test_doubling_the_sun_adds_its_share_once_more():
    world = World([Placed(slab(200, 0), "ground")])
    one = look_down(world, CLEAR)
    two = look_down(world, dataclasses.replace(CLEAR, sun=2 * CLEAR.sun))
    assert two - one == pytest.approx(0.3 * CLEAR.sun * np.sin(CLEAR.elevation_rad), rel=1e-4)


def test_a_roof_shades_what_lies_away_from_the_sun():
    world = World([Placed(slab(200, 0), "ground"), Placed(slab(1.0, 1.0), "roof")])
    reach = 1.0 / np.tan(CLEAR.elevation_rad)
    away = -np.array([np.cos(CLEAR.azimuth_rad), np.sin(CLEAR.azimuth_rad)]) * reach
    # seen from below the roof so that the roof does not hide the ground
    shaded = look_down(world, CLEAR, away, height=0.5)
    open_ground = look_down(world, CLEAR, (20.0, 0.0), height=0.5)
    assert shaded < 0.4 * open_ground
    lit = look_down(world, CLEAR, -away * 3, height=0.5)
    assert lit > 0.8 * open_ground


def test_ambient_is_closed_off_by_a_lid():
    dark = dataclasses.replace(CLEAR, sun=0.0)
    world = World([Placed(slab(200, 0), "ground"), Placed(slab(30.0, 2.0), "lid")])
    radiance = look_down(world, dark, height=1.0)
    assert radiance == pytest.approx(0.3 * dark.ambient * (0.12 * 0.4 + 0.05), rel=1e-3)


def test_haze_takes_63_percent_at_its_distance():
    world = World([Placed(slab(200, 0), "ground")])
    near = look_down(world, CLEAR)
    far = look_down(world, dataclasses.replace(CLEAR, haze_m=5.0))
    assert far == pytest.approx(near * np.exp(-1) + 1.4 * (1 - np.exp(-1)), rel=1e-3)


def test_a_mirror_shows_the_sky_by_schlick():
    light = dataclasses.replace(CLEAR, sun=0.0, ambient=0.0)
    thing = SceneObject(slab(200, 0, "chrome").mesh, tint={"chrome": 0.0})
    world = World([Placed(thing, "mirror")])
    down = np.array([[np.sin(1.2), 0.0, -np.cos(1.2)]], np.float32)
    radiance, _ = shade(
        world, light, Directions.of(light, 1, 1), np.array([0, 0, 1], np.float32), down, np.zeros(1, int), 1e-4
    )
    share = 0.5 + 0.5 * (1 - np.cos(1.2)) ** 5
    up = down * [1, 1, -1]
    assert radiance[0] == pytest.approx(share * sky_radiance(up.astype(np.float32), light)[0], rel=1e-3)


def test_turning_an_object_and_the_light_together_changes_nothing():
    box = slab(2.0, 0.0, "brick")
    origin = np.array([0, 0, 4], np.float32)
    ray = np.array([[0.05, 0.1, -1.0]], np.float32)
    ray /= np.linalg.norm(ray)
    values = []
    for turn in (0.0, 1.1):
        c, s = np.cos(turn), np.sin(turn)
        moved = (ray @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]], np.float32).T).astype(np.float32)
        light = dataclasses.replace(CLEAR, azimuth_rad=CLEAR.azimuth_rad + turn, ambient=0.0)
        world = World([Placed(box, "box", yaw_rad=turn)])
        radiance, _ = shade(world, light, Directions.of(light, 1, 1), origin, moved, np.zeros(1, int), 1e-3)
        values.append(radiance[0])
    assert values[0] == pytest.approx(values[1], rel=1e-4)


def test_ambient_directions_are_unit_and_above_the_ground():
    directions = ambient_directions(9, 2)
    assert directions.shape == (9, 2, 3)
    assert np.allclose(np.linalg.norm(directions, axis=2), 1.0, atol=1e-6)
    assert (directions[..., 2] > 0).all()
    # no preferred horizontal direction
    assert np.abs(directions[..., :2].mean(axis=(0, 1))).max() < 0.06


def test_sun_directions_lie_on_its_disc():
    towards = CLEAR.sun_directions(9)
    angle = np.arccos(np.clip(towards.astype(np.float64) @ CLEAR.towards_sun, -1, 1))
    assert angle.max() < 0.0048 and angle.max() > 0.003
    assert np.allclose(CLEAR.sun_directions(1), CLEAR.towards_sun, atol=1e-6)
    # evenly by area: half of them within 0.71 of the radius
    radius = np.linalg.norm(np.cross(CLEAR.sun_directions(400).astype(np.float64), CLEAR.towards_sun), axis=1)
    assert np.mean(radius < SUN_RADIUS_RAD / np.sqrt(2)) == pytest.approx(0.5, abs=0.01)


def test_a_painter_replaces_albedo_and_sees_object_coordinates():
    seen = {}

    def paint(surface):
        seen.update(local=surface.local.copy(), normal=surface.normal.copy(), view=surface.view.copy())
        return np.full(len(surface.local), 0.5, np.float32), np.zeros(len(surface.local), np.float32)

    thing = SceneObject(slab(2.0, 0.0, "brick").mesh, paint={"brick": paint})
    world = World([Placed(thing, "box", 0.7, (3.0, 1.0, 0.5), 1.0)])
    light = Light(emissive=True)
    origin = np.array([3.0 + np.cos(0.7), 1.0 + np.sin(0.7), 5.0], np.float32)
    radiance, _ = shade(
        world, light, Directions.of(light, 1, 1), origin, np.array([[0, 0, -1]], np.float32), np.zeros(1, int), 1e-3
    )
    assert radiance[0] == pytest.approx(0.5)
    assert np.allclose(seen["local"], [[1.0, 0.0, 0.0]], atol=1e-5)
    assert np.allclose(seen["normal"], [[0, 0, 1]], atol=1e-6)
    assert np.allclose(seen["view"], [[0, 0, -1]], atol=1e-6)


def test_a_painter_sees_view_and_size_of_a_sample_in_object_coordinates():
    """Of an object twice as large a sample covers half as much, in its own metres."""
    seen = {}

    def paint(surface):
        seen.update(view=surface.view.copy(), foot=surface.footprint_m.copy())
        return np.full(len(surface.local), 0.5, np.float32), np.zeros(len(surface.local), np.float32)

    thing = SceneObject(slab(2.0, 0.0, "brick").mesh, paint={"brick": paint})
    world = World([Placed(thing, "box", 0.7, (0.0, 0.0, 0.0), 2.0)])
    origin, slant = np.array([0.0, 0.0, 5.0], np.float32), 0.3
    ray = np.array([[np.sin(slant), 0.0, -np.cos(slant)]], np.float32)
    shade(world, Light(emissive=True), Directions.of(CLEAR, 1, 1), origin, ray, np.zeros(1, int), 1e-3)
    # the world's x axis lies 0.7 rad to the right of the object's own
    expected = [np.sin(slant) * np.cos(0.7), -np.sin(slant) * np.sin(0.7), -np.cos(slant)]
    np.testing.assert_allclose(seen["view"], [expected], atol=1e-6)
    distance = 5.0 / np.cos(slant)
    assert seen["foot"][0] == pytest.approx(0.8e-3 * distance / np.sqrt(np.cos(slant)) / 2.0, rel=1e-4)


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_tangents_are_the_directions_in_which_texture_coordinates_grow(mirror):
    corners = np.array([[0.0, 0.0, 1.0], [2.0, 1.0, 1.0], [-1.0, 3.0, 1.0]])
    uv = np.stack([mirror * corners[:, 1], corners[:, 0]], axis=1)
    world = World([Placed(SceneObject(soup(corners, [[0, 1, 2]], "brick", uv=uv)), "x")])
    np.testing.assert_allclose(world.tangents, [[0, mirror, 0, 1, 0, 0]], atol=1e-6)


def test_the_samples_of_a_pixel_see_different_parts_of_the_sun():
    """Below the edge of a roof 50 m high, where half of the sun's disc is hidden."""
    light = dataclasses.replace(CLEAR, azimuth_rad=0.0, ambient=0.0)
    world = World([Placed(slab(200, 0), "ground"), Placed(slab(100.0, 50.0), "roof")])
    samples = np.arange(100)
    at = np.array([100.0 - 50.0 / np.tan(light.elevation_rad), 0.0, 1.0], np.float32)
    down = np.tile(np.array([[0.0, 0.0, -1.0]], np.float32), (len(samples), 1))
    radiance, _ = shade(world, light, Directions.of(light, len(samples), 1), at, down, samples, 1e-4)
    full = 0.3 * light.sun * np.sin(light.elevation_rad)
    assert radiance.mean() == pytest.approx(full / 2, rel=0.1)


def test_a_white_surface_facing_the_sun_sends_out_all_of_its_90_klx():
    """Luminance of a white diffuse surface, integrated over the hemisphere with the cosine, is its illuminance."""
    z = (np.arange(1_000) + 0.5) / 1_000  # even in solid angle
    exitance_lx = Light().sun * 9200 * 2 * np.pi * z.mean()  # a unit of radiance is about 9200 cd/m^2
    assert exitance_lx == pytest.approx(90_000, rel=0.01)


def test_copies_of_one_mesh_share_their_attributes():
    box = slab(1.0, 0.0)
    world = World([Placed(box, "a"), Placed(box, "b", 0.0, (5, 0, 0))])
    assert len(world.corners) == len(box.mesh)
    hits = world.trace(np.array([5, 0, 3], np.float32), np.array([[0, 0, -1]], np.float32))
    assert hits.thing[0] == 1 and hits.face[0] < len(box.mesh)


def test_bad_worlds_are_refused():
    with pytest.raises(InputError, match="at least one object"):
        World([])
    unknown = SceneObject(soup([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], "brik"))
    with pytest.raises(InputError, match=r"brik.*brick"):
        World([Placed(unknown, "x")])
    empty = SceneObject(soup([[0, 0, 0], [0, 0, 0], [0, 0, 0]], [[0, 1, 2]], "brick"), kind="nothing")
    with pytest.raises(InputError, match="no triangles"):
        World([Placed(empty, "x")])
    with pytest.raises(InputError, match=r"'x' \(wall\) has corners that are not finite"):
        World([Placed(SceneObject(soup(np.eye(3), [[0, 1, 2]], "brick"), kind="wall"), "x", position_m=(np.inf, 0, 0))])
