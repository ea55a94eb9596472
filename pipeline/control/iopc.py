"""What the policies on input-output performance curves (IOPC) share: metering, prediction, and what they do in doubt.

Each frame: total exposure is kept, or corrected where the mean level is off; then the split into time and gain is
chosen on the surface of average precision, from the *estimated* noise and motion. Defined actions in doubt:

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
from pipeline.control.observation import Observation
from pipeline.control.performance import Performance
from pipeline.control.policy import ControlledCamera, Policy
from pipeline.control.prediction import model_sigma_dn, predict
from pipeline.control.state import CameraState
from pipeline.errors import InputError

TIMES_PER_STOP = 6
_RATIO_RANGE = (0.2, 5.0)


@dataclass(frozen=True, eq=False)
class Candidates:
    """Settings of one total exposure and what is expected there.

    Attributes:
        states: N settings, shortest exposure first.
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
        kept: settings of the same total exposure with the present exposure time.
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
        smoothing: weight of earlier frames in speed and noise, [0, 1).

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
        smoothing: float = 0.0,
    ) -> None:
        super().__init__(camera, performance)
        if not 0 <= smoothing < 1:
            raise InputError(f"smoothing is a weight in [0, 1), got {smoothing!r}")
        self.metering = None if target is None else Metering(target, tolerance)
        self.smoothing = smoothing
        self.known_speed_px_s: float | None = None
        """Speed of the image from another source (odometry), px/s; None takes it from the estimated MTF."""
        self._speed_px_s = self._speed_high_px_s = self._noise_ratio = math.nan

    def decide(self, observation: Observation, state: CameraState) -> Decision:
        """See `Policy.decide`."""
        factor = 1.0 if self.metering is None else self.metering.factor(observation, self.camera.formation.gamma)
        total = state.total_exposure_s * factor
        if observation.abstained:
            if factor == 1.0:
                return Decision(state, Action.ABSTAINED, f"no estimate ({observation.reason}); settings are kept")
            new = self.limits.at_time(total, state.exposure_s)
            return Decision(new, Action.ABSTAINED, f"no estimate ({observation.reason}); brightness only")
        self._learn(observation, state)
        return self.choose(observation, state, total, factor)

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
        """Every split of a total exposure that the camera accepts, with predictions."""
        limits = self.limits
        stops = math.log2(limits.exposure_max_s / limits.exposure_min_s)
        times = limits.exposure_min_s * 2.0 ** np.linspace(0.0, stops, max(2, round(stops * TIMES_PER_STOP) + 1))
        states = sorted({limits.at_time(total, float(time)) for time in [*times, state.exposure_s]}, key=_by_time)
        return self.expect(observation, state, states)

    def expect(self, observation: Observation, state: CameraState, states: list[CameraState]) -> Candidates:
        """Predictions for given settings."""
        mean = self._level(observation)
        model = self.camera.formation
        sigma_dn = self._noise_ratio * float(model_sigma_dn(model, mean, state.gain, state.exposure_s))
        at = predict(model, sigma_dn, self._speed_px_s * state.exposure_s, mean, state, states)
        expected = self.performance.expected(at.sigma_dn, at.motion_px).ap_percent
        return Candidates(
            states, at.sigma_dn, at.motion_px, expected, self.performance.excess(at.sigma_dn, at.motion_px)
        )

    def best(self, among: Candidates) -> tuple[int, Action]:
        """Index of the settings with the highest average precision, or nearest to the measured region."""
        if np.isfinite(among.ap_percent).any():
            return int(np.nanargmax(among.ap_percent)), Action.MOVE
        return int(np.argmin(among.excess)), Action.REFUSED

    def compare(self, observation: Observation, state: CameraState, total: float, among: Candidates) -> Choice:
        """The best of some candidates and the present split, both with their expected average precision."""
        index, action = self.best(among)
        kept = self.limits.at_time(total, state.exposure_s)
        here = float(self.expect(observation, state, [kept]).ap_percent[0])
        return Choice(index, among.states[index], action, float(among.ap_percent[index]), kept, here)

    @property
    def speed_high_px_s(self) -> float:
        """Upper end of the interval of the image's speed."""
        return self._speed_high_px_s

    def _level(self, observation: Observation) -> float:
        """Linear mean level of the frame, from its encoded mean."""
        return max(observation.mean_level, 1e-3) ** self.camera.formation.gamma

    def _learn(self, observation: Observation, state: CameraState) -> None:
        """Update speed and the ratio of estimated to modelled noise."""
        assert observation.mtf is not None and observation.sigma_dn is not None
        moving = motion_length(observation.mtf, self.performance.reference)
        modelled = float(model_sigma_dn(self.camera.formation, self._level(observation), state.gain, state.exposure_s))
        ratio = float(np.clip(float(observation.sigma_dn.value) / modelled, *_RATIO_RANGE))
        if self.known_speed_px_s is not None:
            self._speed_px_s = self._speed_high_px_s = self.known_speed_px_s
            self._noise_ratio = math.exp(self._smoothed(_log(self._noise_ratio), math.log(ratio)))
            return
        self._speed_px_s = self._smoothed(self._speed_px_s, moving.value_px / state.exposure_s)
        self._speed_high_px_s = self._smoothed(self._speed_high_px_s, moving.high_px / state.exposure_s)
        self._noise_ratio = math.exp(self._smoothed(_log(self._noise_ratio), math.log(ratio)))

    def _smoothed(self, before: float, now: float) -> float:
        return now if math.isnan(before) else self.smoothing * before + (1.0 - self.smoothing) * now


def _by_time(state: CameraState) -> tuple[float, float]:
    return state.exposure_s, state.gain


def _log(value: float) -> float:
    return math.nan if math.isnan(value) else math.log(value)
