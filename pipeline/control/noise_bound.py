"""A decision where noise is unknown but for a bound, as behind a codec: settings better with any noise up to it.

Of all settings the camera accepts, those s are taken whose least gain over the settings kept, k, is greatest,

    max_s  min_sigma  AP(s; sigma) - AP(k; sigma),        sigma: noise of the frame, from none to the bound,

if that is more than a policy asks for. Noise at other settings follows from that of the frame by the sensor's model
(`pipeline.control.prediction`). The model's own noise is no lower end: a camera may have less.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.exposure import Camera
from pipeline.control.decision import Action, Decision
from pipeline.control.iopc import IopcPolicy
from pipeline.control.observation import Estimate, Observation
from pipeline.control.performance import Performance
from pipeline.control.prediction import predict
from pipeline.control.state import CameraState

LEVELS = 5
"""Of noise, evenly from none to the bound, at which settings are compared."""

LEAST_DN = 1e-3
"""Stands for no noise, of which nothing could be predicted in proportion."""

SAME_STOPS = 0.02
"""Exposures that differ by less are the same."""


@dataclass(frozen=True)
class BoundedDecision:
    """A decision for any noise up to a bound.

    Attributes:
        decision: settings for the next frame; its ``ap_percent`` is that with the most noise, the least there is.
        gain_percent: least gain of average precision over the settings kept, points; 0 where they are kept.
    """

    decision: Decision
    gain_percent: float


def decide_within(
    policy: IopcPolicy, observation: Observation, state: CameraState, at_most_dn: float
) -> BoundedDecision | None:
    """Decide for a frame whose noise is at most so much.

    Args:
        policy: that has seen no frame yet, of known speed: else it trusts a short motion as little as with the most
            noise.
        observation: of the frame, with an estimate of its MTF and without one of noise.
        state: settings it was taken with.
        at_most_dn: what the monitor would estimate at most, DN.

    Returns:
        the decision; None where there is none with the most noise either (most of the frame is clipped, or nothing was
        measured at such noise and motion).
    """
    kept, required = policy.ordered(state), policy.hysteresis.required_percent
    exact = np.asarray(at_most_dn, dtype=np.float64)
    noisy = replace(observation, sigma_dn=Estimate(exact, exact, exact))
    if policy.decide(noisy, state).action not in (Action.MOVE, Action.HOLD):
        return None
    total = state.total_exposure_s
    if policy.metering is not None:
        total *= policy.metering.factor(observation, policy.camera.formation.gamma)
    states = [kept, *policy.candidates(noisy, state, total).states]
    with_noise = partial(
        expected_with,
        motion_px=policy.speed_px_s * state.exposure_s,
        mean_level=observation.mean_level,
        state=state,
        states=states,
        formation=policy.camera.formation,
        performance=policy.performance,
    )
    levels_dn = policy.performance.true_sigma_dn(np.linspace(0.0, at_most_dn, LEVELS))
    expected = np.array([with_noise(float(true_dn)) for true_dn in levels_dn])
    if not np.isfinite(expected[:, 0]).all():
        return None
    gains = expected - expected[:, :1]
    least = np.where(np.isfinite(gains).all(axis=0), gains.min(axis=0), -np.inf)
    best = int(np.argmax(least))
    most = f"{math.ceil(at_most_dn)} DN, the most there may be"
    if least[best] > required:
        reason = f"{_change(kept, states[best])}: better with any noise up to {most}"
        decision = Decision(states[best], Action.MOVE, reason, float(expected[-1, best]))
        return BoundedDecision(decision, float(least[best]))
    ends = [int(np.nanargmax(gains[end])) for end in (0, -1)]
    if max(gains[0, ends[0]], gains[-1, ends[1]]) > required:
        none, noisiest = (f"{states[end].exposure_ms:.3g} ms at ISO {states[end].iso:.0f}" for end in ends)
        reason = f"the noise decides, which is unknown: {none} without any, {noisiest} with {most}; settings are kept"
    else:
        reason = f"no split promises clearly more with any noise up to {most}"
    return BoundedDecision(Decision(kept, Action.HOLD, reason, float(expected[-1, 0])), 0.0)


def expected_with(
    true_dn: float,
    motion_px: float,
    mean_level: float,
    state: CameraState,
    states: list[CameraState],
    formation: Camera,
    performance: Performance,
) -> NDArray[np.float64]:
    """Average precision expected at other settings of a frame whose noise and motion are so much.

    Args:
        true_dn: noise of the frame, DN.
        motion_px: its motion.
        mean_level: its mean encoded grey level, 0..1.
        state: settings it was taken with.
        states: N other settings.
        formation: sensor and tone curve.
        performance: surface asked.

    Returns:
        (N,) percent, NaN where nothing was measured.
    """
    linear_level = max(mean_level, 1e-3) ** formation.gamma
    at = predict(formation, max(true_dn, LEAST_DN), motion_px, linear_level, state, states)
    return performance.ap_percent(at.sigma_dn, at.motion_px, at.level)


def _change(kept: CameraState, chosen: CameraState) -> str:
    """What other settings change, in words."""
    time = math.log2(chosen.exposure_s / kept.exposure_s)
    brightness = math.log2(chosen.total_exposure_s / kept.total_exposure_s)
    words = [f"{'longer' if time > 0 else 'shorter'} exposure"] if abs(time) > SAME_STOPS else []
    words += [f"a {'brighter' if brightness > 0 else 'darker'} frame"] if abs(brightness) > SAME_STOPS else []
    return " and ".join(words) or "other settings"
