"""Motion blur from an MTF."""

from __future__ import annotations

import numpy as np
import pytest
from control_makers import REFERENCE, seen_mtf

from pipeline.camera import mtf, psf
from pipeline.control.motion import motion_length, motion_mtf
from pipeline.control.observation import Estimate
from pipeline.errors import InputError


@pytest.mark.parametrize("length", [0.0, 3.0, 7.0, 12.25, 21.0, 31.0])
@pytest.mark.parametrize("direction", [0.0, 90.0])
def test_motion_length_is_recovered(length, direction):
    result = motion_length(seen_mtf(length, direction), REFERENCE)
    assert result.value_px == pytest.approx(length, abs=0.13)
    assert result.low_px <= result.value_px <= result.high_px
    if length:
        assert result.direction_deg == pytest.approx(direction, abs=5)


@pytest.mark.parametrize("length", [5.0, 10.0, 20.0])
def test_the_interval_of_a_length_spans_those_of_the_ends_of_the_mtf(length):
    """A lower MTF is a longer motion."""
    shorter, longer = seen_mtf(length - 2), seen_mtf(length + 2)
    result = motion_length(Estimate(seen_mtf(length).value, longer.value, shorter.value), REFERENCE)
    assert (result.low_px, result.high_px) == pytest.approx((length - 2, length + 2), abs=0.2)


@pytest.mark.parametrize("length", [7.0, 12.2, 21.0])
def test_motion_length_of_a_sampled_kernel(length):
    curve = np.asarray(mtf.sample(psf.create("linear_motion", length)))
    nothing = np.full_like(curve, np.nan)
    assert motion_length(Estimate(curve, nothing, nothing), np.ones((2, 8))).value_px == pytest.approx(length, abs=0.5)


def test_motion_mtf_falls_up_to_the_longest_motion_of_the_surface():
    curve = motion_mtf(np.arange(0.0, 31.5, 0.5), REFERENCE, 0)
    assert (np.diff(curve) < 0).all()


def test_motion_refuses_a_reference_without_contrast():
    with pytest.raises(InputError, match="reference MTF"):
        motion_length(seen_mtf(3), np.zeros((2, 8)))
