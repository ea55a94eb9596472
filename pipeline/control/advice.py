"""Advice for one picture: its condition, the average precision expected now, the best settings and why."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import sensor
from pipeline.camera.exposure import Camera
from pipeline.condition.verdict import blur_range, noise_ends
from pipeline.control.decision import Action, Decision
from pipeline.control.iopc import Frame
from pipeline.control.motion import motion_length
from pipeline.control.noise_ratio import ESTIMATE_ERROR_DN
from pipeline.control.observation import observe
from pipeline.control.performance import Performance
from pipeline.control.policies.iopc_optimal import IopcOptimal
from pipeline.control.policy import ControlledCamera
from pipeline.control.state import BASE_ISO, CameraState, Limits
from pipeline.control.worst_case import BoundedDecision, decide_within

if TYPE_CHECKING:
    from pipeline.condition import Condition, ConditionMonitor

NOMINAL = 1.02
"""Settings are named roundly: 1/30 s is written as 33 ms."""

LEAST_GAIN_PERCENT = 0.5
"""Points of average precision that other settings must promise."""


@dataclass(frozen=True)
class Advice:
    """What is advised for one picture; numbers are NaN where unknown.

    Attributes:
        exposure_ms, iso: settings of the picture.
        sigma_dn, motion_px: estimated condition.
        sigma_at_most_dn: noise that there is at most; where a codec hides it, that is all that is known.
        motion_low_px, motion_high_px: ends of the interval of the motion.
        ap_percent, low_percent, high_percent: average precision expected at these settings, with its interval; where
            only a bound of the noise is known, or the motion is uncertain, it reaches as far.
        best_exposure_ms, best_iso: advised settings, inside the limits.
        best_ap_percent, gain_percent: average precision expected there, and how much more that is; the least of any
            noise up to a bound and any motion within an uncertain interval (`pipeline.control.worst_case`).
        undecided: whether the settings are kept because what is unknown decides.
        action: kind of decision (`pipeline.control.decision.Action`).
        reason: one sentence.
    """

    exposure_ms: float
    iso: float
    sigma_dn: float
    sigma_at_most_dn: float
    motion_px: float
    motion_low_px: float
    motion_high_px: float
    ap_percent: float
    low_percent: float
    high_percent: float
    best_exposure_ms: float
    best_iso: float
    best_ap_percent: float
    gain_percent: float
    undecided: bool
    action: str
    reason: str

    def row(self) -> dict[str, Any]:
        """The fields by name."""
        return asdict(self)


def usual_camera() -> ControlledCamera:
    """The camera that is advised on where none is described: up to 33 ms and ISO 3200, with the paper's sensor."""
    return ControlledCamera(Limits(exposure_max_s=0.033, gain_max=3200 / BASE_ISO), Camera(sensor.named("paper")))


class _FromInside(IopcOptimal):
    """Settings are compared with those of the picture brought into the limits, as if these were written already.

    A loop trusts its sensor's model as much as estimates of weak noise. Who asks about one picture names a sensor to
    tell how noise grows with gain, not how much there is: noise at other settings is in proportion to the estimate.
    """

    def written_last(self, state: CameraState) -> CameraState:
        """See `IopcPolicy.written_last`."""
        return inside(self.limits, state)

    def noise_dn(self, frame: Frame) -> float:
        """The noise estimated, DN, or as much as an estimate errs by: of none nothing could be predicted."""
        if frame.observation.sigma_dn is None:
            return super().noise_dn(frame)
        estimated_dn = float(self.performance.true_sigma_dn(frame.observation.sigma_dn.value))
        return max(estimated_dn, ESTIMATE_ERROR_DN)


def inside(limits: Limits, state: CameraState) -> CameraState:
    """The settings themselves where they lie inside the limits, else settings inside of the same brightness, or nearly.

    Args:
        limits: ranges of exposure time and gain; steps are not regarded, nor what lies beyond by `NOMINAL`.
        state: any settings.
    """
    time_fits = limits.exposure_min_s / NOMINAL <= state.exposure_s <= limits.exposure_max_s * NOMINAL
    if time_fits and limits.gain_min / NOMINAL <= state.gain <= limits.gain_max * NOMINAL:
        return state
    return limits.at_time(state.total_exposure_s, state.exposure_s)


def advise(
    image: NDArray[np.floating],
    state: CameraState,
    camera: ControlledCamera,
    performance: Performance,
    monitor: ConditionMonitor,
    speed_px_s: float | None = None,
    condition: Condition | None = None,
) -> Advice:
    """Advice for a picture.

    Settings outside the limits are brought into them first, and the advice is to move there or to better ones.

    Args:
        image: (H, W) float in [0, 1], grey, encoded.
        state: settings it was taken with.
        camera: limits, and the sensor for predictions.
        performance: surface of average precision.
        monitor: estimates noise and MTF.
        speed_px_s: speed of the image if it is known; None takes it from the estimated MTF.
        condition: of the picture, where it has been estimated already; its MTF is the system's, not a relative one.

    Raises:
        InputError: not such a picture.
    """
    condition = condition or monitor.frame(np.asarray(image, dtype=np.float32))
    seen, at_most = observe(image, condition=condition), float(condition.noise.at_most_dn)
    nan = float("nan")
    sigma = nan if seen.sigma_dn is None else float(seen.sigma_dn.value)
    motion = least_px = most_px = nan
    uncertain = False
    if speed_px_s is not None:
        motion = least_px = most_px = speed_px_s * state.exposure_s
    elif seen.mtf is not None:
        motion, least_px, most_px, _ = motion_length(seen.mtf, performance.reference)
        uncertain = bool(blur_range(seen.mtf.low, seen.mtf.high))
    motions_px = (least_px, motion, most_px) if uncertain else (motion,)
    level = min(seen.mean_level, performance.level)  # a brighter frame counts as the brightest measured
    ap, low, high = _expected(performance, sigma, motion, level)

    def policy(speed: float | None) -> _FromInside:
        made = _FromInside(camera, performance, least_gain_percent=LEAST_GAIN_PERCENT, margin=0.0)
        made.known_speed_px_s = speed
        return made

    speed = motion / state.exposure_s if np.isfinite(motion) else None
    bounded = None
    noise_dn = (0.0, at_most)
    if seen.sigma_dn is not None:
        noise_dn = noise_ends(sigma, float(seen.sigma_dn.low), float(seen.sigma_dn.high))
    unsure = seen.sigma_dn is None or noise_dn[0] != noise_dn[1] or uncertain
    if seen.mtf is not None and np.isfinite(noise_dn).all() and unsure:
        low, high = _reaching(performance, noise_dn, motions_px, level)
        low = 0.0 if np.isnan(low) and np.isfinite(ap) else low  # beyond what was measured
        bounded = decide_within(policy(speed), seen, state, noise_dn, motions_px)
    decision = bounded.decision if bounded else policy(speed).decide(seen, state)
    kept = inside(camera.limits, state)
    if bounded is None and kept == state and decision.ap_percent - ap <= LEAST_GAIN_PERCENT:
        reason = decision.reason if decision.state == kept else "no other settings promise clearly more"
        decision = Decision(kept, Action.HOLD, reason, ap)
    if bounded is None and unsure and decision.action is Action.MOVE:
        reason = "noise or motion may be more than was measured; settings are kept"
        decision = Decision(kept, Action.HOLD, reason, ap)
        bounded = BoundedDecision(decision, 0.0, undecided=True)
    action, reason = decision.action, decision.reason
    if kept != state:
        action = Action.MOVE if action is Action.HOLD else action
        reason = f"settings outside the limits; from the nearest inside: {reason}"
    return Advice(
        exposure_ms=state.exposure_ms,
        iso=state.iso,
        sigma_dn=sigma,
        sigma_at_most_dn=at_most,
        motion_px=motion,
        motion_low_px=least_px,
        motion_high_px=most_px,
        ap_percent=ap,
        low_percent=low,
        high_percent=high,
        best_exposure_ms=decision.state.exposure_ms,
        best_iso=decision.state.iso,
        best_ap_percent=decision.ap_percent,
        gain_percent=bounded.gain_percent if bounded else decision.ap_percent - ap,
        undecided=bounded is not None and bounded.undecided,
        action=str(action.value),
        reason=reason,
    )


def _reaching(
    performance: Performance, noise_dn: tuple[float, float], motions_px: tuple[float, ...], level: float
) -> tuple[float, float]:
    """Average precision expected with the most and with the least noise and motion: its ends."""
    low = _expected(performance, noise_dn[1], motions_px[-1], level)[1]
    high = _expected(performance, noise_dn[0], motions_px[0], level)[2]
    return low, high


def _expected(performance: Performance, sigma_dn: float, motion_px: float, level: float) -> tuple[float, float, float]:
    """Average precision and the ends of its interval at estimated noise and motion; NaN where either is unknown."""
    if not np.isfinite([sigma_dn, motion_px]).all():
        return (float("nan"),) * 3
    ap, low, high = performance.expected(float(performance.true_sigma_dn(sigma_dn)), motion_px, level)
    return float(ap), float(low), float(high)
