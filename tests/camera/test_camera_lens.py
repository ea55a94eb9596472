"""The thin lens: worked numbers, limits and inverses."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.camera.lens import Lens
from pipeline.errors import InputError

LENS = Lens.from_f_number(focal_length_m=0.05, f_number=2.0, focus_m=2.0, pixel_pitch_m=5e-6)
METRES = st.floats(0.2, 500.0)


def test_a_worked_number() -> None:
    # A = 25 mm: c = 0.025 * 0.05 / 1.95 * 1 / 3 = 213.7 um = 42.7 px.
    assert float(LENS.blur_diameter_px(3.0)) == pytest.approx(0.025 * 0.05 / 1.95 / 3 / 5e-6)
    assert float(LENS.blur_diameter_px(3.0)) == pytest.approx(42.735, abs=1e-3)


@given(st.floats(0.2, 100.0), METRES)
def test_equals_the_equation_of_the_paper(focus_m: float, distance_m: float) -> None:
    lens = Lens(0.03, 0.01, focus_m, 4e-6)
    expected = 0.01 * 0.03 / (focus_m - 0.03) * abs(distance_m - focus_m) / distance_m / 4e-6
    assert float(lens.blur_diameter_px(distance_m)) == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_sharp_in_focus_and_monotonic_away_from_it() -> None:
    assert float(LENS.blur_diameter_px(2.0)) == 0
    assert np.all(np.diff(LENS.blur_diameter_px(np.linspace(2, 50, 99))) > 0)
    assert np.all(np.diff(LENS.blur_diameter_px(np.linspace(0.3, 2, 99))) < 0)


def test_infinity() -> None:
    assert LENS.infinity_blur_px == pytest.approx(float(LENS.blur_diameter_px(1e12)), rel=1e-9)
    far = Lens(0.05, 0.025, math.inf, 5e-6)
    assert far.infinity_blur_px == 0
    # Focused at infinity, c = A f / S2.
    assert float(far.blur_diameter_px(10.0)) == pytest.approx(0.025 * 0.05 / 10 / 5e-6)
    assert far.distances_m(0) == (math.inf, math.inf)


@given(st.floats(0.2, 100.0), st.floats(0.01, 60.0))
def test_distances_invert_the_blur(focus_m: float, diameter_px: float) -> None:
    lens = Lens(0.03, 0.01, focus_m, 4e-6)
    nearer, farther = lens.distances_m(diameter_px)
    assert 0 < nearer < focus_m
    assert float(lens.blur_diameter_px(nearer)) == pytest.approx(diameter_px, rel=1e-6)
    if math.isnan(farther):
        assert diameter_px > lens.infinity_blur_px * (1 - 1e-9)
    else:
        assert farther > focus_m
        assert float(lens.blur_diameter_px(farther)) == pytest.approx(diameter_px, rel=1e-6)


def test_farthest_distance_is_infinite_at_the_blur_of_infinity() -> None:
    assert LENS.distances_m(LENS.infinity_blur_px)[1] == math.inf
    assert math.isnan(LENS.distances_m(LENS.infinity_blur_px * 1.01)[1])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Lens(0.05, 0.02, 0.04, 5e-6), "beyond the focal length"),
        (lambda: Lens(0.05, 0.02, 2, 0), "pixel_pitch_m"),
        (lambda: Lens(-1, 0.02, 2, 5e-6), "focal_length_m"),
        (lambda: Lens.from_f_number(0.05, 0, 2, 5e-6), "f_number"),
        (lambda: LENS.blur_diameter_px([1, 0]), "distance_m"),
        (lambda: LENS.distances_m(-1), "diameter_px"),
    ],
)
def test_bad_input_is_named(call, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InputError, match=message):
        call()
