"""What the policies on input-output performance curves (IOPC) share: metering, prediction, and what they do in doubt.

Each frame: total exposure is kept, or corrected where the mean level is off; then the split into time and gain is
chosen on the surface of average precision, from the *estimated* noise and motion. Where surfaces of darker frames were
measured too, the total exposure is chosen with the split: a detector may bear a dark frame better than its gain.
Where several settings promise about the same, `pipeline.control.margin` decides: the one that loses least in the frames
after a fall of light. A change must promise some points, more after reversals (`pipeline.control.hysteresis`). Changes
are compared with the settings written last, which with a delay are still on their way to the sensor: a frame taken
before they took effect does not make the policy write them again.
Defined actions in doubt:

* the estimator abstains: the split is kept, only brightness is corrected (``ABSTAINED``);
* the surface refuses every candidate: the one nearest to the measured region is taken (``REFUSED``).
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from pipeline.control.decision import Action, Decision
from pipeline.control.hysteresis import Hysteresis
from pipeline.control.margin import after_fall
from pipeline.control.metering import Metering
from pipeline.control.motion import motion_length
from pipeline.control.noise_ratio import NoiseRatio
from pipeline.control.observation import Observation
from pipeline.control.performance import LEVEL_SLACK_STOPS, Performance
from pipeline.control.policy import ControlledCamera, Policy
from pipeline.control.prediction import model_sigma_dn, predict
from pipeline.control.speed import SpeedFilter
from pipeline.control.state import CameraState, Limits
from pipeline.errors import InputError

TIMES_PER_STOP = 6
DARKER_TIMES_PER_STOP, DARKER_PER_STOP = 3, 1
"""Exposure times per stop, and total exposures per stop, where darker frames are candidates too."""

MOSTLY_SATURATED = 0.25
"""Fraction of saturated pixels from which a frame's estimates are not used: its noise and detail are clipped."""

LARGEST_FACTOR = 32.0
"""On total exposure in one decision: a fall of light by 16 is answered at once."""

_RATIO_RANGE = (0.2, 5.0)


@dataclass(frozen=True, eq=False)
class Candidates:
    """Settings of one total exposure and what is expected there.

    Attributes:
        states: N settings, shortest exposure first, darkest first among equal ones.
        sigma_dn, motion_px: (N,) predicted.
        ap_percent: (N,) average precision, NaN where refused.
        value: (N,) ``ap_percent`` and the margin against a fall of light, points; NaN where refused.
        excess: (N,) distance from the measured region.
    """

    states: list[CameraState]
    sigma_dn: NDArray[np.float64]
    motion_px: NDArray[np.float64]
    ap_percent: NDArray[np.float64]
    value: NDArray[np.float64]
    excess: NDArray[np.float64]


@dataclass(frozen=True)
class Choice:
    """The best of some candidates beside the split that keeps the exposure time.

    Attributes:
        index: of the best among the candidates.
        state: its settings.
        action: ``MOVE``, or ``REFUSED`` where nothing was measured at any candidate.
        ap_percent: expected there, NaN where refused.
        kept: settings that keep the exposure time, at the total exposure wanted.
        kept_ap_percent: expected with these, NaN where refused.
        gain: of value over the kept settings, points; NaN where nothing is known of these.
    """

    index: int
    state: CameraState
    action: Action
    ap_percent: float
    kept: CameraState
    kept_ap_percent: float
    gain: float

    def improves(self, required_percent: float) -> bool:
        """Whether the best promises so many points more than the present split, or nothing is known of that."""
        return not np.isfinite(self.kept_ap_percent) or self.gain > required_percent


class IopcPolicy(Policy):
    """Base class.

    Args:
        camera: see `Policy`.
        performance: surface asked.
        target: mean encoded grey level kept; None leaves brightness as it is.
        tolerance: dead band of the mean level.
        margin: AP points now that a point in the frames after a fall of light is worth; 0 for no margin. It counts for
            every frame until a new setting takes effect. Over random drives it is best from 0.2 to 0.3
            (benchmarks/control_margin.py).
        least_gain_percent: points that a change must promise on an unchanged scene without reversals.

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
        margin: float = 0.2,
        least_gain_percent: float = 1.0,
    ) -> None:
        super().__init__(camera, performance)
        if not least_gain_percent >= 0.0:
            raise InputError(
                f"policy {type(self).__name__}: points that a change must promise are at least 0, got "
                f"{least_gain_percent!r}"
            )
        if not 0.0 <= margin <= 1.0:
            raise InputError(f"policy {type(self).__name__}: margin is a fraction in [0, 1], got {margin!r}")
        self.margin = margin * (1 + self.limits.delay_frames)
        self.metering = None if target is None else Metering(target, tolerance, LARGEST_FACTOR)
        self.known_speed_px_s: float | None = None
        """Speed of the image from another source (odometry), px/s; None takes it from the estimated MTF."""
        self._speed = SpeedFilter()
        self._noise = NoiseRatio()
        self.hysteresis = Hysteresis(least_gain_percent)
        self._written: deque[CameraState] = deque(maxlen=self.limits.delay_frames)

    def decide(self, observation: Observation, state: CameraState) -> Decision:
        """See `Policy.decide`."""
        decision = self._decide(observation, state)
        self.hysteresis.count(self.ordered(state), decision.state)
        self._written.append(decision.state)
        return decision

    def ordered(self, state: CameraState) -> CameraState:
        """The settings written last; those of the frame where none are on their way to the sensor."""
        return self._written[-1] if self._written else state

    def _decide(self, observation: Observation, state: CameraState) -> Decision:
        ordered = self.ordered(state)
        total, factor = self._total_exposure(observation, state, ordered)
        clipped = observation.saturated_fraction > MOSTLY_SATURATED
        if not (observation.abstained or clipped):
            self._learn(observation, state)
        elif not (clipped and self._is_informed):
            reason = "most of the frame is clipped" if clipped else observation.reason
            if factor == 1.0 or (self.chooses_brightness and self._is_measured(observation.mean_level)):
                return Decision(ordered, Action.ABSTAINED, f"no estimate ({reason}); settings are kept")
            new = self.limits.at_time(total, ordered.exposure_s)
            return Decision(new, Action.ABSTAINED, f"no estimate ({reason}); brightness only")
        light = math.nan if clipped else self._level(observation) / state.total_exposure_s
        self.hysteresis.observe(light, self._speed.jumps if self.known_speed_px_s is None else self.known_speed_px_s)
        return self.choose(observation, state, total, factor)

    def _total_exposure(
        self, observation: Observation, state: CameraState, ordered: CameraState
    ) -> tuple[float, float]:
        """Total exposure wanted, s, and its factor on the settings written last; 1 where these are within tolerance."""
        if self.metering is None:
            return ordered.total_exposure_s, 1.0
        gamma = self.camera.formation.gamma
        total = state.total_exposure_s * self.metering.factor(observation, gamma)
        ratio = ordered.total_exposure_s / state.total_exposure_s
        coming = observation.mean_level * ratio ** (1.0 / gamma)
        if self.metering.accepts(coming) and not observation.saturated_fraction > MOSTLY_SATURATED:
            return ordered.total_exposure_s, 1.0
        return total, total / ordered.total_exposure_s

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

    def choose(self, observation: Observation, state: CameraState, total: float, factor: float) -> Decision:
        """The split of a total exposure; implemented by each policy.

        Args:
            observation: the frame, with estimates.
            state: settings it was taken with.
            total: time x gain to reach, s.
            factor: of the total against that of the settings written last.
        """
        raise NotImplementedError

    def candidates(self, observation: Observation, state: CameraState, total: float) -> Candidates:
        """Every split of a total exposure that the camera accepts, with predictions; of darker ones if measured."""
        chooses = self.chooses_brightness
        totals = darker_totals(total, self.performance, self.camera.formation.gamma) if chooses else [total]
        times = exposure_times(self.limits, DARKER_TIMES_PER_STOP if chooses else TIMES_PER_STOP)
        ordered = self.ordered(state)
        states = {self.limits.at_time(each, time) for each in totals for time in [*times, ordered.exposure_s]}
        return self.expect(observation, state, sorted({*states, ordered} if chooses else states, key=_by_time))

    def expect(self, observation: Observation, state: CameraState, states: list[CameraState]) -> Candidates:
        """Predictions for given settings."""
        mean = self._level(observation)
        model = self.camera.formation
        sigma_dn = self._noise.value * float(model_sigma_dn(model, mean, state.gain, state.exposure_s))
        at = predict(model, sigma_dn, self.speed_px_s * state.exposure_s, mean, state, states)
        expected = self.performance.ap_percent(at.sigma_dn, at.motion_px, at.level)
        value = expected
        if self.margin:
            value = expected + self.margin * after_fall(self.performance, model, at, states)
        excess = self.performance.excess(at.sigma_dn, at.motion_px)
        return Candidates(states, at.sigma_dn, at.motion_px, expected, value, excess)

    def best(self, among: Candidates) -> tuple[int, Action]:
        """Index of the settings with the highest value, or nearest to the measured region."""
        if np.isfinite(among.value).any():
            return int(np.nanargmax(among.value)), Action.MOVE
        return int(np.argmin(among.excess)), Action.REFUSED

    def compare(self, observation: Observation, state: CameraState, total: float, among: Candidates) -> Choice:
        """The best of some candidates and the split written last, both with their expected average precision.

        Where brightness is chosen, that split is the settings written last; else that of the total exposure wanted.
        """
        index, action = self.best(among)
        ordered = self.ordered(state)
        kept = ordered if self.chooses_brightness else self.limits.at_time(total, ordered.exposure_s)
        known = among if kept in among.states else self.expect(observation, state, [kept])
        at = known.states.index(kept)
        gain = float(among.value[index] - known.value[at])
        here, best = float(known.ap_percent[at]), float(among.ap_percent[index])
        return Choice(index, among.states[index], action, best, kept, here, gain)

    def held(self, state: CameraState, factor: float, choice: Choice) -> CameraState:
        """Settings that keep the split written last: these ones, unless brightness has to be corrected."""
        return self.ordered(state) if factor == 1.0 else choice.kept

    @property
    def speed_high_px_s(self) -> float:
        """Upper end of the interval of the image's speed."""
        return self._speed.high_px_s if self.known_speed_px_s is None else self.known_speed_px_s

    @property
    def speed_px_s(self) -> float:
        """Speed of the image: known, or estimated so far; NaN before the first estimate."""
        return self._speed.value_px_s if self.known_speed_px_s is None else self.known_speed_px_s

    def _level(self, observation: Observation) -> float:
        """Linear mean level of the frame, from its encoded mean."""
        return max(observation.mean_level, 1e-3) ** self.camera.formation.gamma

    def _learn(self, observation: Observation, state: CameraState) -> None:
        """Update speed and the ratio of estimated to modelled noise."""
        assert observation.mtf is not None and observation.sigma_dn is not None
        sigma_dn = float(self.performance.true_sigma_dn(observation.sigma_dn.value))
        modelled = float(model_sigma_dn(self.camera.formation, self._level(observation), state.gain, state.exposure_s))
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


def _by_time(state: CameraState) -> tuple[float, float]:
    return state.exposure_s, state.gain
