"""What a policy sees of one frame: its statistics, and estimates of noise and MTF with intervals. Never the truth."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.control.state import CameraState
from pipeline.errors import InputError

if TYPE_CHECKING:
    from pipeline.condition import Condition, ConditionMonitor

SATURATED_LEVEL = 0.99
"""Encoded grey level from which a pixel counts as saturated."""

_RANGE_SLACK = 1e-6  # float32 rounding of 1.0

Floats = NDArray[np.float64]


class Estimate(NamedTuple):
    """A value with its 95 % interval; scalars, or arrays of one shape. NaN ends where the estimator has none."""

    value: Floats
    low: Floats
    high: Floats


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
        mean_level: mean grey level, 0..1, encoded.
        saturated_fraction: fraction of pixels at white.
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
        """Whether noise or MTF is missing."""
        return self.sigma_dn is None or self.mtf is None


def observe(
    image: NDArray[np.floating],
    monitor: ConditionMonitor | None = None,
    condition: Condition | None = None,
    truth: Callable[[CameraState], Outcome] | None = None,
) -> Observation:
    """Statistics and estimates of a frame; policies rely on its range, whether it is estimated or not.

    Args:
        image: (H, W) float in [0, 1], encoded.
        monitor: estimates noise and MTF; None leaves them out.
        condition: estimates that were made already.
        truth: for the oracle.

    Raises:
        InputError: not (H, W) in [0, 1], or the monitor refuses the frame.
    """
    frame = np.asarray(image, dtype=np.float32)
    if frame.ndim != 2 or not frame.size:
        raise InputError(f"frame: expected (H, W), grey, not shape {frame.shape}")
    low, high = float(frame.min()), float(frame.max())  # both carry NaN on
    if not (low >= -_RANGE_SLACK and high <= 1.0 + _RANGE_SLACK):
        spans = "holds NaN" if math.isnan(low) else f"spans {low:g} .. {high:g}"
        raise InputError(f"frame: {spans}; expected floats in [0, 1]; divide 8-bit frames by 255")
    sigma = mtf = None
    reason = "no estimator"
    if condition is None and monitor is not None:
        condition = monitor.frame(frame)
    if condition is not None:
        sigma, mtf = estimates(condition)
        parts = [
            f"{name}: {', '.join(why) or 'no estimate'}"
            for name, why in condition.reasons.items()
            if condition.abstained[name]
        ]
        reason = "; ".join(parts)
    return Observation(
        image=frame,
        mean_level=float(frame.mean(dtype=np.float64)),
        saturated_fraction=float(np.mean(frame >= SATURATED_LEVEL)),
        sigma_dn=sigma,
        mtf=mtf,
        reason=reason,
        truth=truth,
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
