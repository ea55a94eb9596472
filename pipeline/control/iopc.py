"""What the policies on input-output performance curves (IOPC) share: metering, prediction, and what they do in doubt.

Each frame: total exposure is kept, or corrected where the mean level is off; then the split into time and gain is
chosen on the surface of average precision, from the *estimated* noise and motion. Where surfaces of darker frames were
measured too, the total exposure is chosen with the split: a detector may bear a dark frame better than its gain.
Defined actions in doubt:

* the estimator abstains: the split is kept, only brightness is corrected (``ABSTAINED``);
* the surface refuses every candidate: the one nearest to the measured region is taken (``REFUSED``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from pipeline.control.decision import Action, Decision
from pipeline.control.metering import Metering
from pipeline.control.motion import motion_length
from pipeline.control.noise_ratio import NoiseRatio
from pipeline.control.observation import Observation
from pipeline.control.performance import LEVEL_SLACK_STOPS, Performance
from pipeline.control.policy import ControlledCamera, Policy
from pipeline.control.prediction import model_sigma_dn, predict
from pipeline.control.speed import SpeedFilter
from pipeline.control.state import CameraState, Limits

TIMES_PER_STOP = 6
DARKER_TIMES_PER_STOP, DARKER_PER_STOP = 3, 1
"""Exposure times per stop, and total exposures per stop, where darker frames are candidates too."""

MOSTLY_SATURATED = 0.25
"""Fraction of saturated pixels from which a frame's estimates are not used: its noise and detail are clipped."""

_RATIO_RANGE = (0.2, 5.0)


@dataclass(frozen=True, eq=False)
class Candidates:
    """Settings of one total exposure and what is expected there.

    Attributes:
        states: N settings, shortest exposure first, darkest first among equal ones.
        sigma_dn, motion_px: (N,) predicted.
        ap_percent: (N,) average precision, NaN where refused.
        excess: (N,) distance from the measured region.
    """

    states: list[CameraState]
    sigma_dn: NDArray[np.float64]
    motion_px: NDArray[np.float64]
    ap_percent: NDArray[np.float64]
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
    """

    index: int
    state: CameraState
    action: Action
    ap_percent: float
    kept: CameraState
    kept_ap_percent: float

    def improves(self, least_gain_percent: float) -> bool:
        """Whether the best promises so many AP points more than the present split, or nothing is known of that."""
        return not np.isfinite(self.kept_ap_percent) or self.ap_percent > self.kept_ap_percent + least_gain_percent


class IopcPolicy(Policy):
    """Base class.

    Args:
        camera: see `Policy`.
        performance: surface asked.
        target: mean encoded grey level kept; None leaves brightness as it is.
        tolerance: dead band of the mean level.

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
    ) -> None:
        super().__init__(camera, performance)
        self.metering = None if target is None else Metering(target, tolerance)
        self.known_speed_px_s: float | None = None
        """Speed of the image from another source (odometry), px/s; None takes it from the estimated MTF."""
        self._speed = SpeedFilter()
        self._noise = NoiseRatio()

    def decide(self, observation: Observation, state: CameraState) -> Decision:
        """See `Policy.decide`."""
        factor = 1.0 if self.metering is None else self.metering.factor(observation, self.camera.formation.gamma)
        total = state.total_exposure_s * factor
        clipped = observation.saturated_fraction > MOSTLY_SATURATED
        if not (observation.abstained or clipped):
            self._learn(observation, state)
        elif not (clipped and self._is_informed):
            reason = "most of the frame is clipped" if clipped else observation.reason
            if factor == 1.0 or (self.chooses_brightness and self._is_measured(observation.mean_level)):
                return Decision(state, Action.ABSTAINED, f"no estimate ({reason}); settings are kept")
            new = self.limits.at_time(total, state.exposure_s)
            return Decision(new, Action.ABSTAINED, f"no estimate ({reason}); brightness only")
        return self.choose(observation, state, total, factor)

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
            factor: of the total against the present one.
        """
        raise NotImplementedError

    def candidates(self, observation: Observation, state: CameraState, total: float) -> Candidates:
        """Every split of a total exposure that the camera accepts, with predictions; of darker ones if measured."""
        chooses = self.chooses_brightness
        totals = darker_totals(total, self.performance, self.camera.formation.gamma) if chooses else [total]
        times = exposure_times(self.limits, DARKER_TIMES_PER_STOP if chooses else TIMES_PER_STOP)
        states = {self.limits.at_time(each, time) for each in totals for time in [*times, state.exposure_s]}
        return self.expect(observation, state, sorted({*states, state} if chooses else states, key=_by_time))

    def expect(self, observation: Observation, state: CameraState, states: list[CameraState]) -> Candidates:
        """Predictions for given settings."""
        mean = self._level(observation)
        model = self.camera.formation
        sigma_dn = self._noise.value * float(model_sigma_dn(model, mean, state.gain, state.exposure_s))
        at = predict(model, sigma_dn, self.speed_px_s * state.exposure_s, mean, state, states)
        expected = self.performance.expected(at.sigma_dn, at.motion_px, at.level).ap_percent
        return Candidates(
            states, at.sigma_dn, at.motion_px, expected, self.performance.excess(at.sigma_dn, at.motion_px)
        )

    def best(self, among: Candidates) -> tuple[int, Action]:
        """Index of the settings with the highest average precision, or nearest to the measured region."""
        if np.isfinite(among.ap_percent).any():
            return int(np.nanargmax(among.ap_percent)), Action.MOVE
        return int(np.argmin(among.excess)), Action.REFUSED

    def compare(self, observation: Observation, state: CameraState, total: float, among: Candidates) -> Choice:
        """The best of some candidates and the present split, both with their expected average precision.

        Where brightness is chosen, the present split is the present state; else that of the total exposure wanted.
        """
        index, action = self.best(among)
        kept = state if self.chooses_brightness else self.limits.at_time(total, state.exposure_s)
        known = among.ap_percent[among.states.index(kept)] if kept in among.states else None
        here = float(self.expect(observation, state, [kept]).ap_percent[0] if known is None else known)
        return Choice(index, among.states[index], action, float(among.ap_percent[index]), kept, here)

    def held(self, state: CameraState, factor: float, choice: Choice) -> CameraState:
        """Settings that keep the present split: the present ones, unless brightness has to be corrected."""
        return state if factor == 1.0 else choice.kept

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
