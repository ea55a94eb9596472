"""Hysteresis that grows with reversals: no hunting on a constant scene, real changes are still followed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from control_makers import CAMERA, Scene, performance, performance_of_three_levels, seen_mtf
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pipeline import control
from pipeline.control.decision import Action
from pipeline.control.state import CameraState, DelayLine
from pipeline.control.temporal import hysteresis
from pipeline.control.temporal.hysteresis import MOST_REVERSALS, Hysteresis
from pipeline.control.temporal.speed import KnownSpeedJumps
from pipeline.errors import InputError

SURFACE = performance()
SHORT, LONG = CameraState.of(12.8, 562), CameraState.of(16.1, 447)
RESOLVED_PX = 6.0


class BiasedScene(Scene):
    """A scene whose short lengths of motion are underestimated, as by the monitor: 5.1 px as 3.0, 6.5 px as 5.5."""

    bias_fraction = 0.0

    def observe(self, state, silent=False):
        seen = super().observe(state, silent)
        length = self.truth(state).motion_px
        estimated = length * (1.0 - self.bias_fraction if length < RESOLVED_PX else 1.0)
        return replace(seen, mtf=None if seen.mtf is None else seen_mtf(estimated))


def after_a_step_of_light(name, delay, ratio, speed, bias_fraction, frames, **options):
    """Exposure times, stops, of the frames after the light has changed by a factor."""
    limits = replace(CAMERA.limits, delay_frames=delay, exposure_steps_per_stop=6, gain_step_db=1.0)
    policy = control.create(name, camera=replace(CAMERA, limits=limits), performance=SURFACE, **options)
    state = limits.nearest(0.008, 2.0)
    line, times = DelayLine.filled(state, delay), []
    lead, light = 10 + 4 * delay, 1.0 if ratio < 1 else 1 / 16
    for step in range(lead + frames):
        scene = BiasedScene(light * (1.0 if step < lead else ratio), speed, size_px=8)
        scene.bias_fraction = bias_fraction
        times.append(state.exposure_s)
        state = line.next(policy.decide(scene.observe(state), state).state)
    return np.log2(times[lead:])


@pytest.mark.parametrize(
    ("light", "speed_px_s"), [(1 / 256, 1_000), (1 / 128, 2_000), (1 / 64, 4_000), (1 / 32, 8_000)]
)
def test_where_nothing_was_measured_at_any_split_settings_do_not_alternate_for_ever(light, speed_px_s):
    """Motion above 22 px is taken for half as much again, shorter motion for what it is."""
    limits = replace(CAMERA.limits, exposure_steps_per_stop=6, gain_step_db=1.0)
    policy = control.create(
        "iopc_optimal", camera=replace(CAMERA, limits=limits), performance=performance_of_three_levels()
    )
    scene, state, states = Scene(light, speed_px_s), CameraState.of(8, 400), []
    for _ in range(45):
        decision = policy.decide(scene.observe(state), state)
        states.append(state := decision.state)
    assert decision.action is Action.REFUSED and len(set(states[25:])) == 1


@given(
    name=st.sampled_from(["iopc_optimal", "iopc_continuous"]),
    delay=st.integers(0, 3),
    stops=st.floats(-4.0, 4.0),
    speed=st.floats(50.0, 2_000.0),
    bias_fraction=st.floats(0.0, 0.6),
)
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_a_constant_scene_settles_after_any_step_of_light_and_does_not_oscillate(
    name, delay, stops, speed, bias_fraction
):
    times = after_a_step_of_light(name, delay, 2.0**stops, speed, bias_fraction, frames=40 + 20 * delay)
    assert np.ptp(times[-8 * (delay + 1) :]) == 0.0


def test_without_growth_settings_of_a_constant_scene_alternate(monkeypatch):
    """What the growth is for: estimates at either setting favour the other one."""
    cases = [(0, 300.0, 0.5), (0, 400.0, 0.5), (3, 300.0, 0.3), (3, 400.0, 0.3), (3, 200.0, 0.5)]

    def ranges():
        return [
            float(np.ptp(after_a_step_of_light("iopc_optimal", *case[:1], 1 / 16, *case[1:], 70, margin=0.07)[-30:]))
            for case in cases
        ]

    assert ranges() == [0.0] * len(cases)
    monkeypatch.setattr(hysteresis, "MOST_REVERSALS", 0)
    assert min(ranges()) > 0.3


def test_each_reversal_doubles_what_a_change_must_promise_up_to_a_limit():
    rule = Hysteresis(1.0)
    rule.observe(1.0, 0)
    required = []
    for number in range(2 * MOST_REVERSALS):
        rule.count(*((SHORT, LONG) if number % 2 else (LONG, SHORT)))
        required.append(rule.required_percent)
    assert required == [1.0, 2.0, 4.0, 8.0, 8.0, 8.0]


def test_changes_of_one_direction_and_held_settings_are_no_reversals():
    rule = Hysteresis(1.0)
    for before, after in ((LONG, SHORT), (SHORT, SHORT), (SHORT, CameraState.of(6, 562)), (LONG, LONG)):
        rule.count(before, after)
    assert rule.required_percent == 1.0
    rule.count(CameraState.of(6, 562), CameraState.of(6, 800))  # the time stays, the total rises
    assert rule.required_percent == 2.0


@pytest.mark.parametrize(("light", "mark"), [(0.7, 0), (1.42, 0), (1.0, 1)])
def test_reversals_are_forgotten_when_light_or_speed_have_changed(light, mark):
    rule = Hysteresis(1.0)
    rule.observe(1.0, 0)
    rule.count(LONG, SHORT)
    rule.count(SHORT, LONG)
    for same in (1.0, 1.3, 0.8, math.nan):
        rule.observe(same, 0)
        assert rule.required_percent == 2.0
    rule.observe(light, mark)
    assert rule.required_percent == 1.0


def test_a_light_that_was_not_seen_at_first_is_noticed_once_it_is():
    rule = Hysteresis(1.0)
    rule.observe(math.nan, 0)
    rule.observe(1.0, 0)
    rule.count(LONG, SHORT)
    rule.count(SHORT, LONG)
    rule.observe(0.5, 0)
    assert rule.required_percent == 1.0


def known_speed(speeds):
    """Points that a change must promise at the end, of a drive of known speeds in which settings alternate."""
    policy, scene, state = control.create("iopc_optimal", camera=CAMERA, performance=SURFACE), Scene(0.1), LONG
    for number, speed in enumerate(speeds):
        policy.known_speed_px_s = speed
        policy.decide(scene.observe(state), state)
        if number < len(speeds) - 1:
            policy.hysteresis.count(*((SHORT, LONG) if number % 2 else (LONG, SHORT)))
    return policy.hysteresis.required_percent


def test_noise_of_odometry_is_no_jump_of_the_speed():
    steady = [600.0] * 6
    assert known_speed(steady) > 1.0
    assert known_speed([speed + 0.001 * number for number, speed in enumerate(steady)]) == known_speed(steady)
    assert known_speed([*steady, 600.0 * 2**0.55]) == known_speed([*steady, 600.0 / 2**0.55]) == 1.0


@pytest.mark.parametrize(
    ("speeds", "jumps"),
    [
        ([300.0, 310.0, 290.0, 420.0], [1, 1, 1, 1]),  # up to half a stop
        ([300.0, 430.0, 420.0, 610.0], [1, 2, 2, 3]),
        ([300.0, 350.0, 400.0, 450.0], [1, 1, 1, 2]),  # slowly, but far
        ([0.0, 1e-4, 5.0, 37.0, 100.0, 0.0], [1, 1, 1, 1, 2, 3]),  # less than is resolved at 33 ms is none
    ],
)
def test_a_known_speed_jumps_by_more_than_half_a_stop(speeds, jumps):
    counter = KnownSpeedJumps(0.033)
    assert [counter.update(speed) for speed in speeds] == jumps


@pytest.mark.parametrize("name", ["iopc_optimal", "iopc_continuous"])
@pytest.mark.parametrize("value", [-1.0, math.nan])
def test_negative_points_are_refused(name, value):
    with pytest.raises(InputError, match="at least 0"):
        control.create(name, camera=CAMERA, performance=SURFACE, least_gain_percent=value)
