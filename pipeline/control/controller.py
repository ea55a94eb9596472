"""Estimator and policy as one step from a frame to settings, and the loop around a camera's driver."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pipeline.control.decision import Decision
from pipeline.control.driver import Driver
from pipeline.control.observation import observe
from pipeline.control.policy import Policy, decided
from pipeline.control.state import CameraState
from pipeline.errors import InputError

if TYPE_CHECKING:
    from pipeline.condition import ConditionMonitor


class Controller:
    """Observes a frame and lets a policy decide.

    Args:
        policy: see `pipeline.control.create`.
        monitor: estimates noise and MTF; None opens the default one, if the policy uses estimates.

    Raises:
        InputError: the policy needs the truth, which only the simulator has.
    """

    def __init__(self, policy: Policy, monitor: ConditionMonitor | None = None) -> None:
        if policy.sees_truth:
            raise InputError("controller: this policy needs the truth and runs in the simulated loop only")
        if policy.uses_estimates and monitor is None:
            from pipeline.condition import ConditionMonitor

            monitor = ConditionMonitor()
        self.policy, self.monitor = policy, monitor

    def step(self, frame: NDArray[np.floating], state: CameraState) -> Decision:
        """Settings for the next frame.

        Args:
            frame: (H, W) float in [0, 1], grey, encoded, NumPy or torch.
            state: settings it was taken with.

        Raises:
            InputError: not such a frame, or the policy decides on settings that its camera cannot have.
        """
        observation = observe(frame, self.monitor if self.policy.uses_estimates else None)
        return decided(self.policy, observation, state, self.policy.limits)

    def run(self, driver: Driver, frames: int) -> Iterator[Decision]:
        """Control a camera for some frames.

        Args:
            driver: the camera.
            frames: how many.

        Yields:
            the decision after each frame, applied already.
        """
        for _ in range(frames):
            frame = driver.capture()
            decision = self.step(frame, driver.settings())
            driver.apply(decision.state)
            yield decision
