"""What every policy has: the camera it controls, the surface it may ask, and one method."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

from pipeline.camera.exposure import Camera
from pipeline.control.decision import Decision
from pipeline.control.observation import Observation
from pipeline.control.performance import Performance
from pipeline.control.state import CameraState, Limits
from pipeline.errors import InputError


@dataclass(frozen=True)
class ControlledCamera:
    """A camera as policies know it.

    Attributes:
        limits: settings it accepts.
        formation: its sensor and tone curve, for predicting noise at other settings.
    """

    limits: Limits = field(default_factory=Limits)
    formation: Camera = field(default_factory=Camera)


class Policy:
    """Base class of policies; a subclass implements `decide` and may keep a memory of earlier frames.

    Args:
        camera: the camera controlled.
        performance: surface of average precision; needed where ``needs_surface``.

    Raises:
        InputError: the surface is missing.
    """

    uses_estimates: ClassVar[bool] = False
    needs_surface: ClassVar[bool] = False
    sees_truth: ClassVar[bool] = False

    def __init__(self, camera: ControlledCamera, performance: Performance | None = None) -> None:
        if self.needs_surface and performance is None:
            raise InputError(
                f"policy '{type(self).__name__}' needs a surface of average precision; run the stage control_surface"
            )
        self.camera, self.limits = camera, camera.limits
        self._performance = performance

    @property
    def performance(self) -> Performance:
        """The surface; only for policies that declare ``needs_surface``."""
        assert self._performance is not None
        return self._performance

    def decide(self, observation: Observation, state: CameraState) -> Decision:
        """Settings for the next frame.

        Args:
            observation: the last frame.
            state: settings it was taken with.
        """
        raise NotImplementedError
