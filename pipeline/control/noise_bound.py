"""A decision where noise is unknown but for a bound, as behind a codec: what both ends of its range agree on.

A policy is asked with the noise of the sensor's model, and with the most there may be, if that is more (else with the
most alone). Both answers are taken apart into exposure time and brightness. Of each, the smaller of two changes in the
same direction is made; where one answer says longer and the other shorter (or brighter and darker), the noise decides,
which is not known, and that part is kept. What is left of the change must not lower the average precision for either.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.control.decision import Action, Decision
from pipeline.control.iopc import IopcPolicy
from pipeline.control.observation import Estimate, Observation
from pipeline.control.prediction import model_sigma_dn, predict
from pipeline.control.state import CameraState, Limits

SAME_STOPS = 0.02
"""Exposures that differ by less are the same."""

Stops = tuple[float, float]
"""By how much exposure time and brightness (time times gain) change, stops."""


@dataclass(frozen=True)
class BoundedDecision:
    """A decision for any noise up to a bound.

    Attributes:
        decision: settings for the next frame; its ``ap_percent`` is that with the most noise.
        gain_percent: points of average precision that it promises over the settings kept, the least of both ends; NaN
            where nothing was measured at these.
    """

    decision: Decision
    gain_percent: float


def decide_within(
    make: Callable[[], IopcPolicy], observation: Observation, state: CameraState, at_most_dn: float
) -> BoundedDecision | None:
    """Decide for a frame whose noise is at most so much.

    Args:
        make: makes a policy that has seen no frame yet.
        observation: of the frame, with an estimate of its MTF and without one of noise.
        state: settings it was taken with.
        at_most_dn: what the monitor would estimate at most, DN.

    Returns:
        the decision; None where either end has no answer (most of the frame is clipped, nothing was measured there).
    """
    policies, formation = (make(), make()), make().camera.formation
    level = max(observation.mean_level, 1e-3) ** formation.gamma
    modelled = float(model_sigma_dn(formation, level, state.gain, state.exposure_s))
    most = float(policies[0].performance.true_sigma_dn(at_most_dn))
    # Of an estimate of 0 a policy learns nothing, so that the model's noise stands.
    estimates = (0.0, at_most_dn) if modelled < most else (at_most_dn, at_most_dn)
    answers = [
        policy.decide(_given(observation, sigma_dn), state)
        for policy, sigma_dn in zip(policies, estimates, strict=True)
    ]
    if any(answer.action not in (Action.MOVE, Action.HOLD) for answer in answers):
        return None
    wanted = [answer.state for answer in answers]
    kept = make().ordered(state)
    chosen = _agreed(kept, wanted, policies[0].limits)

    def expected(sigma_dn: float) -> NDArray[np.float64]:
        motion_px = policies[0].speed_px_s * state.exposure_s
        at = predict(formation, sigma_dn, motion_px, level, state, [kept, chosen])
        return policies[0].performance.ap_percent(at.sigma_dn, at.motion_px, at.level)

    ends = np.array([expected(min(modelled, most)), expected(most)])
    gain, ap_percent = float((ends[:, 1] - ends[:, 0]).min()), float(ends[1, 1])
    if gain < 0:
        chosen, gain, ap_percent = kept, 0.0, float(ends[1, 0])
    words = f"{math.ceil(at_most_dn)} DN, the most there may be"
    noise = f"any noise from that of the sensor model to {words}" if modelled < most else f"noise of {words}"
    action = Action.HOLD if chosen == kept else Action.MOVE
    reason = _reason(kept, chosen, wanted, noise)
    return BoundedDecision(Decision(chosen, action, reason, ap_percent), gain)


def _given(observation: Observation, sigma_dn: float) -> Observation:
    """The frame as if its noise were known."""
    exact = np.asarray(sigma_dn, dtype=np.float64)
    return replace(observation, sigma_dn=Estimate(exact, exact, exact))


def _stops(kept: CameraState, state: CameraState) -> Stops:
    """From the settings kept to others."""
    pairs = (state.exposure_s, kept.exposure_s), (state.total_exposure_s, kept.total_exposure_s)
    time, brightness = (math.log2(there / here) for there, here in pairs)
    return time, brightness


def _agreed(kept: CameraState, wanted: list[CameraState], limits: Limits) -> CameraState:
    """Settings with the smaller of two changes of time and of brightness, each where both have one direction."""
    time, brightness = (_smaller(*each) for each in zip(*(_stops(kept, state) for state in wanted), strict=True))
    if not (time or brightness):
        return kept
    return limits.at_time(kept.total_exposure_s * 2.0**brightness, kept.exposure_s * 2.0**time)


def _smaller(first: float, second: float) -> float:
    """The smaller of two changes of one direction, stops; else 0."""
    same = first * second > 0 and min(abs(first), abs(second)) > SAME_STOPS
    return min(first, second, key=abs) if same else 0.0


def _reason(kept: CameraState, chosen: CameraState, wanted: list[CameraState], noise: str) -> str:
    time, brightness = (0.0 if abs(stops) <= SAME_STOPS else stops for stops in _stops(kept, chosen))
    if time or brightness:
        words = [f"{'longer' if time > 0 else 'shorter'} exposure"] if time else []
        words += [f"a {'brighter' if brightness > 0 else 'darker'} frame"] if brightness else []
        return f"{' and '.join(words)}: better with {noise}"
    if all(max(map(abs, _stops(kept, state))) <= SAME_STOPS for state in wanted):
        return f"no split promises clearly more with {noise}"
    model, most = (f"{state.exposure_ms:.3g} ms at ISO {state.iso:.0f}" for state in wanted)
    return (
        f"the noise decides, which is unknown: {model} with that of the sensor model, {most} with the most there may be"
    )
