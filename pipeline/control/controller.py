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
        codec: of the camera's stream, by FFmpeg's name or its four-character code, e.g. ``"h264"``, for frames of which
            neither `step` nor the driver states it; empty where there is none. Codecs hide noise, which is not
            estimated then (`pipeline.condition.video_codecs`).

    Raises:
        InputError: the policy needs the truth, which only the simulator has.
    """

    def __init__(self, policy: Policy, monitor: ConditionMonitor | None = None, codec: str = "") -> None:
        if policy.sees_truth:
            raise InputError("controller: this policy needs the truth and runs in the simulated loop only")
        if policy.uses_estimates and monitor is None:
            from pipeline.condition import ConditionMonitor

            monitor = ConditionMonitor()
        self.policy, self.monitor, self.codec = policy, monitor, codec

    def step(
        self, frame: NDArray[np.floating], state: CameraState, codec: str = "", quantiser: int | None = None
    ) -> Decision:
        """Settings for the next frame.

        Args:
            frame: (H, W) float in [0, 1], grey, encoded, NumPy or torch.
            state: settings it was taken with.
            codec: that it was stored by; empty for that of the stream.
            quantiser: how coarsely that quantised it, where it is known (`pipeline.datasets.decoding.video_coding`).

        Raises:
            InputError: not such a frame or codec, or the policy decides on settings that its camera cannot have.
        """
        condition = None
        if self.monitor is not None and self.policy.uses_estimates:
            condition = self.monitor.frame(frame, codec or self.codec, quantiser)
        observation = observe(frame, condition=condition)
        return decided(self.policy, observation, state, self.policy.limits)

    def run(self, driver: Driver, frames: int) -> Iterator[Decision]:
        """Control a camera for some frames.

        Args:
            driver: the camera; a `CodedDriver` states how each frame was coded.
            frames: how many.

        Yields:
            the decision after each frame, applied already.

        Raises:
            InputError: see `step`, or the driver's coding is none.
        """
        for _ in range(frames):
            frame = driver.capture()
            decision = self.step(frame, driver.settings(), *_coding(driver))
            driver.apply(decision.state)
            yield decision


def _coding(driver: Driver) -> tuple[str, int | None]:
    """Codec and quantiser of the frame captured last; empty and None where the driver does not state them."""
    coding = getattr(driver, "coding", None)
    if coding is None:
        return "", None
    if not (hasattr(coding, "codec") and hasattr(coding, "quantiser")):
        raise InputError(f"driver: coding is {coding!r}; expected a pipeline.datasets.decoding.video_coding.Coding")
    return coding.codec, coding.quantiser
