"""Settings that never change: the paper's "fixed parameters"."""

from __future__ import annotations

from pipeline.control.decision import Action, Decision
from pipeline.control.observation import Observation
from pipeline.control.performance import Performance
from pipeline.control.policy import ControlledCamera, Policy
from pipeline.control.state import CameraState


class Fixed(Policy):
    """Holds one state.

    Args:
        camera: see `Policy`.
        performance: not used.
        exposure_ms: exposure time.
        iso: gain as ISO; the nearest steps of the camera are taken.

    Raises:
        InputError: not finite numbers above 0, or outside the camera's limits.
    """

    def __init__(
        self,
        camera: ControlledCamera,
        performance: Performance | None = None,
        exposure_ms: float = 8.0,
        iso: float = 100.0,
    ) -> None:
        super().__init__(camera, performance)
        self.state = self.limits.stepped(CameraState.of(exposure_ms, iso), "policy Fixed")

    def decide(self, observation: Observation, state: CameraState) -> Decision:
        """The fixed state."""
        action = Action.HOLD if state == self.state else Action.MOVE
        return Decision(self.state, action, "fixed settings")
