"""What every policy has: the camera it controls, the surface it may ask, and one method."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

from pipeline.camera.exposure import Camera
from pipeline.control.decision import Decision
from pipeline.control.observation import Observation
from pipeline.control.options import check_number
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


class Policy(ABC):
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

    @classmethod
    def check(cls, name: str, value: object, expected: str, accepts: Callable[[float], bool]) -> None:
        """Refuses an option that is no number in its range; see `check_number`."""
        check_number(f"policy {cls.__name__}", name, value, expected, accepts)

    @property
    def performance(self) -> Performance:
        """The surface; only for policies that declare ``needs_surface``."""
        assert self._performance is not None
        return self._performance

    @abstractmethod
    def decide(self, observation: Observation, state: CameraState) -> Decision:
        """Settings for the next frame.

        Args:
            observation: the last frame.
            state: settings it was taken with.

        Returns:
            settings that the camera can have; see `decided`.
        """


def decided(policy: Policy, observation: Observation, state: CameraState, limits: Limits) -> Decision:
    """A policy's decision, checked before a camera gets its settings.

    Args:
        policy: asked.
        observation: the last frame.
        state: settings it was taken with.
        limits: what the camera accepts.

    Returns:
        the decision: settings that the camera accepts, or those of the frame kept.

    Raises:
        InputError: no decision, or settings that the camera cannot have.
    """
    decision: object = policy.decide(observation, state)
    name = f"policy '{type(policy).__name__}'"
    if not (isinstance(decision, Decision) and isinstance(decision.state, CameraState)):
        raise InputError(
            f"{name}: decide returned {type(decision).__name__}, expected pipeline.control.decision.Decision "
            "with a CameraState"
        )
    if not (limits.accepts(decision.state) or _keeps(decision.state, state, limits)):
        nearest = limits.nearest(decision.state.exposure_s, decision.state.gain)
        raise InputError(
            f"{name}: decided on {_in_words(decision.state)}, which the camera cannot have, expected settings inside "
            f"its limits and on its steps, here {_in_words(nearest)}; self.limits.nearest and self.limits.at_time give "
            "such"
        )
    return decision


def _keeps(new: CameraState, state: CameraState, limits: Limits) -> bool:
    """Whether settings are those of the frame, but for a driver's rounding, and no farther outside the limits."""
    return new.is_nearly(state) and all(
        min(least, now) <= value <= max(most, now)
        for value, now, least, most in (
            (new.exposure_s, state.exposure_s, limits.exposure_min_s, limits.exposure_max_s),
            (new.gain, state.gain, limits.gain_min, limits.gain_max),
        )
    )


def _in_words(state: CameraState) -> str:
    return f"{state.exposure_ms:.6g} ms at ISO {state.iso:.6g}"
