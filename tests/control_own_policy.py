"""A policy of a third party, as README shows one."""

from pipeline.control.decision import Action, Decision
from pipeline.control.policy import Policy


class HalfSpeed(Policy):
    """Shortens every exposure by a factor and raises the gain by it."""

    def __init__(self, camera, performance=None, factor=0.5):
        super().__init__(camera, performance)
        self.factor = factor

    def decide(self, observation, state):
        new = self.limits.at_time(state.total_exposure_s, state.exposure_s * self.factor)
        return Decision(new, Action.MOVE, "shorter")
