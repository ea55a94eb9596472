"""Objects: right sizes, known materials, sound geometry, honest paint, and the same thing every time."""

import functools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.errors import InputError
from pipeline.scenes.objects import bicycle, brush, car, fence, house, person, street_furniture, tree
from pipeline.scenes.objects.base import SceneObject, Surface
from pipeline.scenes.objects.car_body import CarBody
from pipeline.scenes.objects.car_interior import Cabin
from pipeline.scenes.objects.figure import FOREARM, SHANK, THIGH, UPPER_ARM, Figure
from pipeline.scenes.objects.materials import MATERIALS
from pipeline.scenes.objects.pose import reach, sole, walking
from pipeline.scenes.objects.wheel import wheel
from pipeline.scenes.textures import library
from pipeline.streams import stream

MAKERS = {
    **{f"car {kind}": lambda g, kind=kind: car.make(kind, g) for kind in car.KINDS},
    **{f"tree {name}": lambda g, name=name: tree.make(g, species=name) for name in tree.SPECIES},
    **{f"fence {kind}": lambda g, kind=kind: fence.make(kind, 3.0, g) for kind in fence.KINDS},
    **{f"street {kind}": lambda g, kind=kind: street_furniture.make(kind, g) for kind in street_furniture.KINDS},
    "far tree": lambda g: tree.make(g, far=True),
    "person": person.make,
    "bicycle": bicycle.make,
    "rider": bicycle.make_rider,
    "house": house.make,
    "kerb": lambda g: street_furniture.kerb(4.5),
}
# lowest and highest length (x), width (y) and height (z), metres
SIZES = {
    "car": ((3.8, 5.3), (1.9, 2.4), (1.35, 2.15)),
    "person": ((0.25, 1.2), (0.35, 0.8), (1.45, 2.0)),
    "rider": ((0.5, 1.1), (0.4, 0.8), (1.2, 1.75)),
    "bicycle": ((1.6, 1.85), (0.5, 0.7), (0.9, 1.2)),
    "house": ((5.5, 18.0), (6.5, 18.0), (4.5, 15.0)),
    "tree": ((1.5, 12.0), (1.5, 12.0), (6.0, 19.0)),
}


def made_now(name: str, seed: int = 0) -> SceneObject:
    return MAKERS[name](stream(seed, "objects", name))


made = functools.cache(made_now)
"""The same, made once: no test changes it."""


def surface_of(thing: SceneObject, material: str, count: int = 400, footprint_m: float = 0.004) -> Surface:
    """Random points on one material of an object, seen from all sides."""
    draw = stream(11, "surface", material)
    mesh = thing.mesh
    faces = np.flatnonzero(np.array(mesh.materials)[mesh.material] == material)
    face = draw.choice(faces, count)
    weight = draw.dirichlet((1, 1, 1), count).astype(np.float32)

    def mix(values: np.ndarray) -> np.ndarray:
        return np.einsum("kc,kca->ka", weight, values[face]).astype(np.float32)

    normal = mix(mesh.normal)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    view = draw.normal(size=(count, 3)).astype(np.float32)
    view *= -np.sign(np.einsum("ij,ij->i", view, normal))[:, None]
    view /= np.linalg.norm(view, axis=1, keepdims=True)
    tone = np.full(count, 0.3 * thing.tint.get(material, 1.0), np.float32)
    return Surface(mix(mesh.local), normal, mix(mesh.uv), tone, np.full(count, footprint_m, np.float32), view)


@pytest.mark.parametrize("name", MAKERS)
def test_geometry_is_sound(name):
    mesh = made(name).mesh
    for values in (mesh.position, mesh.normal, mesh.local, mesh.uv):
        assert values.dtype == np.float32
        assert np.isfinite(values).all()
        assert len(values) == len(mesh)
    np.testing.assert_allclose(np.linalg.norm(mesh.normal, axis=2), 1, atol=1e-3)
    assert mesh.material.max() < len(mesh.materials)


@pytest.mark.parametrize("name", MAKERS)
def test_every_material_is_known(name):
    thing = made(name)
    for material in (*thing.mesh.materials, *thing.tint, *thing.paint):
        assert material in MATERIALS


@pytest.mark.parametrize("name", MAKERS)
def test_the_same_stream_makes_the_same_bytes(name):
    first, second, other = made(name), made_now(name), made(name, 1)
    assert first.mesh.position.tobytes() == second.mesh.position.tobytes()
    assert first.mesh.normal.tobytes() == second.mesh.normal.tobytes()
    assert first.tint == second.tint
    assert first.kind == second.kind
    if name != "kerb":
        assert first.mesh.position.tobytes() != other.mesh.position.tobytes() or first.tint != other.tint


@pytest.mark.parametrize("name", [n for n in MAKERS if n.split()[0] in SIZES])
@pytest.mark.parametrize("seed", range(4))
def test_sizes_are_those_of_real_things(name, seed):
    spread = np.ptp(made(name, seed).mesh.position.reshape(-1, 3), axis=0)
    for length, (low, high) in zip(spread, SIZES[name.split()[0]], strict=True):
        assert low <= length <= high


@pytest.mark.parametrize("name", [n for n in MAKERS if n.split()[0] in ("car", "person", "bicycle")])
def test_things_stand_on_the_ground(name):
    low = made(name).mesh.position[..., 2].min()
    assert abs(low) < 0.012


def test_labels_are_those_of_detectors():
    assert {made(f"car {kind}").label for kind in car.KINDS} == {"car"}
    assert made("person").label == made("rider").label == "person"
    assert made("bicycle").label == "bicycle"
    assert made("house").label is None
    assert made("tree oak").label is None


@pytest.mark.parametrize(
    ("name", "limit"), [("car van", 16_000), ("person", 6_000), ("tree spruce", 35_000), ("far tree", 11_000)]
)
def test_triangles_stay_within_their_budget(name, limit):
    assert max(len(made(name, seed).mesh) for seed in range(5)) <= limit


@pytest.mark.parametrize("name", [n for n in MAKERS if n.split()[0] not in ("tree", "kerb")])
@pytest.mark.parametrize("footprint_m", [0.001, 0.05, 2.0])
def test_paint_is_a_possible_colour(name, footprint_m):
    thing = made(name)
    for material, painter in thing.paint.items():
        if material not in thing.mesh.materials:
            continue
        surface = surface_of(thing, material, footprint_m=footprint_m)
        for seen in (surface, Surface(surface.local, surface.normal, surface.uv, surface.albedo, surface.footprint_m)):
            albedo, f0 = painter(seen)
            assert albedo.dtype == f0.dtype == np.float32
            assert albedo.shape == f0.shape == (len(surface.local),)
            assert 0 < albedo.min() <= albedo.max() < 1
            assert 0 <= f0.min() <= f0.max() <= 1


def test_materials_without_paint_show_mirrors_their_texture():
    textures = library(0, 256)
    for name, material in MATERIALS.items():
        assert 0 < material.albedo <= 1
        assert 0 <= material.f0 <= 1
        if material.texture is not None:
            assert material.albedo == pytest.approx(textures[material.texture].mean_albedo, rel=0.12), name
    assert MATERIALS["leaf"].two_sided


def closed(position: np.ndarray) -> bool:
    points, index = np.unique(position.reshape(-1, 3), axis=0, return_inverse=True)
    faces = index.reshape(-1, 3)
    begin, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    edges, count = np.unique(begin * len(points) + end, return_counts=True)
    back, back_count = np.unique(end * len(points) + begin, return_counts=True)
    return np.array_equal(edges, back) and np.array_equal(count, back_count)


def enclosed(position: np.ndarray) -> float:
    corners = position.astype(float)
    return float(np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6)


@pytest.mark.parametrize("kind", car.KINDS)
def test_wheel_wells_are_cut_out_of_a_closed_body(kind):
    body = CarBody.draw(kind, stream(0, "body", kind))
    whole, cut = body.mesh(arches=False), body.mesh()
    assert closed(whole.position)
    assert set(cut.materials) == {"car_body", "black"}
    lost = enclosed(whole.position) - enclosed(cut.position)
    # four segments of cylinders about a quarter of a metre deep
    assert 0.15 < lost < 0.6
    # nothing of the body is left where the wheels turn
    for x in body.axles_m:
        middle = cut.position[np.array(cut.materials)[cut.material] == "car_body"].mean(axis=1)
        near = np.hypot(middle[:, 0] - x, middle[:, 2] - body.type.wheel_m) < body.type.wheel_m - 0.02
        assert not (near & (np.abs(middle[:, 1]) > body.width_m / 2 - 0.15)).any()
    flat = np.cross(cut.position[:, 1] - cut.position[:, 0], cut.position[:, 2] - cut.position[:, 0])
    flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-12)
    assert (np.einsum("fcx,fx->fc", cut.normal, flat).min(axis=1) > 0.25).mean() > 0.995


def test_a_body_without_the_boolean_library_stays_whole(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "manifold3d", None)
    body = CarBody.draw("suv", stream(0, "body"))
    mesh = body.mesh()
    assert mesh.materials == ("car_body",)
    assert closed(mesh.position)


def test_an_unknown_car_is_refused_with_the_nearest_name():
    with pytest.raises(InputError, match="did you mean 'sedan'"):
        car.make("sedann", stream(0, "x"))


def test_wheels_roll_without_sliding_and_keep_their_pattern():
    still = wheel(0.33)
    rolled = wheel(0.33, 0.8)
    np.testing.assert_array_equal(still.local, rolled.local)
    # the top of a wheel that rolls towards +x moves to +x
    top = still.position.reshape(-1, 3)[:, 2].argmax()
    assert rolled.position.reshape(-1, 3)[top, 0] > still.position.reshape(-1, 3)[top, 0] + 0.2
    full = car.make("sedan", stream(1, "c"), travel_m=0.0)
    moved = car.make("sedan", stream(1, "c"), travel_m=2 * np.pi * 0.325)
    np.testing.assert_allclose(full.mesh.position, moved.mesh.position, atol=1e-4)
    np.testing.assert_allclose(wheel(0.3, left=False).position[..., 1].min(), -0.109, atol=1e-3)


def test_windows_of_a_white_car_are_dark_and_its_doors_are_not():
    thing = next(t for t in (car.make("sedan", stream(s, "white")) for s in range(60)) if t.tint["car_body"] > 2)
    body: CarBody = thing.paint["car_body"].body
    x = float(body.x(0.45))

    def side(z: float) -> Surface:
        one = np.ones((1, 1), np.float32)
        local = np.array([[x, body.width_m / 2 - 0.1, z]], np.float32)
        normal = np.array([[0, 0.97, 0.24]], np.float32)
        return Surface(local, normal, np.zeros((1, 2), np.float32), one[0], 0.01 * one[0], -normal)

    door, f0_door = thing.paint["car_body"](side(float(body.belt_m(0.45)) - 0.3))
    pane, f0_pane = thing.paint["car_body"](side(float(body.belt_m(0.45)) + 0.2))
    assert door[0] > 0.4
    assert pane[0] < 0.15
    assert f0_pane[0] > f0_door[0] - 0.03


def test_the_inside_of_a_car_moves_against_its_windows():
    body = CarBody.draw("hatch", stream(0, "cabin"))
    cabin = Cabin(body, True, 0.1, 0.35, 0.2)
    count = 60
    z = np.linspace(float(body.belt_m(0.4)) + 0.03, body.roof_m - 0.12, count)
    pane = np.stack([np.full(count, 0.2), np.full(count, 0.7), z], axis=1).astype(np.float32)
    straight = cabin.look(pane, np.tile(np.float32([0, -1, 0]), (count, 1)))
    slant = cabin.look(pane, np.tile(np.float32([-0.6, -0.8, 0]), (count, 1)))
    assert straight.min() >= 0
    assert straight.max() < 0.6
    assert np.abs(straight - slant).max() > 0.02
    # a driver is seen from the side where he sits
    x_driver = float(body.x(body.type.seats[0])) + 0.13
    at_head = np.float32([[x_driver, 0.75, min(body.roof_m - 0.26, float(body.belt_m(0.5)) + 0.36) - 0.04]])
    with_driver = cabin.look(at_head, np.float32([[0, -1, 0]]))
    without = Cabin(body, False, 0.1, 0.35, 0.2).look(at_head, np.float32([[0, -1, 0]]))
    assert abs(float(with_driver[0] - without[0])) > 0.05


@pytest.mark.parametrize("seed", range(6))
def test_the_same_person_walks_in_the_same_clothes(seed):
    first = person.make(stream(seed, "p"), phase_rad=0.4)
    later = person.make(stream(seed, "p"), phase_rad=2.9)
    assert first.tint == later.tint
    assert first.paint == later.paint
    assert first.kind == later.kind
    assert len(first.mesh) == len(later.mesh)
    if Figure.draw(stream(seed, "p")).swing_rad > 0.1:
        assert np.abs(first.mesh.position - later.mesh.position).max() > 0.05


@given(st.integers(0, 200), st.floats(0, 2 * np.pi))
def test_bones_keep_their_length_and_feet_the_ground(seed, phase):
    figure = Figure.draw(stream(seed, "gait"))
    pose = walking(figure, phase)
    k = figure.height_m
    low = []
    for leg in pose.legs:
        assert np.linalg.norm(leg.middle - leg.root) == pytest.approx(THIGH * k, rel=1e-6)
        assert np.linalg.norm(leg.end - leg.middle) == pytest.approx(SHANK * k, rel=1e-3)
        # knees bend forwards only: the shank never leads the thigh
        thigh, shank = leg.middle - leg.root, leg.end - leg.middle
        assert np.arctan2(shank[0], -shank[2]) <= np.arctan2(thigh[0], -thigh[2]) + 1e-9
        turn = np.array([[np.cos(leg.pitch_rad), 0, np.sin(leg.pitch_rad)], [0, 1, 0],
                         [-np.sin(leg.pitch_rad), 0, np.cos(leg.pitch_rad)]])  # fmt: skip
        low.append((leg.end + sole(figure) @ turn.T)[:, 2].min())
    assert min(low) == pytest.approx(0, abs=1e-6)
    for arm in pose.arms:
        assert np.linalg.norm(arm.middle - arm.root) == pytest.approx(UPPER_ARM * k, rel=1e-6)
        assert np.linalg.norm(arm.end - arm.middle) == pytest.approx(FOREARM * k, rel=1e-6)


def test_half_a_cycle_mirrors_the_gait():
    figure = Figure.draw(stream(3, "gait"))
    now, half_later = walking(figure, 0.7), walking(figure, 0.7 + np.pi)
    np.testing.assert_allclose(now.legs[0].end * [1, -1, 1], half_later.legs[1].end, atol=1e-9)
    np.testing.assert_allclose(now.arms[1].end * [1, -1, 1], half_later.arms[0].end, atol=1e-9)


def test_the_standing_foot_hardly_slides():
    # in the frame of the body a standing foot moves back by what the body moves on
    slides = []
    for seed in range(20):
        figure = Figure.draw(stream(seed, "slide"))
        if figure.swing_rad < 0.1:
            continue
        way = 0.1 * figure.cycle_m
        before = walking(figure, np.pi - 0.1 * np.pi).legs[0].end[0]
        after = walking(figure, np.pi + 0.1 * np.pi).legs[0].end[0]
        slides.append(abs(after - before + way) / way)
    assert len(slides) > 5
    assert np.median(slides) < 0.12


@given(
    st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda p: np.linalg.norm(p) > 0.05),
    st.floats(0.2, 0.6),
    st.floats(0.2, 0.6),
)
def test_reaching_keeps_bones_and_meets_what_is_in_reach(target, upper, lower):
    bend = np.cross(target, (0.3, -0.5, 0.8)) + np.array([1e-3, 0, 0])
    middle, end = reach((0, 0, 0), target, upper, lower, bend)
    assert np.linalg.norm(middle) == pytest.approx(upper, rel=1e-6)
    assert np.linalg.norm(end - middle) == pytest.approx(lower, rel=1e-6)
    distance = np.linalg.norm(target)
    if abs(upper - lower) + 2e-3 < distance < upper + lower - 2e-3:
        np.testing.assert_allclose(end, target, atol=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_riders_sit_on_their_bicycles_with_hands_on_the_bar(seed):
    build = bicycle.Build.draw(stream(seed, "bike"))
    figure = Figure.draw(stream(seed, "rider figure"))
    pose = bicycle.riding(figure, build, 0.9)
    assert 0.0 < pose.pelvis[2] - build.saddle_m < 0.13
    for side, arm in zip((1, -1), pose.arms, strict=True):
        assert np.linalg.norm(arm.end - build.grip(side)) < 0.12
    for leg in pose.legs:
        assert 0.1 < leg.end[2] < 0.62
        assert leg.middle[0] > leg.root[0]
    assert build.saddle[0] == pytest.approx(pose.pelvis[0], abs=0.05)


def test_cranks_and_wheels_turn_with_the_way():
    first, later = bicycle.make(stream(2, "b")), bicycle.make(stream(2, "b"), travel_m=0.4)
    assert first.tint == later.tint
    spokes = np.array(first.mesh.materials)[first.mesh.material] == "chrome"
    assert np.abs(first.mesh.position[spokes] - later.mesh.position[spokes]).max() > 0.1
    legs = [np.abs(bicycle.make_rider(stream(2, "b"), travel_m=way).mesh.position).sum() for way in (0.0, 0.4)]
    assert legs[0] != legs[1]


@pytest.mark.parametrize("kind", fence.KINDS)
def test_fences_are_as_long_as_asked(kind):
    for length in (0.5, 7.0):
        x = fence.make(kind, length, stream(0, kind)).mesh.position[..., 0]
        assert x.min() > -0.25
        assert length - 0.25 < x.max() < length + 0.25


def test_wrong_requests_are_named():
    with pytest.raises(InputError, match="did you mean 'hedge'"):
        fence.make("hedges", 2.0, stream(0, "x"))
    with pytest.raises(InputError, match="length_m"):
        fence.make("hedge", 0.0, stream(0, "x"))
    with pytest.raises(InputError, match="did you mean 'oak'"):
        tree.make(stream(0, "x"), species="oaks")
    with pytest.raises(InputError, match="did you mean 'bench'"):
        street_furniture.make("bench seat"[:6], stream(0, "x"))


def test_houses_differ_and_have_doors_and_dark_windows():
    houses = [house.make(stream(seed, "h")) for seed in range(8)]
    assert len({thing.mesh.materials for thing in houses}) > 3
    for thing in houses:
        assert {"door", "window", "trim"} <= set(thing.mesh.materials)
        albedo, f0 = thing.paint["window"](surface_of(thing, "window"))
        assert 0.03 < albedo.mean() < 0.3
        assert f0.mean() > 0.05
        # the door is in the wall that looks to +x
        doors = thing.mesh.position[np.array(thing.mesh.materials)[thing.mesh.material] == "door"]
        front = thing.mesh.position[np.array(thing.mesh.materials)[thing.mesh.material] == "stone"][..., 0].max()
        assert doors[..., 0].mean() > front - 3.2


@given(st.floats(-2, 2), st.floats(0.001, 1), st.floats(0.001, 1))
def test_a_stripe_covers_what_a_box_filter_sees(distance, half, footprint):
    points = np.linspace(distance - footprint / 2, distance + footprint / 2, 4001)
    expected = (np.abs(points) < half).mean()
    assert float(brush.stripe(distance, half, footprint)) == pytest.approx(expected, abs=2e-3)


@given(st.floats(0.01, 0.5), st.floats(0.1, 0.9), st.floats(1e-4, 5))
def test_gratings_keep_their_mean_at_any_distance(period, part, footprint):
    position = np.linspace(0, 20 * period, 8000, endpoint=False)
    seen = brush.grating(position, period, part, np.full(8000, footprint))
    assert seen.mean() == pytest.approx(part, abs=1 / 400)  # a step of the 400 samples of a period
    assert seen.min() >= -1e-6
    assert seen.max() <= 1 + 1e-6
    if footprint > 10 * period:
        np.testing.assert_allclose(seen, part, atol=0.03)
