"""Advice for one picture: its condition, the average precision expected now, the best settings and why."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import sensor
from pipeline.camera.exposure import Camera
from pipeline.condition.verdict import blur_range, noise_ends
from pipeline.control.decision import Action, Decision
from pipeline.control.iopc import Frame
from pipeline.control.motion import motion_length
from pipeline.control.observation import Observation, observe
from pipeline.control.performance import Performance
from pipeline.control.policies.iopc_optimal import IopcOptimal
from pipeline.control.policy import ControlledCamera
from pipeline.control.precision.expected_precision import ExpectedPrecision, expected_at, interval_between
from pipeline.control.state import BASE_ISO, CameraState, Limits
from pipeline.control.temporal.noise_ratio import ESTIMATE_ERROR_DN
from pipeline.control.worst_case import BoundedDecision, decide_within
from pipeline.errors import InputError

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
        best_ap_percent, gain_percent: average precision expected there, and how much more that is; of other settings
            the least of any noise up to a bound and any motion within an uncertain interval
            (`pipeline.control.worst_case`), of those kept ``ap_percent`` and 0.
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

    @property
    def keeps_settings(self) -> bool:
        """Whether the settings of the picture are the ones advised."""
        return (self.exposure_ms, self.iso) == (self.best_exposure_ms, self.best_iso)


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
        seen = frame.observation
        if seen.sigma_dn is None:
            return super().noise_dn(frame)
        estimated_dn = float(self.performance.true_sigma_dn(seen.sigma_dn.value, seen.mean_level))
        return max(estimated_dn, ESTIMATE_ERROR_DN)

    def brightness_only(self, seen: Observation, state: CameraState) -> Decision | None:
        """A correction of brightness where frames as dark or bright were not measured; None where they were.

        Settings cannot be compared with those of such a picture, which its estimates are uncertain of.
        """
        if not self.chooses_brightness or self._is_measured(seen.mean_level):
            return None
        decision = self._without_estimates(self.frame(seen, state), "")
        reason = "frames of this brightness were not measured, and noise or motion is uncertain; brightness only"
        return replace(decision, reason=reason)


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


@dataclass(frozen=True)
class _Known:
    """What is known of a picture's noise and motion; NaN where nothing is.

    Attributes:
        sigma_dn: noise estimated.
        noise_dn: the least and the most to be reckoned with.
        motion_px: motion estimated, or that of a known speed.
        motion_ends_px: ends of its interval.
        motion_is_uncertain: whether these are to be reckoned with.
    """

    sigma_dn: float
    noise_dn: tuple[float, float]
    motion_px: float
    motion_ends_px: tuple[float, float]
    motion_is_uncertain: bool

    @property
    def motions_px(self) -> tuple[float, ...]:
        """Motion to be reckoned with, from the least to the most."""
        least_px, most_px = self.motion_ends_px
        return (least_px, self.motion_px, most_px) if self.motion_is_uncertain else (self.motion_px,)

    @property
    def is_uncertain(self) -> bool:
        """Whether more than one noise or motion is to be reckoned with."""
        return math.isnan(self.sigma_dn) or self.noise_dn[0] != self.noise_dn[1] or self.motion_is_uncertain


def advise(
    image: NDArray[np.floating],
    state: CameraState,
    camera: ControlledCamera,
    performance: Performance,
    monitor: ConditionMonitor | None = None,
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
        monitor: estimates noise and MTF; not used where there is a condition.
        speed_px_s: speed of the image if it is known, whatever its sign; None takes it from the estimated MTF.
        condition: of the picture, where it has been estimated already; its MTF is the system's, not a relative one.

    Raises:
        InputError: not such a picture, neither monitor nor condition, or a speed that is no finite number.
    """
    if speed_px_s is not None and not math.isfinite(speed_px_s):
        raise InputError(f"advice: speed_px_s is {speed_px_s!r}; expected a finite number of px/s, or None")
    if condition is None:
        if monitor is None:
            raise InputError("advice: expected a monitor, or the condition that it estimated")
        condition = monitor.frame(np.asarray(image, dtype=np.float32))
    seen = observe(image, condition=condition)
    at_most_dn = float(condition.noise.at_most_dn)
    known = _known(seen, at_most_dn, state, performance, speed_px_s)
    in_range = known.is_uncertain and seen.mtf is not None and bool(np.isfinite(known.noise_dn).all())
    here = _expected(performance, seen, known, in_range)
    decided = _decide(seen, state, camera, performance, known, here.ap_percent, in_range)
    decision, action, reason = decided.decision, decided.decision.action, decided.decision.reason
    if inside(camera.limits, state) != state:
        action = Action.MOVE if action is Action.HOLD else action
        reason = f"settings outside the limits; from the nearest inside: {reason}"
    return Advice(
        exposure_ms=state.exposure_ms,
        iso=state.iso,
        sigma_dn=known.sigma_dn,
        sigma_at_most_dn=at_most_dn,
        motion_px=known.motion_px,
        motion_low_px=known.motion_ends_px[0],
        motion_high_px=known.motion_ends_px[1],
        ap_percent=here.ap_percent,
        low_percent=here.low_percent,
        high_percent=here.high_percent,
        best_exposure_ms=decision.state.exposure_ms,
        best_iso=decision.state.iso,
        best_ap_percent=decision.ap_percent,
        gain_percent=decided.gain_percent,
        undecided=decided.undecided,
        action=str(action.value),
        reason=reason,
    )


def _known(
    seen: Observation, at_most_dn: float, state: CameraState, performance: Performance, speed_px_s: float | None
) -> _Known:
    """Noise and motion of a picture with what they may be."""
    sigma_dn, noise_dn = math.nan, (0.0, at_most_dn)
    if seen.sigma_dn is not None:
        sigma_dn = float(seen.sigma_dn.value)
        noise_dn = noise_ends(sigma_dn, float(seen.sigma_dn.low), float(seen.sigma_dn.high))
    motion_px = least_px = most_px = math.nan
    uncertain = False
    if speed_px_s is not None:
        motion_px = least_px = most_px = abs(speed_px_s) * state.exposure_s
    elif seen.mtf is not None:
        motion_px, least_px, most_px, _ = motion_length(seen.mtf, performance.reference)
        uncertain = bool(blur_range(seen.mtf.low, seen.mtf.high))
    return _Known(sigma_dn, noise_dn, motion_px, (least_px, most_px), uncertain)


def _expected(performance: Performance, seen: Observation, known: _Known, in_range: bool) -> ExpectedPrecision:
    """Average precision expected at the settings of the picture; its interval reaches as far as noise and motion do."""
    at = partial(expected_at, performance, level=seen.mean_level)
    here = at(known.sigma_dn, known.motion_px)
    if not in_range:
        return here
    worst, best = (at(known.noise_dn[end], known.motions_px[end]) for end in (-1, 0))
    low, high = interval_between(here, worst, best)
    return here._replace(low_percent=low, high_percent=high)


def _decide(
    seen: Observation,
    state: CameraState,
    camera: ControlledCamera,
    performance: Performance,
    known: _Known,
    ap_percent: float,
    in_range: bool,
) -> BoundedDecision:
    """Settings: better with all noise and motion to be reckoned with, where there is a range of them, else by estimate.

    Args:
        seen: the picture.
        state: settings it was taken with.
        camera: limits and sensor.
        performance: surface asked.
        known: its noise and motion.
        ap_percent: expected at ``state``.
        in_range: whether noise and motion have known ends and differ.
    """

    def policy() -> _FromInside:
        made = _FromInside(camera, performance, least_gain_percent=LEAST_GAIN_PERCENT, margin=0.0)
        made.known_speed_px_s = known.motion_px / state.exposure_s if np.isfinite(known.motion_px) else None
        return made

    bounded = decide_within(policy(), seen, state, known.noise_dn, known.motions_px) if in_range else None
    if bounded is not None:
        decision = bounded.decision
        if decision.action is Action.HOLD and decision.state == state and np.isfinite(ap_percent):
            return replace(bounded, decision=replace(decision, ap_percent=ap_percent))
        return bounded
    kept = inside(camera.limits, state)
    decision = _kept_unless_better(policy().decide(seen, state), kept, state, ap_percent)
    if known.is_uncertain and decision.state != state and decision.action in (Action.MOVE, Action.HOLD):
        if (brightened := policy().brightness_only(seen, state)) is not None:
            return BoundedDecision(brightened, brightened.ap_percent - ap_percent)
        reason = "noise or motion may be more than was measured; settings are kept"
        expected, gain = (ap_percent, 0.0) if kept == state else (math.nan, math.nan)  # not of those brought inside
        return BoundedDecision(Decision(kept, Action.HOLD, reason, expected), gain, undecided=True)
    return BoundedDecision(decision, decision.ap_percent - ap_percent)


def _kept_unless_better(decision: Decision, kept: CameraState, state: CameraState, ap_percent: float) -> Decision:
    """The decision, or the settings of the picture where those decided promise hardly more."""
    if kept != state or not decision.ap_percent - ap_percent <= LEAST_GAIN_PERCENT:
        return decision
    reason = decision.reason if decision.state == kept else "no other settings promise clearly more"
    return Decision(kept, Action.HOLD, reason, ap_percent)
