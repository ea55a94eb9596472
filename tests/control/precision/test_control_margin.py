"""Margin against a fall of light, and changes compared with the settings written last where there is a delay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from control_makers import CAMERA, Scene, darker_performance, performance

from pipeline import control
from pipeline.control.decision import Action
from pipeline.control.precision.margin import FALL, after_fall
from pipeline.control.precision.prediction import predict
from pipeline.control.state import CameraState, DelayLine
from pipeline.errors import InputError

SURFACE = performance()
OURS = ("iopc_optimal", "iopc_continuous")


def delayed(name, delay, **options):
    camera = replace(CAMERA, limits=replace(CAMERA.limits, delay_frames=delay))
    return control.create(name, camera=camera, performance=SURFACE, **options)


def test_margin_is_the_average_precision_of_the_same_settings_in_less_light():
    """The sensor's noise at an eighth of the light, by the scene's closed form."""
    states = [CameraState.of(8.0, 200.0), CameraState.of(2.0, 800.0)]
    bright, dark = Scene(0.5, 400.0), Scene(0.5 / FALL, 400.0)
    seen = bright.truth(states[0])
    linear = bright.linear_level(states[0])
    at = predict(CAMERA.formation, seen.sigma_dn, seen.motion_px, linear, states[0], states)
    there = [dark.truth(state) for state in states]
    expected = SURFACE.expected([one.sigma_dn for one in there], [one.motion_px for one in there]).ap_percent
    np.testing.assert_allclose(after_fall(SURFACE, CAMERA.formation, at, states), expected, rtol=1e-3)


def test_margin_is_asked_at_the_brightness_after_the_fall():
    """By a surface whose darker frames are 20 points worse; what is darker than these counts as they do."""
    states = [CameraState.of(8.0, 200.0), CameraState.of(2.0, 800.0)]
    bright, dark, known = Scene(0.5, 400.0), Scene(0.5 / FALL, 400.0), darker_performance(-20.0)
    seen = bright.truth(states[0])
    at = predict(CAMERA.formation, seen.sigma_dn, seen.motion_px, bright.linear_level(states[0]), states[0], states)
    there = [dark.truth(state) for state in states]
    noise, motion = [one.sigma_dn for one in there], [one.motion_px for one in there]
    levels = np.maximum([one.mean_level for one in there], known.darkest_level)
    expected = np.nan_to_num(known.expected(noise, motion, levels).ap_percent)
    assert (expected < SURFACE.expected(noise, motion).ap_percent - 5.0).all()
    np.testing.assert_allclose(after_fall(known, CAMERA.formation, at, states), expected, rtol=1e-3)


def test_margin_of_what_the_surface_refuses_is_nothing():
    noisy = [CameraState.of(0.05, 3200.0)]
    at = predict(CAMERA.formation, 39.0, 0.0, 0.2, noisy[0], noisy)
    assert after_fall(SURFACE, CAMERA.formation, at, noisy)[0] == 0.0
    darker = darker_performance(0.0)
    quiet = [CameraState.of(33.0, 100.0)]
    at = predict(CAMERA.formation, 1.0, 0.0, 0.2, quiet[0], quiet)
    assert after_fall(darker, CAMERA.formation, at, quiet)[0] > 50.0  # below the darkest level counts as that


@pytest.mark.parametrize("name", OURS)
def test_margin_chooses_less_gain_and_loses_less_when_the_light_falls(name):
    lost = []
    for margin in (0.0, 0.3):
        policy, scene = delayed(name, 0, margin=margin), Scene(0.25, 300.0)
        state = CameraState.of(8.0, 100.0)
        for _ in range(10):
            state = policy.decide(scene.observe(state), state).state
        there = Scene(0.25 / FALL, 300.0).truth(state)
        lost.append((state.gain, float(SURFACE.expected(there.sigma_dn, there.motion_px).ap_percent)))
    assert lost[1][0] < lost[0][0] and lost[1][1] > lost[0][1] + 1.0


def test_margin_out_of_range_is_refused():
    with pytest.raises(InputError, match="margin"):
        delayed("iopc_optimal", 0, margin=-0.1)


@pytest.mark.parametrize("name", [*OURS, "iopc_target"])
@pytest.mark.parametrize("delay", [1, 2, 3])
@pytest.mark.parametrize("start_ms", [1.0, 20.0])
def test_settings_on_their_way_are_not_written_again(name, delay, start_ms):
    """A constant scene from a wrong start: after the first order, frames of the old settings change nothing."""
    policy, scene = delayed(name, delay), Scene(0.5, 300.0)
    state = CameraState.of(start_ms, 100.0)
    line = DelayLine.filled(state, delay)
    written, actions = [], []
    for _ in range(8 * (delay + 1)):
        decision = policy.decide(scene.observe(state), state)
        written.append(decision.state)
        actions.append(decision.action)
        state = line.next(decision.state)
    assert actions[0] is Action.MOVE
    if name != "iopc_continuous" or start_ms > 10:  # its rate limit takes more than one order from far away
        assert len(set(written[: delay + 1])) == 1 and set(actions[1 : delay + 1]) == {Action.HOLD}
    settled = written[5 * (delay + 1) :]
    assert len(set(settled)) == 1  # settled, and no oscillation
    assert scene.truth(state).mean_level == pytest.approx(0.5, rel=0.12)


@pytest.mark.parametrize("delay", [0, 2])
def test_a_step_of_light_is_answered_by_the_first_frame_that_shows_it(delay):
    policy = delayed("iopc_optimal", delay)
    bright, dark = Scene(1.0, 300.0), Scene(1.0 / 16, 300.0)
    state = CameraState.of(6.0, 100.0)
    line = DelayLine.filled(state, delay)
    for scene in [bright] * (6 + delay) + [dark] * (delay + 2):
        decision = policy.decide(scene.observe(state), state)
        state = line.next(decision.state)
    assert dark.truth(state).mean_level == pytest.approx(0.5, rel=0.2)
