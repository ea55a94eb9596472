"""Exposure state, limits, steps and delay."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.control.state import CameraState, DelayLine, Limits
from pipeline.errors import InputError

STEPPED = Limits(exposure_steps_per_stop=6, gain_step_db=1.0)


@given(time=st.floats(1e-6, 1.0), gain=st.floats(0.01, 1e3), limits=st.sampled_from([Limits(), STEPPED]))
def test_state_limits_are_respected_and_nearest_settings_are_stable(time, gain, limits):
    state = limits.nearest(time, gain)
    assert limits.exposure_min_s <= state.exposure_s <= limits.exposure_max_s * (1 + 1e-12)
    assert limits.gain_min <= state.gain <= limits.gain_max * (1 + 1e-12)
    again = limits.nearest(state.exposure_s, state.gain)
    assert again.exposure_s == pytest.approx(state.exposure_s) and again.gain == pytest.approx(state.gain)


@given(total=st.floats(60e-6, 0.9), time=st.floats(60e-6, 33e-3))
def test_state_total_exposure_is_kept_at_any_time_inside_the_limits(total, time):
    assert Limits().at_time(total, time).total_exposure_s == pytest.approx(total, rel=1e-9)
    # four roundings, each by up to half a step: 2 ** (1 / 12) of the time and 0.5 dB of the gain, twice
    assert STEPPED.at_time(total, time).total_exposure_s == pytest.approx(total, rel=0.26)


def test_state_exposure_comes_before_gain():
    limits = Limits()
    assert limits.time_first(0.010) == CameraState(0.010, 1.0)
    assert limits.time_first(0.066) == CameraState(0.033, 2.0)
    capped = limits.time_first(0.066, exposure_max_s=0.011)
    assert (capped.exposure_s, capped.gain) == (0.011, pytest.approx(6.0))


def test_state_trade_of_the_paper():
    first = CameraState.of(4, 400).traded(0.25)
    assert (first.exposure_ms, first.iso) == (pytest.approx(16), pytest.approx(100))
    second = CameraState.of(8, 100).traded(15 / 7)
    assert second.exposure_ms == pytest.approx(3.733, abs=5e-4) and second.iso == pytest.approx(214.29, abs=0.01)


def test_state_written_settings_arrive_after_the_delay():
    first, second, third = (CameraState(t, 1.0) for t in (1e-3, 2e-3, 3e-3))
    line = DelayLine.filled(first, 2)
    assert [line.next(second), line.next(third), line.next(third)] == [first, first, second]
    assert DelayLine.filled(first, 0).next(second) == second


@pytest.mark.parametrize("change", [{"exposure_min_s": 1.0}, {"gain_min": 0.0}, {"delay_frames": 11}])
def test_state_refuses_impossible_limits(change):
    with pytest.raises(InputError):
        Limits(**change)
    with pytest.raises(InputError, match="exposure_s"):
        CameraState(0.0, 1.0)
