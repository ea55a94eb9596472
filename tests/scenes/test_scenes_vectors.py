"""Vectors by rows, beside NumPy's products."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.scenes.vectors import cross, dot
from pipeline.streams import stream


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_products_are_those_of_numpy_in_the_precision_of_the_vectors(dtype):
    a, b = stream(1, "vectors of the test").normal(size=(2, 500, 3)).astype(dtype)
    assert dot(a, b).dtype == cross(a, b).dtype == dtype
    tolerance = 20 * np.finfo(dtype).eps
    np.testing.assert_allclose(dot(a, b), np.einsum("ki,ki->k", a, b), rtol=0, atol=tolerance)
    np.testing.assert_allclose(cross(a, b), np.cross(a, b), rtol=0, atol=tolerance)


def test_a_row_does_not_depend_on_its_company():
    a, b = stream(2, "vectors of the test").normal(size=(2, 333, 3))
    assert dot(a, b)[7:8].tobytes() == dot(a[7:8], b[7:8]).tobytes()
    assert cross(a, b)[7:8].tobytes() == cross(a[7:8], b[7:8]).tobytes()
