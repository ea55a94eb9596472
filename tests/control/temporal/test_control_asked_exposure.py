"""Total exposure carried across a camera's steps: small changes add up, and frames taken otherwise begin anew."""

import math
from dataclasses import replace

import numpy as np
import pytest
from control_makers import Scene

from pipeline import control
from pipeline.control.policy import ControlledCamera
from pipeline.control.state import CameraState, DelayLine, Limits
from pipeline.control.temporal.asked_exposure import AskedExposure

STEPS = Limits(exposure_steps_per_stop=6, gain_step_db=1.0)
CONTINUOUS = Limits()


def driven(limits: Limits, factors: list[float], start: CameraState) -> list[CameraState]:
    """Settings of each frame."""
    asked, state, states = AskedExposure(limits), start, []
    line = DelayLine.filled(start, limits.delay_frames)
    for factor in factors:
        states.append(state)
        state = line.next(asked.decision(factor, state, "").state)
    return states


@pytest.mark.parametrize("factor", [1.02, 0.98, 1.0])
def test_changes_smaller_than_a_step_add_up(factor):
    start = CameraState.of(8.0, 100)
    with_steps, continuous = (driven(limits, [factor] * 40, start) for limits in (STEPS, CONTINUOUS))
    for near, exact in zip(with_steps, continuous, strict=True):
        assert abs(math.log2(near.total_exposure_s / exact.total_exposure_s)) <= 1 / 12 + 1e-9


@pytest.mark.parametrize("delay", [1, 3])
def test_with_a_delay_the_exposure_is_that_of_a_camera_without_steps(delay):
    factors = [1.03] * 30 + [0.96] * 30
    start = CameraState.of(2.0, 100)
    limits = [Limits(exposure_steps_per_stop=steps, delay_frames=delay) for steps in (6, 0)]
    with_steps, continuous = (driven(each, factors, start) for each in limits)
    for near, exact in zip(with_steps, continuous, strict=True):
        assert abs(math.log2(near.total_exposure_s / exact.total_exposure_s)) <= 1 / 12 + 1e-9


def test_settings_that_were_not_asked_for_begin_anew():
    asked = AskedExposure(STEPS)
    state = asked.decision(1.05, CameraState.of(8.0, 100), "").state
    other = CameraState.of(2.0, 100)
    assert asked.decision(1.0, other, "").state.total_exposure_s == pytest.approx(other.total_exposure_s, rel=0.06)
    assert state.exposure_ms == pytest.approx(8.4, rel=0.06)


def test_a_drivers_rounding_to_microseconds_is_no_other_setting():
    asked, state = AskedExposure(STEPS), CameraState.of(8.0, 100)
    for _ in range(20):
        state = asked.decision(1.02, CameraState(round(state.exposure_s, 6), state.gain), "").state
    assert state.exposure_ms == pytest.approx(8.0 * 1.02**20, rel=0.07)


def test_what_is_asked_for_does_not_run_away_beyond_the_range():
    asked, state = AskedExposure(CONTINUOUS), CameraState(CONTINUOUS.exposure_max_s, CONTINUOUS.gain_max)
    for _ in range(10):
        state = asked.decision(1.5, state, "").state
    assert asked.decision(0.5, state, "").state.total_exposure_s == pytest.approx(state.total_exposure_s / 2)


def test_kept_settings_keep_what_was_asked_for():
    asked = AskedExposure(STEPS)
    state = asked.decision(1.05, CameraState.of(8.0, 100), "").state
    for _ in range(3):
        state = asked.hold(state, "", lambda _: True).state
    assert asked.decision(1.0, state, "").state == state
    assert asked.decision(1.06, state, "").state.exposure_ms == pytest.approx(8.0 * 1.05 * 1.06, rel=0.06)


@pytest.mark.parametrize("name", ["mean_intensity", "prosilica", "shim"])
def test_policies_follow_their_law_on_a_camera_with_steps(name, monkeypatch):
    """A law that asks for 2 % more, frame after frame, is not frozen by steps of 12 %."""
    policy = control.create(name, camera=ControlledCamera(STEPS))
    monkeypatch.setattr(policy, "factor", lambda *_: 1.02, raising=False)
    if name == "mean_intensity":
        monkeypatch.setattr(type(policy.metering), "factor", lambda *_: 1.02)
    scene, state = Scene(light=0.5, speed_px_s=0.0), CameraState.of(4.0, 100)
    for _ in range(36):  # 1.02 ** 36 = 2.04
        state = policy.decide(scene.observe(state), state).state
    assert state.exposure_ms == pytest.approx(4.0 * 1.02**36, rel=0.07)


def settings_over_time(name, limits, lights, start):
    """Settings of each frame under the light of each."""
    policy = control.create(name, camera=ControlledCamera(limits))
    state, line, states = start, DelayLine.filled(start, limits.delay_frames), []
    for light in lights:
        states.append(state)
        state = line.next(policy.decide(Scene(light).observe(state), state).state)
    return states


@pytest.mark.parametrize("name", ["mean_intensity", "prosilica"])
@pytest.mark.parametrize("delay", [0, 1, 2, 3])
@pytest.mark.parametrize(("per_stop", "gain_step_db"), [(0, 6.0206), (0, 3.0), (1, 6.0), (3, 3.0)])
def test_in_steady_light_settings_settle_though_no_step_lies_inside_the_dead_band(name, delay, per_stop, gain_step_db):
    limits = Limits(exposure_steps_per_stop=per_stop, gain_step_db=gain_step_db, delay_frames=delay)
    target = {"mean_intensity": 0.5, "prosilica": 0.475}[name]
    for light in np.geomspace(0.2, 0.012, 8):  # full exposure time, gain 1.2 to 20
        states = settings_over_time(name, limits, [light] * (60 + 40 * delay), limits.nearest(8e-3, 1.0))
        assert len(set(states[-12:])) == 1, light
        wanted_s = states[-1].total_exposure_s * (target / Scene(light).truth(states[-1]).mean_level) ** 2.2
        error = abs(math.log2(states[-1].total_exposure_s / wanted_s))
        nearest = limits.time_first(wanted_s).total_exposure_s
        band = 0.07 if name == "mean_intensity" else 0.08  # of the mean level
        assert error <= max(abs(math.log2(nearest / wanted_s)), 2.2 * math.log2(1 + band)) + 0.02


@pytest.mark.parametrize("name", ["mean_intensity", "prosilica"])
@pytest.mark.parametrize("delay", [1, 2, 3])
def test_with_a_delay_frames_in_turn_do_not_keep_settings_that_differ(name, delay):
    """Light that trembles a little leaves each of the frames under way with settings of its own."""
    limits = Limits(delay_frames=delay)
    trembling = [0.3 * 2.0 ** (0.25 * math.sin(1.7 * frame)) for frame in range(60)]
    states = settings_over_time(name, limits, [*trembling, *[0.3] * 60], CameraState.of(8.0, 100))
    assert len(set(states[-12:])) == 1


@pytest.mark.parametrize("name", ["mean_intensity", "prosilica"])
def test_a_change_of_light_is_followed_by_coarse_steps_too(name):
    limits = Limits(gain_step_db=6.0206)
    states = settings_over_time(name, limits, [0.1] * 60 + [0.02] * 60, limits.nearest(8e-3, 1.0))
    assert math.log2(states[-1].total_exposure_s / states[59].total_exposure_s) == pytest.approx(2.3, abs=1.0)


def test_settings_beyond_the_cap_are_left_though_none_is_nearer_to_the_target():
    limits = replace(STEPS, gain_step_db=6.0)
    asked = AskedExposure(limits, limits.longest_up_to(0.010))
    assert asked.decision(1.0, CameraState.of(20.0, 100), "", 1.0).state.exposure_ms <= 10.0


@pytest.mark.parametrize(("per_stop", "gain_step_db"), [(6, 1.0), (0, 1.0), (6, 0.0)])
@pytest.mark.parametrize("start", [CameraState(0.02, 64.0), CameraState(0.1, 1.0), CameraState(2e-5, 1.0)])
def test_settings_outside_the_limits_are_not_kept_for_a_step_inside_that_is_nearest(per_stop, gain_step_db, start):
    """Gain 32 is nearest to the target and gain 64 twice as bright: a camera left there stays overexposed for ever."""
    limits = Limits(exposure_steps_per_stop=per_stop, gain_step_db=gain_step_db)
    wanted_s = limits.nearest(start.exposure_s, start.gain).total_exposure_s
    to_target = wanted_s / start.total_exposure_s
    new = AskedExposure(limits).decision(to_target, start, "", to_target).state
    assert limits.accepts(new) and abs(math.log2(new.total_exposure_s / wanted_s)) <= 1 / 12 + 1e-9
