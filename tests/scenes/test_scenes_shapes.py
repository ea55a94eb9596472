"""Solids: closed, facing outwards, of the right volume."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.scenes.mesh import Mesh, rotation
from pipeline.scenes.shapes import (
    both_sides,
    box,
    boxes,
    ellipsoid,
    lathe,
    loft,
    mirrored,
    panel,
    panels,
    skin,
    torus,
    tube,
    vertex_normals,
    volume,
)


def is_closed(mesh: Mesh) -> bool:
    """Every directed edge is met once by its opposite, so there is no hole and no twisted face."""
    points = np.round(mesh.position.reshape(-1, 3) * 2e4).astype(int)
    _, index = np.unique(points, axis=0, return_inverse=True)
    faces = index.reshape(-1, 3)
    edges = Counter((a, b) for face in faces.tolist() for a, b in zip(face, face[1:] + face[:1], strict=True) if a != b)
    return all(edges[(b, a)] == count for (a, b), count in edges.items())


def volume_of(mesh: Mesh) -> float:
    corners = mesh.position.astype(float)
    return float(np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6)


def outward(mesh: Mesh) -> np.ndarray:
    """Cosine between shading normals and the normals of the faces."""
    flat = np.cross(mesh.position[:, 1] - mesh.position[:, 0], mesh.position[:, 2] - mesh.position[:, 0])
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    return np.einsum("fcx,fx->fc", mesh.normal, flat)


SOLIDS = {
    "ellipsoid": (ellipsoid((1, 2, 3), (0.5, 0.3, 0.2), "brick", 48, 40), 4 / 3 * np.pi * 0.5 * 0.3 * 0.2),
    "turned ellipsoid": (
        ellipsoid((0, 0, 0), (0.5, 0.3, 0.2), "brick", 48, 40, rotation(0.8, "x")),
        4 / 3 * np.pi * 0.5 * 0.3 * 0.2,
    ),
    "box": (box((-1, 0, 2), (1, 0.5, 2.25), "brick"), 2 * 0.5 * 0.25),
    "torus": (torus((0, 1, 0), 0.35, 0.05, "brick", 80, 24), 2 * np.pi**2 * 0.35 * 0.05**2),
    "rod": (tube([(0, 0, 0), (0, 0, 2)], 0.1, "brick", 64, round_ends=False), np.pi * 0.1**2 * 2),
    "cone": (tube([(1, 0, 0), (3, 0, 0)], [0.3, 0.1], "brick", 64, round_ends=False), np.pi / 3 * 2 * 0.13),
    "lathe": (lathe([(-0.1, 0.2), (0.1, 0.2)], "brick", 64), np.pi * 0.2**2 * 0.2),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_are_closed_outward_and_of_their_volume(name):
    mesh, expected = SOLIDS[name]
    assert is_closed(mesh)
    assert volume_of(mesh) == pytest.approx(expected, rel=0.02)
    np.testing.assert_allclose(np.linalg.norm(mesh.normal, axis=2), 1, atol=1e-5)
    assert outward(mesh).min() > 0


def test_round_ends_add_two_half_balls():
    mesh = tube([(0, 0, 0), (0, 0, 2)], 0.1, "brick", 64)
    assert is_closed(mesh)
    assert volume_of(mesh) == pytest.approx(np.pi * 0.1**2 * 2 + 4 / 3 * np.pi * 0.1**3, rel=0.03)
    assert mesh.position[..., 2].min() == pytest.approx(-0.1, abs=1e-6)


@given(
    st.lists(st.tuples(*[st.floats(-1, 1)] * 2), min_size=3, max_size=6),
    st.floats(0.01, 0.05),
    st.integers(4, 12),
)
def test_any_rising_tube_is_closed_and_outward(bends, radius, sides):
    path = [(x, y, float(number)) for number, (x, y) in enumerate(bends)]
    mesh = tube(path, radius, "brick", sides)
    assert is_closed(mesh)
    assert volume_of(mesh) > 0


@given(st.floats(0.3, 1.0), st.tuples(*[st.floats(0.05, 2)] * 3))
def test_superellipsoids_lie_in_their_box_and_outside_the_ellipsoid(exponent, radii):
    mesh = ellipsoid((0, 0, 0), radii, "brick", 16, 10, exponent=exponent)
    part = np.abs(mesh.position.reshape(-1, 3)) / radii
    assert part.max() <= 1 + 1e-5
    assert (part**2).sum(axis=1).min() > 1 - 1e-4
    np.testing.assert_allclose(np.linalg.norm(mesh.normal, axis=2), 1, atol=1e-5)


def test_a_skin_faces_outwards_whichever_way_its_rings_run():
    angle = np.arange(12) / 12 * 2 * np.pi
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    sections = np.stack([ring, ring + np.array([0, 0, 1.0])])
    for turned in (sections, sections[::-1], sections[:, ::-1]):
        vertices, faces = skin(turned)
        assert volume(vertices, faces) == pytest.approx(3.0, rel=1e-6)  # a regular dodecagon of radius 1


def test_vertex_normals_of_a_ball_are_radial():
    mesh = ellipsoid((0, 0, 0), (1, 1, 1), "brick", 40, 30)
    points = mesh.position.reshape(-1, 3).astype(float)
    unique, index = np.unique(points, axis=0, return_inverse=True)
    normals = vertex_normals(unique, index.reshape(-1, 3))
    assert np.einsum("ij,ij->i", normals, unique).min() > 0.995


def test_loft_measures_its_texture_in_metres():
    angle = np.arange(64) / 64 * 2 * np.pi
    ring = 0.5 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    mesh = loft(np.stack([ring, ring + np.array([0, 0, 3.0])]), "brick")
    assert np.ptp(mesh.uv[..., 1]) == pytest.approx(3.0)
    assert mesh.uv[..., 0].max() == pytest.approx(np.pi * 63 / 64, rel=1e-3)


def test_many_boxes_are_the_boxes():
    low, high = np.array([[0, 0, 0], [2, 2, 2.0]]), np.array([[1, 1, 1], [2.5, 3, 4.0]])
    together = boxes(low, high, "brick")
    assert is_closed(together)
    np.testing.assert_array_equal(together.position[12:], box(low[1], high[1], "brick").position)


def test_mirroring_turns_nothing_inside_out():
    part = tube([(0, 1, 0), (0.5, 2, 1)], 0.1, "brick")
    other = mirrored(part)
    assert is_closed(other)
    assert volume_of(other) == pytest.approx(volume_of(part), rel=1e-5)
    assert outward(other).min() > 0
    assert volume_of(both_sides(part)) == pytest.approx(2 * volume_of(part), rel=1e-5)


def test_panels_face_their_front():
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    np.testing.assert_allclose(panel(square, "brick").normal, [[[0, 0, 1]] * 3] * 2, atol=1e-6)
    many = panels([square, square[::-1]], "brick", np.zeros((2, 4, 2)))
    up = many.normal[:, 0, 2]
    assert sorted(up.tolist()) == [-1, -1, 1, 1]
    assert len(many) == 4
