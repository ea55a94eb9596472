"""Average precision that a detector is expected to reach in an estimated condition, and at best.

The surface of `pipeline.control.performance` has its MTF axis at one low frequency, reached through the length L of
linear motion. Here the length whose MTF at that frequency equals the estimated one is looked up, so that any kind of
blur is answered by the contrast that it leaves. An MTF above that of the surface's sharp frames counts as sharp, noise
below the least measured as that; a condition outside of the measured range gives NaN.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.control.motion import motion_mtf
from pipeline.control.performance import Performance

LENGTH_STEP_PX = 0.1


class ExpectedPrecision(NamedTuple):
    """Percent; NaN where nothing was measured.

    Attributes:
        ap_percent: average precision expected.
        low_percent, high_percent: ends of its 95 % interval.
        best_percent: average precision of sharp frames with the least noise, of the same brightness.
    """

    ap_percent: float
    low_percent: float
    high_percent: float
    best_percent: float


def expected_precision(
    performance: Performance,
    sigma_dn: float,
    mtf: NDArray[np.floating],
    *,
    relative: bool = False,
    level: float | None = None,
) -> ExpectedPrecision:
    """Average precision expected in a condition.

    Args:
        performance: measured surface of a detector.
        sigma_dn: noise as the monitor estimates it, DN; NaN where unknown.
        mtf: (2, 8) MTF, horizontal and vertical; NaN where unknown.
        relative: whether the MTF is relative to the camera's sharp frames; it is then multiplied by that of the
            surface's sharp frames.
        level: mean encoded grey level of the frame, 0..1; one above the brightest measured counts as that. None does
            not regard it.
    """
    curves = np.asarray(mtf, dtype=np.float64) * (performance.reference if relative else 1.0)
    length_px = equivalent_motion(performance, float(curves[:, performance.frequency_index].mean()))
    return expected_at(performance, sigma_dn, length_px, level)


def expected_at(
    performance: Performance, sigma_dn: float, motion_px: float, level: float | None = None
) -> ExpectedPrecision:
    """Average precision expected at a length of linear motion.

    Args:
        performance: measured surface of a detector.
        sigma_dn: noise as the monitor estimates it, DN; NaN where unknown.
        motion_px: length of the motion; NaN where unknown.
        level: see `expected_precision`.
    """
    bright = None if level is None else min(level, performance.level)
    best = float(performance.expected(0.0, 0.0, bright).ap_percent)
    true_sigma_dn = performance.true_sigma_dn(sigma_dn, bright) if np.isfinite(sigma_dn) else sigma_dn
    here = performance.expected(true_sigma_dn, motion_px, bright)
    return ExpectedPrecision(float(here.ap_percent), float(here.low), float(here.high), best)


def interval_between(here: ExpectedPrecision, worst: ExpectedPrecision, best: ExpectedPrecision) -> tuple[float, float]:
    """Interval of the average precision where noise or blur is uncertain, percent.

    Args:
        here: expected in the estimated condition.
        worst: with the most noise and blur that there may be.
        best: with the least.

    Returns:
        lower end of the worst and upper end of the best. The lower end is 0 where the worst is beyond what was measured
        but the estimate is not.
    """
    beyond = np.isnan(worst.ap_percent) and np.isfinite(here.ap_percent)
    return 0.0 if beyond else worst.low_percent, best.high_percent


def equivalent_motion(performance: Performance, contrast: float) -> float:
    """Length of horizontal motion that leaves a contrast at the surface's frequency, px.

    Args:
        performance: the surface.
        contrast: MTF at its frequency, mean of horizontal and vertical.

    Returns:
        0 for a contrast of sharp frames or above; NaN below the longest motion's, and for NaN.
    """
    lengths = np.arange(0.0, performance.longest_px + LENGTH_STEP_PX / 2, LENGTH_STEP_PX)
    curve = motion_mtf(lengths, performance.reference, performance.frequency_index)
    falling = np.minimum.accumulate(curve)
    if not contrast >= falling[-1]:
        return float("nan")
    return float(np.interp(-contrast, -falling, lengths))
