"""Smooth fields: moments, periodicity, fading, and independence of the batch."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.scenes.field import field
from pipeline.scenes.textures import library


def grid(size: float, count: int = 200) -> np.ndarray:
    steps = (np.arange(count) + 0.5) / count * size
    return np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2).astype(np.float32)


def test_zero_mean_unit_deviation_over_a_tile():
    value = field(grid(11.0), np.zeros(200 * 200, np.float32), 11.0)
    assert abs(value.mean()) < 0.02
    assert 0.85 < value.std() < 1.05


@given(u=st.floats(-50, 50), v=st.floats(-50, 50), size=st.floats(1, 30))
def test_periodic_and_a_function_of_the_point_alone(u, v, size):
    points = np.array([[u, v], [u + 3 * size, v - 2 * size], [0.1, 0.2]], np.float32)
    none = np.zeros(3, np.float32)
    value = field(points, none, size)
    assert abs(value[0] - value[1]) < 0.2  # bilinear weights are kept to 1/32, positions to float32
    assert field(points[:1], none[:1], size)[0] == value[0]


def test_texels_lie_at_their_centres():
    texels = library()["fbm"].levels[3][..., 0]
    side = len(texels)
    centres = (np.arange(0, side, 37) + 0.5) / side * 9.0
    points = np.stack(np.meshgrid(centres, centres), axis=-1).reshape(-1, 2).astype(np.float32)
    expected = ((texels - texels.mean()) / texels.std())[::37, ::37].ravel()
    np.testing.assert_allclose(field(points, np.zeros(len(points), np.float32), 9.0), expected, atol=1e-4)


def test_continuous_across_the_seam():
    left = field(np.array([[-1e-4, 3.0]], np.float32), np.zeros(1, np.float32), 7.0)
    right = field(np.array([[1e-4, 3.0]], np.float32), np.zeros(1, np.float32), 7.0)
    assert abs(left - right)[0] < 0.05


def test_fades_where_a_sample_covers_many_texels():
    points = grid(11.0)
    near = field(points, np.full(len(points), 0.01, np.float32), 11.0)
    far = field(points, np.full(len(points), 5.0, np.float32), 11.0)
    assert far.std() < 0.05 * near.std()
