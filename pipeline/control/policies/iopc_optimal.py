"""One jump to the settings with the highest expected average precision, held until the condition has changed.

The paper maximises AP over alpha (Wischow et al. 2023, Sec. VI); its printed formula scales noise and blur by the same
alpha, while they move in opposite directions: ``AP(sigma(alpha), d / alpha)`` here. A new jump is made when brightness
leaves the dead band or another split promises clearly more.
"""

from __future__ import annotations

import numpy as np

from pipeline.control.decision import Action, Decision
from pipeline.control.iopc import IopcPolicy
from pipeline.control.observation import Observation
from pipeline.control.performance import Performance
from pipeline.control.policy import ControlledCamera
from pipeline.control.state import CameraState


class IopcOptimal(IopcPolicy):
    """Argmax of the surface.

    Args:
        camera: see `Policy`.
        performance: surface asked.
        target: see `IopcPolicy`.
        tolerance: see `IopcPolicy`.
        smoothing: see `IopcPolicy`.
        least_gain_percent: AP points that another split must promise.
    """

    def __init__(
        self,
        camera: ControlledCamera,
        performance: Performance | None = None,
        target: float | None = 0.5,
        tolerance: float = 0.1,
        smoothing: float = 0.0,
        least_gain_percent: float = 3.0,
    ) -> None:
        super().__init__(camera, performance, target, tolerance, smoothing)
        self.least_gain_percent = least_gain_percent

    def choose(self, observation: Observation, state: CameraState, total: float, factor: float) -> Decision:
        """See `IopcPolicy.choose`."""
        among = self.candidates(observation, state, total)
        index, action = self.best(among)
        kept = self.limits.at_time(total, state.exposure_s)
        here = float(self.expect(observation, state, [kept]).ap_percent[0])
        there = float(among.ap_percent[index])
        if np.isfinite(here) and not there > here + self.least_gain_percent:
            held = state if factor == 1.0 else kept
            action = Action.HOLD if held == state else Action.MOVE
            return Decision(held, action, f"AP {here:.1f} % expected; no split promises clearly more", here)
        new = among.states[index]
        reason = (
            f"noise {among.sigma_dn[index]:.1f} DN and motion {among.motion_px[index]:.1f} px expected"
            if action is Action.MOVE
            else "nothing was measured at any split; nearest to the measured region"
        )
        return Decision(new, action, reason, there)
