"""One jump to the settings with the highest expected average precision, held until the condition has changed.

The paper maximises AP over alpha (Wischow et al. 2023, Sec. VI); its printed formula scales noise and blur by the same
alpha, while they move in opposite directions: ``AP(sigma(alpha), d / alpha)`` here. A new jump is made when brightness
leaves the dead band or another split promises clearly more.
"""

from __future__ import annotations

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
        least_gain_percent: points that another split must promise; more after reversals (see `IopcPolicy`).
        margin: see `IopcPolicy`.
    """

    def __init__(
        self,
        camera: ControlledCamera,
        performance: Performance | None = None,
        target: float | None = 0.5,
        tolerance: float = 0.1,
        least_gain_percent: float = 1.0,
        margin: float = 0.2,
    ) -> None:
        super().__init__(camera, performance, target, tolerance, margin, least_gain_percent)

    def choose(self, observation: Observation, state: CameraState, total: float, factor: float) -> Decision:
        """See `IopcPolicy.choose`."""
        among = self.candidates(observation, state, total)
        choice = self.compare(observation, state, total, among)
        if not choice.improves(self.hysteresis.required_percent):
            here = choice.kept_ap_percent
            held = self.held(state, factor, choice)
            action = Action.HOLD if held == self.ordered(state) else Action.MOVE
            return Decision(held, action, f"AP {here:.1f} % expected; no split promises clearly more", here)
        reason = (
            f"noise {among.sigma_dn[choice.index]:.1f} DN and motion {among.motion_px[choice.index]:.1f} px expected"
            if choice.action is Action.MOVE
            else "nothing was measured at any split; nearest to the measured region"
        )
        return Decision(choice.state, choice.action, reason, choice.ap_percent)
