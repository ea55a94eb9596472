"""Triangle soups: what placing, joining and flattening must keep."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.scenes.mesh import join, rotation, soup

TETRAHEDRON = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


@given(st.floats(-7, 7), st.sampled_from("xyz"))
def test_rotation_is_proper_and_right_handed(angle, axis):
    matrix = rotation(angle, axis).astype(float)
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-6)
    assert np.linalg.det(matrix) == pytest.approx(1, abs=1e-6)
    ahead = np.eye(3)[("xyz".index(axis) + 1) % 3]
    turned = rotation(np.pi / 2, axis) @ ahead
    np.testing.assert_allclose(turned, np.cross(np.eye(3)["xyz".index(axis)], ahead), atol=1e-6)


@given(st.floats(-4, 4), st.floats(0.2, 3), st.tuples(*[st.floats(-50, 50)] * 3))
def test_placing_scales_distances_and_keeps_local(yaw, scale, shift):
    mesh = soup(TETRAHEDRON, FACES, "brick")
    placed = mesh.placed(yaw, shift, scale)
    edges = np.linalg.norm(np.diff(mesh.position, axis=1), axis=2)
    moved = np.linalg.norm(np.diff(placed.position, axis=1), axis=2)
    np.testing.assert_allclose(moved, scale * edges, atol=3e-5)
    np.testing.assert_array_equal(placed.local, mesh.local)
    flat = np.cross(placed.position[:, 1] - placed.position[:, 0], placed.position[:, 2] - placed.position[:, 0])
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    np.testing.assert_allclose(placed.normal[:, 0], flat, atol=2e-4)


def test_turning_back_and_forth_is_the_identity():
    mesh = soup(TETRAHEDRON, FACES, "brick")
    turn = rotation(0.7, "y") @ rotation(-1.1, "x")
    back = mesh.turned(turn).turned(turn.T)
    np.testing.assert_allclose(back.position, mesh.position, atol=1e-6)
    np.testing.assert_allclose(back.normal, mesh.normal, atol=1e-6)


def test_as_local_takes_present_positions():
    mesh = soup(TETRAHEDRON, FACES, "brick").placed(0.3, (1, 2, 3))
    np.testing.assert_array_equal(mesh.as_local().local, mesh.position)


def test_join_merges_names_and_keeps_each_triangle_its_material():
    parts = [soup(TETRAHEDRON + i, FACES, name) for i, name in enumerate(["brick", "tile", "brick"])]
    whole = join(parts)
    assert whole.materials == ("brick", "tile")
    names = [whole.materials[code] for code in whole.material]
    assert names == ["brick"] * 4 + ["tile"] * 4 + ["brick"] * 4
    np.testing.assert_array_equal(whole.position[4:8], parts[1].position)


def test_degenerate_triangles_are_dropped():
    faces = np.vstack([FACES, [[0, 0, 1], [2, 2, 2]]])
    assert len(soup(TETRAHEDRON, faces, "brick")) == len(FACES)


def test_box_mapping_measures_metres():
    # texture coordinates of a face along two axes keep lengths
    mesh = soup(TETRAHEDRON * 3, FACES[:3], "brick")
    for corner, uv in zip(mesh.position, mesh.uv, strict=True):
        np.testing.assert_allclose(
            np.linalg.norm(np.diff(corner, axis=0), axis=1), np.linalg.norm(np.diff(uv, axis=0), axis=1), atol=1e-6
        )


def test_smooth_normals_are_taken_as_given():
    normals = TETRAHEDRON - TETRAHEDRON.mean(axis=0)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    mesh = soup(TETRAHEDRON, FACES, "brick", normals)
    np.testing.assert_allclose(mesh.normal, normals[FACES], atol=1e-6)
