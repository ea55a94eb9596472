"""Exposure state, limits, steps and delay."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.control.observation import Observation
from pipeline.control.policies.mean_intensity import MeanIntensity
from pipeline.control.policy import ControlledCamera
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


@pytest.mark.parametrize("exposures_ms", [(0.05, 33.0), (1.0, 1.3)])
@pytest.mark.parametrize(
    ("per_stop", "gain_step_db", "gain_max"), [(6, 1.0, 32), (3, 1.0, 32), (3, 3.0, 32), (1, 4.0, 32), (2, 1.0, 1.9)]
)
def test_state_a_total_exposure_is_met_within_half_a_step_of_the_gain(exposures_ms, per_stop, gain_step_db, gain_max):
    """Wherever a camera has such settings: also where the highest gain falls short of a rounded exposure time."""
    shortest_s, longest_s = (each / 1e3 for each in exposures_ms)
    limits = Limits(shortest_s, longest_s, 1.0, gain_max, per_stop, gain_step_db)
    times = {limits.nearest(time, 1.0).exposure_s for time in np.geomspace(shortest_s, longest_s, 200)}
    gains = {limits.nearest(shortest_s, gain).gain for gain in np.geomspace(1.0, gain_max, 200)}
    reachable_stops = np.log2(np.outer(sorted(times), sorted(gains)))
    half_step_stops = gain_step_db / (40 * np.log10(2)) + 1e-6
    for total_s in np.geomspace(shortest_s, longest_s * gain_max, 41):
        if np.abs(reachable_stops - np.log2(total_s)).min() > half_step_stops:
            continue
        for time_s in np.geomspace(shortest_s / 2, 2 * longest_s, 23):
            state = limits.at_time(total_s, time_s)
            assert limits.accepts(state)
            assert abs(np.log2(state.total_exposure_s / total_s)) <= half_step_stops


@pytest.mark.parametrize("total", np.geomspace(0.001, 0.3, 11))
@pytest.mark.parametrize("time", np.geomspace(50e-6, 33e-3, 13))
def test_state_settings_of_a_total_exposure_are_kept_when_asked_for_again(total, time):
    state = STEPPED.at_time(total, time)
    again = STEPPED.at_time(state.total_exposure_s, state.exposure_s)
    assert (again.exposure_s, again.gain) == (pytest.approx(state.exposure_s), pytest.approx(state.gain))


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


def test_state_gains_in_steps_end_below_the_highest():
    """Steps of 4 dB from 1 on: of 32, which is 30.1 dB, the seventh at 28 dB is the last."""
    coarse = Limits(gain_step_db=4.0)
    assert coarse.nearest(0.01, 32.0).gain == coarse.nearest(0.01, 1e3).gain == pytest.approx(10 ** (28 / 20))


def test_state_an_exposure_beyond_a_cap_is_shortened_though_the_frame_is_as_bright_as_wanted():
    policy, seen = MeanIntensity(ControlledCamera(), exposure_max_ms=10.0), Observation(np.zeros((4, 4)), 0.5, 0.0)
    new = policy.decide(seen, CameraState.of(20, 100)).state
    assert new.exposure_ms == pytest.approx(10.0) and new.total_exposure_s == pytest.approx(0.02)
    assert policy.decide(seen, new).state == new


def test_state_written_settings_arrive_after_the_delay():
    first, second, third = (CameraState(t, 1.0) for t in (1e-3, 2e-3, 3e-3))
    line = DelayLine.filled(first, 2)
    assert [line.next(second), line.next(third), line.next(third)] == [first, first, second]
    assert DelayLine.filled(first, 0).next(second) == second


@pytest.mark.parametrize(
    "change",
    [
        {"exposure_min_s": 1.0}, {"gain_min": 0.0}, {"delay_frames": 11}, {"delay_frames": 1.5},
        {"exposure_steps_per_stop": float("nan")}, {"exposure_steps_per_stop": 2.5}, {"exposure_steps_per_stop": -1},
        {"gain_step_db": float("nan")}, {"gain_step_db": -1.0}, {"exposure_max_s": "33"},
    ],
)  # fmt: skip
def test_state_refuses_impossible_limits(change):
    (name,) = change
    with pytest.raises(InputError, match=f"limits: .*{name}"):
        Limits(**change)
    with pytest.raises(InputError, match="exposure_s"):
        CameraState(0.0, 1.0)
    with pytest.raises(InputError, match="limits: gain_min is a factor of at least 1"):
        Limits(gain_min=0.5)  # ISO 50: a full well would stay below full scale


@pytest.mark.parametrize("cap_ms", [0.05, 1.0, 5.9, 6.3, 20.0, 33.0])
@pytest.mark.parametrize("per_stop", [0, 1, 3, 6])
def test_no_step_of_the_exposure_exceeds_a_hard_cap(cap_ms, per_stop):
    camera = ControlledCamera(Limits(exposure_steps_per_stop=per_stop))
    policy = MeanIntensity(camera, exposure_max_ms=cap_ms, damping=1.0)
    for level in (0.1, 0.3, 0.5, 0.8):
        for start in (CameraState.of(1, 100), CameraState.of(20, 100), CameraState.of(33, 3200)):
            seen = Observation(np.full((4, 4), level, np.float32), level, 0.0)
            chosen = policy.decide(seen, start).state
            assert chosen.exposure_ms <= cap_ms * (1 + 1e-9)
    finest_stops = 1 / per_stop if per_stop else 1e-6
    assert camera.limits.longest_up_to(cap_ms / 1e3) > cap_ms / 1e3 * 2.0 ** -(finest_stops * 1.001)


def test_the_gain_makes_up_for_a_cap_that_is_rounded_down():
    state = Limits(exposure_steps_per_stop=3).time_first(0.02, 0.0059)
    assert state.exposure_s < 0.0059 and state.total_exposure_s == pytest.approx(0.02)


@pytest.mark.parametrize("cap_ms", [0.0, 0.049, -1.0, float("nan")])
def test_a_cap_below_the_shortest_exposure_time_is_refused(cap_ms):
    with pytest.raises(
        InputError, match=r"no exposure time of at most .* ms; expected at least the shortest one, 0.05"
    ):
        MeanIntensity(ControlledCamera(), exposure_max_ms=cap_ms)


@pytest.mark.parametrize("total", np.geomspace(0.04, 1.0, 23))
def test_the_gain_starts_from_the_longest_exposure_time_that_is_a_step(total):
    """33 ms is none of six steps per stop from 50 us; a gain reckoned from it would leave every frame 2 % too dark."""
    limits = Limits(exposure_steps_per_stop=6)
    assert limits.time_first(total).total_exposure_s == pytest.approx(total)
