"""Decisions for the worst case of what is unknown: no loss with any noise up to its bound, or the settings stay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from control_makers import CAMERA, darker_performance, performance, scalar, seen_mtf

from pipeline.control.decision import Action
from pipeline.control.observation import Observation
from pipeline.control.policies.iopc_optimal import IopcOptimal
from pipeline.control.precision.prediction import predict
from pipeline.control.state import CameraState
from pipeline.control.worst_case import decide_within

SURFACES = {"one level": performance(), "darker too": darker_performance(3.0)}
LEVEL, LEAST_GAIN = 0.5, 0.5


def make(surface="one level", speed_px_s=None):
    policy = IopcOptimal(CAMERA, SURFACES[surface], least_gain_percent=LEAST_GAIN, margin=0.0)
    policy.known_speed_px_s = speed_px_s
    return policy


def frame(motion_px, saturated=0.0):
    return Observation(np.full((8, 8), LEVEL, np.float32), LEVEL, saturated, None, seen_mtf(motion_px), "compressed")


def gains(surface, state, chosen, motion_px, most_dn, count=23):
    """(count,) points gained by other settings with noise from next to none to the most."""
    model, linear = CAMERA.formation, LEVEL**CAMERA.formation.gamma
    each = []
    for sigma_dn in np.linspace(0.01, most_dn, count):
        at = predict(model, float(sigma_dn), motion_px, linear, state, [state, chosen])
        here, there = SURFACES[surface].ap_percent(at.sigma_dn, at.motion_px, at.level)
        each.append(there - here)
    return np.array(each)


@pytest.mark.parametrize("surface", SURFACES)
@pytest.mark.parametrize("motion_px", [0.5, 3.0, 8.0, 14.0])
@pytest.mark.parametrize("at_most_dn", [2.0, 6.0, 12.0])
@pytest.mark.parametrize(("time_s", "gain"), [(0.002, 4.0), (0.008, 2.0), (0.02, 1.0)])
def test_no_noise_up_to_the_bound_makes_the_decision_a_loss(surface, motion_px, at_most_dn, time_s, gain):
    state = CameraState(time_s, gain)
    answer = decide_within(make(surface, motion_px / time_s), frame(motion_px), state, (0.0, at_most_dn), [motion_px])
    chosen = answer.decision.state
    assert (answer.decision.action is Action.HOLD) == (chosen == state)
    if chosen == state:
        assert answer.gain_percent == 0.0
        return
    points = gains(surface, state, chosen, motion_px, at_most_dn)
    assert points.min() > answer.gain_percent - 0.1 > LEAST_GAIN - 0.1
    assert f"up to {at_most_dn:.0f} DN" in answer.decision.reason


def test_strong_motion_asks_for_less_of_it_whatever_the_noise():
    state = CameraState(0.02, 1.0)
    answer = decide_within(make(), frame(14.0), state, (0.0, 6.0), [14.0])
    assert answer.decision.action is Action.MOVE and answer.decision.state.exposure_s < state.exposure_s
    assert answer.decision.reason.startswith("shorter exposure: better")
    known = make().decide(replace(frame(14.0), sigma_dn=scalar(6.0)), state)
    assert answer.decision.ap_percent <= known.ap_percent + 0.1  # nothing is better with the most noise than its best


def test_settings_are_kept_where_the_noise_decides():
    """Much noise and little motion: a longer exposure would serve, but only if there is noise."""
    state = CameraState(0.004, 4.0)
    answer = decide_within(make(), frame(3.0), state, (0.0, 25.0), [3.0])
    assert answer.decision.action is Action.HOLD and answer.decision.state == state
    assert answer.decision.reason.startswith("the noise decides")
    noisy = make().decide(replace(frame(3.0), sigma_dn=scalar(25.0)), state)
    assert noisy.state.exposure_s > state.exposure_s
    points = gains("one level", state, noisy.state, 3.0, 25.0)
    assert points.min() < 0 < points.max()
    known = decide_within(make(), frame(3.0), state, (1.0, 25.0), [3.0])  # some noise there is
    assert known.undecided and "with the least" in known.decision.reason and "without any" not in known.decision.reason


def test_nothing_to_gain_is_said_so():
    state = CameraState(0.0005, 1.0)
    answer = decide_within(make(), frame(0.1), state, (0.0, 0.5), [0.1])
    assert answer.decision.action is Action.HOLD and answer.decision.reason.startswith("no split promises clearly more")


def test_clipped_frames_and_noise_beyond_the_surface_have_no_answer():
    assert decide_within(make(), frame(3.0, saturated=0.9), CameraState(0.008, 1.0), (0.0, 5.0), [3.0]) is None
    assert decide_within(make(), frame(3.0), CameraState(0.008, 1.0), (0.0, 90.0), [3.0]) is None
