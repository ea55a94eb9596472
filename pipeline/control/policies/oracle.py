"""The ceiling: settings with the highest average precision on the surface for the *true* noise and motion.

It knows the scene at every setting, has no delay and no estimator. Simulation only.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from pipeline.bisection import bisected
from pipeline.control.decision import Action, Decision
from pipeline.control.iopc import DARKER_TIMES_PER_STOP, TIMES_PER_STOP, darker_totals, exposure_times
from pipeline.control.observation import Observation
from pipeline.control.performance import Performance, limited
from pipeline.control.policy import ControlledCamera, Policy
from pipeline.control.state import CameraState
from pipeline.errors import InputError

_HALVINGS = 20


class Oracle(Policy):
    """Exhaustive search on the truth.

    Args:
        camera: see `Policy`.
        performance: surface asked.
        target: mean encoded grey level, above 0 and below 1.

    Raises:
        InputError: an option out of range.
    """

    sees_truth: ClassVar[bool] = True
    needs_surface: ClassVar[bool] = True

    def __init__(self, camera: ControlledCamera, performance: Performance | None = None, target: float = 0.5) -> None:
        super().__init__(camera, performance)
        self.check("target", target, "a fraction in (0, 1)", lambda value: 0 < value < 1)
        self.target = target

    def decide(self, observation: Observation, state: CameraState) -> Decision:
        """See `Policy.decide`."""
        if observation.truth is None:
            raise InputError("policy oracle: needs the truth, which only the simulated loop gives")
        limits, truth = self.limits, observation.truth
        total = self._total(observation)
        times = exposure_times(limits, DARKER_TIMES_PER_STOP if self.performance.darker else TIMES_PER_STOP)
        totals = darker_totals(total, self.performance, self.camera.formation.gamma)
        states = list(dict.fromkeys(limits.at_time(each, time) for each in totals for time in times))
        there = [truth(each) for each in states]
        sigma, motion, level = (
            np.array([getattr(each, name) for each in there]) for name in ("sigma_dn", "motion_px", "mean_level")
        )
        ranking = self.performance.ranking(sigma, motion, level)
        if np.isfinite(ranking).any():
            index, action = int(np.nanargmax(ranking)), Action.MOVE
        else:
            index, action = int(np.argmin(self.performance.excess(sigma, motion, level))), Action.REFUSED
        if states[index] == state and action is Action.MOVE:
            action = Action.HOLD
        reason = f"noise {sigma[index]:.1f} DN and motion {motion[index]:.1f} px are known"
        return Decision(states[index], action, reason, float(limited(ranking[index])))

    def _total(self, observation: Observation) -> float:
        """Total exposure with the target level, by bisection in stops."""
        assert observation.truth is not None
        limits = self.limits
        low = math.log2(limits.exposure_min_s * limits.gain_min)
        high = math.log2(limits.exposure_max_s * limits.gain_max)
        continuous, truth = limits.without_steps(), observation.truth
        stops = bisected(
            lambda stops: truth(continuous.time_first(2.0**stops)).mean_level >= self.target, low, high, _HALVINGS
        )
        return float(2.0**stops)
