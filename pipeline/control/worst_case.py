"""A decision where noise has only a bound, as behind a codec, or motion is uncertain: better whatever they are.

Of all settings the camera accepts, those s are taken whose least gain over the settings kept, k, is greatest,

    max_s  min_(sigma, v)  AP(s; sigma, v) - AP(k; sigma, v)

if that is more than a policy asks for: sigma the noise of the frame, from none to its bound or as estimated; v its
motion, as estimated and at the ends of its interval. Noise and motion at other settings follow from those of the frame
by the sensor's model (`pipeline.control.precision.prediction`). The model's own noise is no lower end: a camera may
have less.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.exposure import Camera
from pipeline.control.decision import Action, Decision
from pipeline.control.iopc import IopcPolicy
from pipeline.control.observation import Estimate, Observation
from pipeline.control.performance import Performance
from pipeline.control.precision.prediction import linear_level, predict
from pipeline.control.state import CameraState

LEVELS = 5
"""Of noise, evenly from the least to the most, at which settings are compared."""

LEAST_DN = 1e-3
"""Stands for no noise, of which nothing could be predicted in proportion."""

SAME_STOPS = 0.02
"""Exposures that differ by less are the same."""


@dataclass(frozen=True)
class BoundedDecision:
    """A decision for any noise and motion that there may be.

    Attributes:
        decision: settings for the next frame; its ``ap_percent`` is that with the most of both, the least there is.
        gain_percent: least gain of average precision over the settings kept, points; 0 where they are kept.
        undecided: whether they are kept because noise or motion decides.
    """

    decision: Decision
    gain_percent: float
    undecided: bool = False


def decide_within(
    policy: IopcPolicy,
    observation: Observation,
    state: CameraState,
    noise_dn: tuple[float, float],
    motions_px: Sequence[float],
) -> BoundedDecision | None:
    """Decide for a frame whose noise or motion is not known exactly.

    Args:
        policy: that has seen no frame yet, of known speed: else it trusts a short motion as little as with the most
            noise.
        observation: of the frame, with an estimate of its MTF.
        state: settings it was taken with.
        noise_dn: the least and the most that the monitor would estimate, DN; twice the same where it is known.
        motions_px: motion that the frame may have, from the least to the most; of several, that beyond what was
            measured counts as the longest measured.

    Returns:
        the decision; None where there is none with the most noise either (most of the frame is clipped, or nothing was
        measured at such noise and motion).
    """
    kept, required = policy.written_last(state), policy.hysteresis.required_percent
    exact = np.asarray(noise_dn[1], dtype=np.float64)
    noisy = replace(observation, sigma_dn=Estimate(exact, exact, exact))
    if policy.decide(noisy, state).action not in (Action.MOVE, Action.HOLD):
        return None
    total_s = state.total_exposure_s
    if policy.metering is not None:
        total_s *= policy.metering.factor(observation, policy.camera.formation.gamma)
    states = [kept, *policy.candidates(policy.frame(noisy, state, total_s)).states]
    with_noise = partial(
        expected_with,
        mean_level=observation.mean_level,
        state=state,
        states=states,
        formation=policy.camera.formation,
        performance=policy.performance,
    )
    levels_dn = policy.performance.true_sigma_dn(np.unique(np.linspace(*noise_dn, LEVELS)), observation.mean_level)
    longest_px = policy.performance.longest_px if len(motions_px) > 1 else math.inf
    lengths_px = [min(length, longest_px) for length in motions_px]
    expected = np.array([with_noise(float(dn), length) for length in lengths_px for dn in levels_dn])
    if not np.isfinite(expected[:, 0]).all():
        return None
    gains = expected - expected[:, :1]
    least = np.where(np.isfinite(gains).all(axis=0), gains.min(axis=0), -np.inf)
    best = int(np.argmax(least))
    any_of, unknown, ends = _words(noise_dn, motions_px)
    if least[best] > required:
        reason = f"{_change(kept, states[best])}: better with any {any_of}"
        decision = Decision(states[best], Action.MOVE, reason, float(expected[-1, best]))
        return BoundedDecision(decision, float(least[best]))
    first, last = (int(np.nanargmax(gains[end])) for end in (0, -1))
    undecided = bool(max(gains[0, first], gains[-1, last]) > required)
    if undecided:
        least_of, most_of = (f"{states[end].exposure_ms:.3g} ms at ISO {states[end].iso:.0f}" for end in (first, last))
        reason = f"{unknown}: {least_of} {ends[0]}, {most_of} {ends[1]}; settings are kept"
    else:
        reason = f"no split promises clearly more with any {any_of}"
    return BoundedDecision(Decision(kept, Action.HOLD, reason, float(expected[-1, 0])), 0.0, undecided)


def _words(noise_dn: tuple[float, float], motions_px: Sequence[float]) -> tuple[str, str, tuple[str, str]]:
    """What may be anything; that it decides; with the least and with the most of it."""
    least_dn, most_dn = noise_dn[0], f"{math.ceil(noise_dn[1])} DN"
    motion = f"{motions_px[0]:.0f} to {motions_px[-1]:.0f} px"
    ends = "with the least", "with the most"
    if len(motions_px) == 1:
        most = f"{most_dn}, the most there may be"
        none = ends[0] if least_dn else "without any"
        return f"noise up to {most}", "the noise decides, which is unknown", (none, f"with {most}")
    if least_dn == noise_dn[1]:
        return f"motion of {motion}", f"the motion decides, which is uncertain ({motion})", ends
    return (
        f"noise up to {most_dn} and motion of {motion}",
        f"noise (up to {most_dn}) and motion ({motion}) decide",
        ends,
    )


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
        (N,) percent, NaN where nothing was measured. Frames above the brightest measured count as that.
    """
    level = linear_level(mean_level, formation)
    at = predict(formation, max(true_dn, LEAST_DN), motion_px, level, state, states)
    return performance.ap_percent(at.sigma_dn, at.motion_px, np.minimum(at.level, performance.level))


def _change(kept: CameraState, chosen: CameraState) -> str:
    """What other settings change, in words."""
    time = math.log2(chosen.exposure_s / kept.exposure_s)
    brightness = math.log2(chosen.total_exposure_s / kept.total_exposure_s)
    words = [f"{'longer' if time > 0 else 'shorter'} exposure"] if abs(time) > SAME_STOPS else []
    words += [f"a {'brighter' if brightness > 0 else 'darker'} frame"] if abs(brightness) > SAME_STOPS else []
    return " and ".join(words) or "other settings"
