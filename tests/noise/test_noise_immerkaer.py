"""Immerkaer's mask: against its formula, and what it cannot see."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import convolve2d

from pipeline import noise
from pipeline.noise.base import FLAT
from pipeline.streams import stream


def test_equals_the_formula() -> None:
    patch = 0.5 + stream(1, "immerkaer").normal(0, 0.04, (40, 56))
    mask = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]])
    expected = 255 * np.sqrt(np.pi / 2) / (6 * 54 * 38) * np.abs(convolve2d(patch, mask, mode="valid")).sum()
    assert noise.create("immerkaer").estimate(patch[None, None]).sigma_dn[0] == pytest.approx(expected, rel=1e-5)


@given(a=st.floats(-0.2, 0.2), b=st.floats(-0.2, 0.2), c=st.floats(-0.2, 0.2))
def test_does_not_see_slopes_and_straight_curves(a: float, b: float, c: float) -> None:
    """0.5 + a x + b y + c x^2 has no mixed fourth difference: without noise the patch counts as flat."""
    y, x = np.mgrid[:32, :32] / 32.0
    patch = 0.5 + a * (x - 0.5) + b * (y - 0.5) + c * x * x
    assert noise.create("immerkaer").estimate(patch[None, None]).reason[0] == FLAT
