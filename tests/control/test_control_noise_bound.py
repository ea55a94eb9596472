"""Decisions where noise has only a bound: right at both ends and between, or the settings stay."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from control_makers import CAMERA, performance, scalar, seen_mtf

from pipeline.control.decision import Action
from pipeline.control.noise_bound import decide_within
from pipeline.control.observation import Observation
from pipeline.control.policies.iopc_optimal import IopcOptimal
from pipeline.control.prediction import model_sigma_dn, predict
from pipeline.control.state import CameraState

SURFACE = performance()
LEVEL = 0.5


def make(speed_px_s=None):
    policy = IopcOptimal(CAMERA, SURFACE, least_gain_percent=0.5, margin=0.0)
    policy.known_speed_px_s = speed_px_s
    return policy


def frame(motion_px, level=LEVEL, saturated=0.0):
    return Observation(np.full((8, 8), level, np.float32), level, saturated, None, seen_mtf(motion_px), "compressed")


def expected_between(state, chosen, motion_px, most_dn, count=9):
    """(count, 2) precision at the settings of the frame and at those chosen, from the model's noise to the most."""
    model, linear = CAMERA.formation, LEVEL**CAMERA.formation.gamma
    each, least = [], min(float(model_sigma_dn(model, linear, state.gain, state.exposure_s)), most_dn)
    for sigma_dn in np.linspace(least, most_dn, count):
        at = predict(model, float(sigma_dn), motion_px, linear, state, [state, chosen])
        each.append(SURFACE.ap_percent(at.sigma_dn, at.motion_px, at.level))
    return np.array(each)


@pytest.mark.parametrize("motion_px", [0.5, 3.0, 8.0, 14.0])
@pytest.mark.parametrize("at_most_dn", [2.0, 6.0, 12.0])
@pytest.mark.parametrize(("time_s", "gain"), [(0.002, 4.0), (0.008, 2.0), (0.02, 1.0)])
def test_no_noise_from_the_models_to_the_bound_makes_the_decision_a_loss(motion_px, at_most_dn, time_s, gain):
    state = CameraState(time_s, gain)
    answer = decide_within(partial(make, motion_px / time_s), frame(motion_px), state, at_most_dn)
    assert answer.gain_percent >= 0 and (answer.decision.action is Action.HOLD) == (answer.decision.state == state)
    kept, chosen = expected_between(state, answer.decision.state, motion_px, at_most_dn).T
    assert (chosen >= kept - 1e-9).all() and chosen[-1] == pytest.approx(answer.decision.ap_percent)
    assert (chosen - kept).min() == pytest.approx(answer.gain_percent, abs=0.5)
    if answer.decision.action is Action.MOVE:
        assert chosen.mean() > kept.mean()


def test_strong_motion_asks_for_less_of_it_whatever_the_noise():
    state = CameraState(0.02, 1.0)
    answer = decide_within(make, frame(14.0), state, 6.0)
    assert answer.decision.action is Action.MOVE and answer.decision.state.exposure_s < state.exposure_s
    assert answer.decision.reason.startswith("shorter exposure") and answer.decision.reason.endswith(
        "to 6 DN, the most there may be"
    )
    ends = [make().decide(replace(frame(14.0), sigma_dn=scalar(sigma)), state).state for sigma in (0.0, 6.0)]
    assert answer.decision.state.exposure_s == pytest.approx(max(end.exposure_s for end in ends), rel=0.02)


def test_settings_are_kept_where_the_noise_decides():
    state = CameraState(0.004, 4.0)
    for motion_px in (2.0, 3.0, 4.0, 5.0, 6.0):
        ends = [make().decide(replace(frame(motion_px), sigma_dn=scalar(sigma)), state) for sigma in (0.0, 25.0)]
        apart = [end.state.exposure_s - state.exposure_s for end in ends]
        answer = decide_within(make, frame(motion_px), state, 25.0)
        if apart[0] * apart[1] < 0:
            assert answer.decision.state == state and answer.decision.reason.startswith("the noise decides")
            return
    pytest.fail("no motion was met for which weak and strong noise ask for different directions")


def test_more_noise_in_the_model_than_the_bound_leaves_the_bound_alone():
    state, linear = CameraState(0.002, 16.0), LEVEL**CAMERA.formation.gamma
    bound = 0.5 * float(model_sigma_dn(CAMERA.formation, linear, state.gain, state.exposure_s))
    answer = decide_within(make, frame(1.0), state, bound)
    known = make().decide(replace(frame(1.0), sigma_dn=scalar(bound)), state)
    assert answer.decision.state.exposure_s == pytest.approx(known.state.exposure_s, rel=0.02)
    assert "model" not in answer.decision.reason


def test_a_clipped_frame_has_no_answer():
    assert decide_within(make, frame(3.0, saturated=0.9), CameraState(0.008, 1.0), 5.0) is None
