"""Curves over noise alone and over blur alone."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.curves.cells import Cells, gather
from pipeline.curves.isolated import isolated
from pipeline.errors import InputError
from pipeline.streams import stream

NOISE = np.array([0.7, 5.2, 10.1, 14.8, 20.3, 24.6])
BLUR = np.array([0.35, 0.52, 0.71, 0.88, 0.99])


def crossed() -> Cells:
    """Noise without blur, and blur without noise; each tuple twice, one point apart."""
    sigma = np.repeat(np.concatenate([NOISE, np.full(5, 0.5)]), 2)
    mtf = np.repeat(np.concatenate([np.full(6, 0.98), BLUR]), 2)
    precision = 60 - sigma - 50 * (1 - mtf) + np.tile([-1.0, 1.0], 11)
    return gather(sigma, mtf, precision, stream(1, "boot"))


def test_curves_follow_one_axis() -> None:
    cells = crossed()
    noise = isolated(cells, "sigma_dn")
    np.testing.assert_allclose(noise.at[1:], NOISE[1:])
    assert noise.query(7.65)[0] == pytest.approx(60 - 7.65 - 1.0)
    blur = isolated(cells, "mtf")
    assert list(blur.count) == [2, 2, 2, 2, 4]
    value, low, high = blur.query(0.6)
    assert value == pytest.approx(60 - 0.5 - 20, abs=1e-9) and low < value < high
    assert not blur.non_monotonic.any() and not noise.non_monotonic.any()


@given(st.floats(0, 27.5), st.integers(0, 1000))
def test_answers_lie_between_neighbours(value: float, seed: int) -> None:
    precision = stream(seed, "isolated").uniform(0, 100, 6)
    curve = isolated(gather(NOISE, np.ones(6), precision, stream(seed, "boot")), "sigma_dn")
    selected = curve.query(value)[0]  # the outermost bins reach half a bin beyond their centres
    assert selected == pytest.approx(np.interp(value, NOISE, precision), abs=1e-9)


def test_gaps_and_outsides_are_refused() -> None:
    kept = np.array([0, 1, 3, 4, 5])
    cells = gather(NOISE[kept], np.ones(5), 60 - NOISE[kept], stream(1, "boot"))
    assert isolated(cells, "sigma_dn").query(10.0)[0] == pytest.approx(50.0)  # a single empty bin is bridged
    curve = isolated(gather(NOISE[[0, 1, 4, 5]], np.ones(4), [50, 40, 30, 20], stream(1, "boot")), "sigma_dn")
    with pytest.raises(InputError, match="in a gap between 5.2 and 20.3"):
        curve.query(12.0)
    assert curve.query(6.0)[0] == 40.0  # within the bin of 5.2
    assert curve.query(18.0)[0] == 30.0
    with pytest.raises(InputError, match="not extrapolated"):
        curve.query(40.0)
    with pytest.raises(InputError, match="sigma_dn -2: expected a number of at least 0"):
        curve.query(-2.0)  # in the bin of 0 DN, but there is no such noise
    with pytest.raises(InputError, match="expected a number"):
        curve.query(float("nan"))


def test_one_point_speaks_for_its_bin() -> None:
    curve = isolated(gather([5.0, 5.0], [1.0, 1.0], [40.0, 50.0], stream(1, "boot")), "sigma_dn")
    assert curve.query(6.0)[0] == 45.0
    with pytest.raises(InputError, match="not extrapolated"):
        curve.query(8.0)


def test_a_rise_is_marked() -> None:
    precision = np.array([50.0, 45.0, 47.0, 30.0, 25.0, 20.0])
    noise = isolated(gather(NOISE, np.ones(6), precision, stream(1, "boot")), "sigma_dn")
    assert list(noise.non_monotonic) == [False, False, True, False, False, False]
    blur = isolated(gather(np.zeros(5), BLUR, [10, 30, 25, 40, 50], stream(1, "boot")), "mtf")
    assert list(blur.non_monotonic) == [False, True, False, False, False]  # 0.52 is better than the sharper 0.71


def test_bad_input_is_named() -> None:
    with pytest.raises(InputError, match="quantity"):
        isolated(crossed(), "blur")
    strong = gather([12.0, 20.0], [0.5, 0.6], [40.0, 30.0], stream(1, "boot"))
    with pytest.raises(InputError, match="no tuple lies in the MTF bin 1"):
        isolated(strong, "sigma_dn")
    with pytest.raises(InputError, match="no tuple lies in the noise bin 0"):
        isolated(strong, "mtf")
