"""What the policies on input-output performance curves (IOPC) share: metering, prediction, and what they do in doubt.

Each frame: total exposure is kept, or corrected where the mean level is off; then the split into time and gain is
chosen on the surface of average precision, from the *estimated* noise and motion. Where surfaces of darker frames were
measured too, the total exposure is chosen with the split: a detector may bear a dark frame better than its gain.
Where several settings promise about the same, `pipeline.control.precision.margin` decides: the one that loses least in
the frames after a fall of light. A change must promise some points, more after reversals
(`pipeline.control.temporal.hysteresis`). Changes are compared with the settings written last, which with a delay are
still on their way to the sensor: a frame taken before they took effect does not make the policy write them again.
Defined actions in doubt:

* the estimator abstains: the split is kept, only brightness is corrected (``ABSTAINED``);
* more than a quarter of the frame is white, and none before told speed and noise: likewise, and the total exposure is
  halved at least, whatever the mean;
* the surface refuses every candidate: the one nearest to the measured region is chosen, if it is clearly nearer;
* the surface refuses the settings decided: these are taken, and the decision is ``REFUSED``.

For every frame, `IopcPolicy.frame` gathers what the decision depends on, each policy's `choose` chooses settings, and
`IopcPolicy.decide` evaluates the surface at exactly these.
"""

from __future__ import annotations

import math
import numbers
from abc import abstractmethod
from collections import deque
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.control.decision import Action, Decision
from pipeline.control.image.metering import Metering
from pipeline.control.motion import motion_length
from pipeline.control.observation import Observation
from pipeline.control.performance import LEVEL_SLACK_STOPS, Performance, limited
from pipeline.control.policy import ControlledCamera, Policy
from pipeline.control.precision.margin import after_fall
from pipeline.control.precision.prediction import linear_level, predict
from pipeline.control.state import CameraState, Limits
from pipeline.control.temporal.hysteresis import Hysteresis
from pipeline.control.temporal.noise_ratio import NoiseRatio
from pipeline.control.temporal.speed import KnownSpeedJumps, SpeedFilter
from pipeline.errors import InputError

TIMES_PER_STOP = 6
DARKER_TIMES_PER_STOP, DARKER_PER_STOP = 3, 1
"""Exposure times per stop, and total exposures per stop, where darker frames are candidates too."""

CLIPPED_FRACTION = 0.25
"""Fraction of saturated pixels from which a frame's estimates are not used: its noise and detail are clipped."""

CLIPPED_FACTOR = 0.5
"""On total exposure, at most, while such frames are all that is known: kept settings would give the same again."""

LARGEST_FACTOR = 32.0
"""On total exposure in one decision: a fall of light by 16 is answered at once."""

EXCESS_PER_POINT = 0.05
"""Of `Performance.excess`, as much as a point of average precision where nothing was measured at any candidate.

The most points that hysteresis asks, eight, are then the half more that motion too long to be resolved may be, 11 of
31 px.
"""

_RATIO_RANGE = (0.2, 5.0)


@dataclass(frozen=True, eq=False)
class Frame:
    """A frame and what the settings of the next one are compared with.

    Attributes:
        observation: the frame, with estimates.
        state: settings it was taken with.
        written: settings written last: those of the frame, or with a delay those on their way to the sensor.
        total_s: time x gain wanted, s; that of ``written`` where its brightness is within the tolerance.
        kept: settings without another split: ``written`` itself where its brightness is within the tolerance or the
            policy chooses brightness, else its exposure time at the total exposure wanted.
    """

    observation: Observation
    state: CameraState
    written: CameraState
    total_s: float
    kept: CameraState

    @property
    def keeps_brightness(self) -> bool:
        """Whether the total exposure written last is the one wanted."""
        return self.total_s == self.written.total_exposure_s


@dataclass(frozen=True, eq=False)
class Candidates:
    """Settings to choose from and what is expected there.

    They split the total exposure wanted; where surfaces of darker frames were measured, smaller totals as well.

    Attributes:
        states: N settings, shortest exposure first, darkest first among equal ones.
        sigma_dn, motion_px: (N,) predicted.
        ap_percent: (N,) average precision, NaN where refused.
        value: (N,) `Performance.ranking` and the margin against a fall of light, points; NaN where refused.
        excess: (N,) distance from the measured region.
    """

    states: list[CameraState]
    sigma_dn: NDArray[np.float64]
    motion_px: NDArray[np.float64]
    ap_percent: NDArray[np.float64]
    value: NDArray[np.float64]
    excess: NDArray[np.float64]

    @property
    def best(self) -> int:
        """Index of the settings with the highest value, or of those nearest to the measured region."""
        return int(np.nanargmax(self.value) if np.isfinite(self.value).any() else np.argmin(self.excess))

    def where(self, chosen: NDArray[np.bool_]) -> Candidates:
        """Some of the candidates.

        Args:
            chosen: (N,) True for those to keep.
        """
        return Candidates(
            [self.states[index] for index in np.flatnonzero(chosen)],
            self.sigma_dn[chosen],
            self.motion_px[chosen],
            self.ap_percent[chosen],
            self.value[chosen],
            self.excess[chosen],
        )


class Choice(NamedTuple):
    """Settings that a policy chose.

    Attributes:
        state: the settings.
        reason: one sentence.
        among: candidates that were compared, with or without ``state``; None where none were.
    """

    state: CameraState
    reason: str
    among: Candidates | None = None


class IopcPolicy(Policy):
    """Base class.

    Args:
        camera: see `Policy`.
        performance: surface asked.
        target: mean encoded grey level kept; None leaves brightness as it is.
        tolerance: dead band of the mean level.
        least_gain_percent: points that a change must promise on an unchanged scene without reversals.
        margin: AP points now that a point in the frames after a fall of light is worth; 0 for no margin. It counts for
            every frame until a new setting takes effect. Over random drives it is best from 0.2 to 0.3
            (benchmarks/control_margin.py).

    Raises:
        InputError: an option out of range.
    """

    uses_estimates: ClassVar[bool] = True
    needs_surface: ClassVar[bool] = True

    def __init__(
        self,
        camera: ControlledCamera,
        performance: Performance | None = None,
        target: float | None = 0.5,
        tolerance: float = 0.1,
        least_gain_percent: float = 1.0,
        margin: float = 0.2,
    ) -> None:
        super().__init__(camera, performance)
        self.check("least_gain_percent", least_gain_percent, "points of at least 0", lambda value: value >= 0.0)
        self.check("margin", margin, "a fraction in [0, 1]", lambda value: 0.0 <= value <= 1.0)
        self.margin = margin * (1 + self.limits.delay_frames)
        self.metering = None if target is None else Metering(target, tolerance, LARGEST_FACTOR)
        self._known_speed_px_s: float | None = None
        self._speed = SpeedFilter()
        self._known_speed_jumps = KnownSpeedJumps(self.limits.exposure_max_s)
        self._noise = NoiseRatio()
        self.hysteresis = Hysteresis(least_gain_percent)
        self._written: deque[CameraState] = deque(maxlen=self.limits.delay_frames)

    def decide(self, observation: Observation, state: CameraState) -> Decision:
        """See `Policy.decide`; `Decision.ap_percent` is expected with the settings decided."""
        frame = self.frame(observation, state)
        decision = self._decide(frame)
        self.hysteresis.count(frame.written, decision.state)
        self._written.append(decision.state)
        return decision

    def frame(self, observation: Observation, state: CameraState, total_s: float | None = None) -> Frame:
        """What a decision depends on, beside the memory of earlier frames.

        Args:
            observation: the frame.
            state: settings it was taken with.
            total_s: time x gain wanted, s; None meters the frame.
        """
        written = self.written_last(state)
        total_s = self._total_exposure_s(observation, state, written) if total_s is None else total_s
        keeps = self.chooses_brightness or total_s == written.total_exposure_s
        kept = written if keeps else self.limits.at_time(total_s, written.exposure_s)
        return Frame(observation, state, written, total_s, kept)

    def written_last(self, state: CameraState) -> CameraState:
        """The settings written last; those of the frame where none are on their way to the sensor."""
        return self._written[-1] if self._written else state

    def _decide(self, frame: Frame) -> Decision:
        observation = frame.observation
        clipped = _is_clipped(observation)
        if not (observation.abstained or clipped):
            self._learn(observation, frame.state)
        elif not (clipped and self._is_informed):
            missing = observation.reason or "noise or MTF is no finite number"
            return self._without_estimates(frame, "most of the frame is clipped" if clipped else missing)
        light = math.nan if clipped else self._level(observation) / frame.state.total_exposure_s
        known_px_s = self.known_speed_px_s
        jumps = self._speed.jumps if known_px_s is None else self._known_speed_jumps.update(known_px_s)
        self.hysteresis.observe(light, jumps)
        new, reason, among = self.choose(frame)
        known = self.expect(frame, [new]) if among is None or new not in among.states else among
        expected = float(known.ap_percent[known.states.index(new)])
        action = Action.HOLD if new == frame.written else Action.MOVE
        return Decision(new, action if math.isfinite(expected) else Action.REFUSED, reason, expected)

    def _without_estimates(self, frame: Frame, reason: str) -> Decision:
        """Brightness is corrected at the exposure time written last, unless frames as dark were measured."""
        measured = self.chooses_brightness and self._is_measured(frame.observation.mean_level)
        if frame.keeps_brightness or (measured and not _is_clipped(frame.observation)):
            return Decision(frame.written, Action.ABSTAINED, f"no estimate ({reason}); settings are kept")
        new = self.limits.at_time(frame.total_s, frame.written.exposure_s)
        return Decision(new, Action.ABSTAINED, f"no estimate ({reason}); brightness only")

    def _total_exposure_s(self, observation: Observation, state: CameraState, written: CameraState) -> float:
        """Total exposure wanted, s; that of the settings written last where its level is within the tolerance."""
        if self.metering is None:
            return written.total_exposure_s
        coming = self._coming_level(observation, state, written)
        clipped = _is_clipped(observation)
        if self.metering.accepts(coming) and not clipped:
            return written.total_exposure_s
        factor = self.metering.factor(observation, self.camera.formation.gamma)
        if clipped and not self._is_informed:
            factor = min(factor, CLIPPED_FACTOR)
        return state.total_exposure_s * factor

    def _coming_level(self, observation: Observation, state: CameraState, coming: CameraState) -> float:
        """Mean encoded level that a frame taken with other settings will have."""
        ratio = coming.total_exposure_s / state.total_exposure_s
        return float(observation.mean_level * ratio ** (1.0 / self.camera.formation.gamma))

    @property
    def chooses_brightness(self) -> bool:
        """Whether darker frames than the target are candidates."""
        return self.metering is not None and bool(self.performance.darker)

    @property
    def _is_informed(self) -> bool:
        """Whether speed and noise are known from earlier frames."""
        return math.isfinite(self.speed_px_s)

    def _is_measured(self, level: float) -> bool:
        """Whether frames of this mean level were measured."""
        slack = 2.0**LEVEL_SLACK_STOPS
        return self.performance.darkest_level / slack <= level <= self.performance.level * slack

    @abstractmethod
    def choose(self, frame: Frame) -> Choice:
        """Settings for the next frame."""

    def candidates(self, frame: Frame) -> Candidates:
        """Every split of the total exposure that the camera accepts, and the settings kept; darker ones if measured.

        Settings kept whose brightness was not measured are none: where all is refused, they would be the nearest.
        """
        totals_s, times = [frame.total_s], self.times(TIMES_PER_STOP)
        if self.chooses_brightness:
            totals_s = darker_totals(frame.total_s, self.performance, self.camera.formation.gamma)
            times = [*self.times(DARKER_TIMES_PER_STOP), frame.written.exposure_s]
        states = {self.limits.at_time(total_s, time) for total_s in totals_s for time in times}
        kept_level = self._coming_level(frame.observation, frame.state, frame.kept)
        if not self.chooses_brightness or self._is_measured(kept_level):
            states.add(frame.kept)
        return self.expect(frame, sorted(states, key=_by_time))

    def times(self, per_stop: int) -> list[float]:
        """Exposure times of candidates, s.

        Args:
            per_stop: so many per factor of two.
        """
        return exposure_times(self.limits, per_stop)

    def expect(self, frame: Frame, states: list[CameraState]) -> Candidates:
        """Predictions for given settings."""
        state, mean, model = frame.state, self._level(frame.observation), self.camera.formation
        at = predict(model, self.noise_dn(frame), self.speed_px_s * state.exposure_s, mean, state, states)
        ranking = self.performance.ranking(at.sigma_dn, at.motion_px, at.level)
        value = ranking
        if self.margin:
            value = ranking + self.margin * after_fall(self.performance, model, at, states)
        excess = self.performance.excess(at.sigma_dn, at.motion_px, at.level)
        return Candidates(states, at.sigma_dn, at.motion_px, limited(ranking), value, excess)

    def noise_dn(self, frame: Frame) -> float:
        """Noise of the frame, DN: that of the sensor's model times the ratio that frames so far had to theirs."""
        level, state = self._level(frame.observation), frame.state
        return self._noise.value * float(self.camera.formation.sigma_dn_at(level, state.gain, state.exposure_s))

    def preferred(self, frame: Frame, among: Candidates) -> int:
        """Index of the settings kept unless the best candidate promises enough more, else of the best.

        Settings kept that are no candidate, or where nothing was measured but at others, are left in any case. Where
        nothing was measured at any, to be nearer to what was counts (`EXCESS_PER_POINT`).

        Args:
            frame: the frame.
            among: candidates.
        """
        best = among.best
        if frame.kept in among.states:
            kept = among.states.index(frame.kept)
            gain = among.value[best] - among.value[kept]
            if math.isnan(among.value[best]):
                gain = (among.excess[kept] - among.excess[best]) / EXCESS_PER_POINT
            if gain <= self.hysteresis.required_percent:
                return kept
        return best

    @property
    def known_speed_px_s(self) -> float | None:
        """Speed of the image from another source (odometry), px/s; None takes it from the estimated MTF.

        Its sign, a direction of travel, does not matter: the absolute value is kept.

        Raises:
            InputError: set to what is neither None nor a finite number.
        """
        return self._known_speed_px_s

    @known_speed_px_s.setter
    def known_speed_px_s(self, speed_px_s: float | None) -> None:
        if speed_px_s is not None and not (isinstance(speed_px_s, numbers.Real) and math.isfinite(speed_px_s)):
            raise InputError(
                f"policy {type(self).__name__}: known_speed_px_s is {speed_px_s!r}; expected a finite number of "
                "px/s, or None where the speed is not known"
            )
        self._known_speed_px_s = None if speed_px_s is None else abs(float(speed_px_s))

    @property
    def speed_high_px_s(self) -> float:
        """Upper end of the interval of the image's speed."""
        return self._speed.high_px_s if self.known_speed_px_s is None else self.known_speed_px_s

    @property
    def speed_px_s(self) -> float:
        """Speed of the image: known, or estimated so far; NaN before the first estimate."""
        return self._speed.value_px_s if self.known_speed_px_s is None else self.known_speed_px_s

    def _level(self, observation: Observation) -> float:
        """Linear mean level of the frame."""
        return linear_level(observation.mean_level, self.camera.formation)

    def _learn(self, observation: Observation, state: CameraState) -> None:
        """Update speed and the ratio of estimated to modelled noise."""
        assert observation.mtf is not None and observation.sigma_dn is not None
        sigma_dn = float(self.performance.true_sigma_dn(observation.sigma_dn.value, observation.mean_level))
        modelled = float(self.camera.formation.sigma_dn_at(self._level(observation), state.gain, state.exposure_s))
        ratio = float(np.clip(sigma_dn / modelled, *_RATIO_RANGE))
        self._noise.update(ratio, sigma_dn)
        if self.known_speed_px_s is None:
            moving = motion_length(observation.mtf, self.performance.reference)
            self._speed.update(moving.value_px, state.exposure_s, sigma_dn)


@lru_cache(maxsize=8)
def exposure_times(limits: Limits, per_stop: int) -> list[float]:
    """Exposure times from the shortest to the longest that a camera accepts, s."""
    stops = math.log2(limits.exposure_max_s / limits.exposure_min_s)
    steps = np.linspace(0.0, stops, max(2, round(stops * per_stop) + 1))
    return [float(time) for time in limits.exposure_min_s * 2.0**steps]


def darker_totals(total: float, performance: Performance, gamma: float) -> list[float]:
    """Total exposures from the one of full brightness down to the darkest level measured, a stop apart.

    Args:
        total: time x gain of a frame at the level of the brightest surface, s.
        performance: with surfaces of darker frames, or none.
        gamma: of the camera's tone curve.
    """
    stops = gamma * math.log2(performance.level / performance.darkest_level)
    return [total * 2.0**-step for step in np.linspace(0.0, stops, round(stops * DARKER_PER_STOP) + 1)]


def _is_clipped(observation: Observation) -> bool:
    """Whether so much of a frame is white that its estimates are not used."""
    return observation.saturated_fraction > CLIPPED_FRACTION


def _by_time(state: CameraState) -> tuple[float, float]:
    return state.exposure_s, state.gain
