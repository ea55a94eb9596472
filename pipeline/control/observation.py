"""What a policy sees of one frame: its statistics, and estimates of noise and MTF with intervals. Never the truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.condition.grey_frame import grey_frame
from pipeline.condition.picture_area import DARK_DN, picture_area, picture_circle
from pipeline.control.state import CameraState

if TYPE_CHECKING:
    from pipeline.condition import Condition, ConditionMonitor

WHITE_LEVEL = 0.99
"""Encoded grey level from which a pixel counts as white."""

Floats = NDArray[np.float64]


class Estimate(NamedTuple):
    """A value with its 95 % interval; scalars, or arrays of one shape. NaN ends where the estimator has none."""

    value: Floats
    low: Floats
    high: Floats


class Brightness(NamedTuple):
    """Mean encoded grey level and fraction of pixels at white, both 0..1, of the picture without bars and surround."""

    mean_level: float
    saturated_fraction: float


class Outcome(NamedTuple):
    """True condition at some settings: noise in DN, motion blur in pixels, mean encoded level."""

    sigma_dn: float
    motion_px: float
    mean_level: float


@dataclass(frozen=True, eq=False)
class Observation:
    """One frame as a policy sees it.

    Attributes:
        image: (H, W) float32 in [0, 1], encoded.
        mean_level: mean grey level, 0..1, encoded; see `brightness`.
        saturated_fraction: fraction of pixels at white; likewise.
        sigma_dn: noise, DN; None where the estimator abstained or was not asked.
        mtf: (2, 8) system MTF; None likewise.
        reason: why estimates are missing.
        truth: true condition at any settings; only given to policies that declare ``sees_truth``.
    """

    image: NDArray[np.float32]
    mean_level: float
    saturated_fraction: float
    sigma_dn: Estimate | None = None
    mtf: Estimate | None = None
    reason: str = ""
    truth: Callable[[CameraState], Outcome] | None = None

    @property
    def abstained(self) -> bool:
        """Whether noise or MTF is missing, or no finite number."""
        return any(part is None or not np.isfinite(part.value).all() for part in (self.sigma_dn, self.mtf))


def observe(
    image: NDArray[np.floating], monitor: ConditionMonitor | None = None, condition: Condition | None = None
) -> Observation:
    """Statistics and estimates of a frame; policies rely on its range, whether it is estimated or not.

    Args:
        image: (H, W) float in [0, 1], encoded, NumPy or torch.
        monitor: estimates noise and MTF; None leaves them out.
        condition: estimates that were made already.

    Raises:
        InputError: not (H, W) floats in [0, 1], or the monitor refuses the frame.
    """
    frame = grey_frame(image)
    sigma = mtf = None
    reason = "no estimator"
    if condition is None and monitor is not None:
        condition = monitor.frame(frame)
    if condition is not None:
        (sigma, mtf), reason = estimates(condition), abstention_reason(condition)
    return Observation(frame, *brightness(frame), sigma, mtf, reason)


def brightness(frame: NDArray[np.floating]) -> Brightness:
    """Brightness of the picture that a frame shows, without bars and surrounds, which no exposure changes.

    Lines of one level at one border of the frame are bars where they are as dark as those of letterboxes; brighter ones
    count as picture unless they are certain (`pipeline.condition.picture_area`): in a frame exposed too long, whole
    lines of sky are uniform, at whatever level the camera clips.

    Args:
        frame: (H, W) in [0, 1], encoded.
    """
    first_is_dark, last_is_dark = (corner <= DARK_DN / FULL_SCALE_DN for corner in (frame[0, 0], frame[-1, -1]))
    picture = frame[
        tuple(
            slice((any_bar if first_is_dark else certain).start, (any_bar if last_is_dark else certain).stop)
            for any_bar, certain in zip(picture_area(frame), picture_area(frame, certain=True), strict=True)
        )
    ]
    circle = picture_circle(picture)
    if circle is not None:
        picture = picture[circle]
    return Brightness(float(picture.mean(dtype=np.float64)), float(np.mean(picture >= WHITE_LEVEL)))


def abstention_reason(condition: Condition) -> str:
    """Why noise or MTF of a monitor's answer is missing, in words; empty where neither is."""
    return "; ".join(
        f"{name}: {', '.join(words) or 'no estimate'}"
        for name, words in condition.reasons.items()
        if condition.abstained[name]
    )


def estimates(condition: Condition) -> tuple[Estimate | None, Estimate | None]:
    """Noise and MTF of a monitor's answer; None where it abstained."""
    pairs = ((condition.sigma_dn, "noise"), (condition.mtf, "blur"))
    sigma, mtf = (
        None
        if condition.abstained[name]
        else Estimate(
            np.asarray(part.value, dtype=np.float64),
            np.asarray(part.low, dtype=np.float64),
            np.asarray(part.high, dtype=np.float64),
        )
        for part, name in pairs
    )
    return sigma, mtf
