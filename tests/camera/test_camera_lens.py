"""The thin lens: worked numbers and limits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.camera.lens import Lens
from pipeline.errors import InputError

LENS = Lens(focal_length_m=0.05, aperture_m=0.025, focus_m=2.0, pixel_pitch_m=5e-6)
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
    assert float(LENS.blur_diameter_px(math.inf)) == pytest.approx(float(LENS.blur_diameter_px(1e12)), rel=1e-9)
    far = Lens(0.05, 0.025, math.inf, 5e-6)
    assert float(far.blur_diameter_px(math.inf)) == 0
    # Focused at infinity, c = A f / S2.
    assert float(far.blur_diameter_px(10.0)) == pytest.approx(0.025 * 0.05 / 10 / 5e-6)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Lens(0.05, 0.02, 0.04, 5e-6), "beyond the focal length"),
        (lambda: Lens(0.05, 0.02, 2, 0), "pixel_pitch_m"),
        (lambda: Lens(-1, 0.02, 2, 5e-6), "focal_length_m"),
        (lambda: LENS.blur_diameter_px([1, 0]), "distance_m"),
    ],
)
def test_bad_input_is_named(call, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InputError, match=message):
        call()
