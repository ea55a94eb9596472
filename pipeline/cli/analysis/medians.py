"""Medians over frames; where more are without an estimate than with one, those that have one do not stand for all."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from statistics import median
from typing import Any

from pipeline.cli.analysis.rows import NOISE, NOISE_PARTS


def median_mtf(rows: Sequence[dict[str, Any]], column: str = "mtf") -> Any:
    """(2, 8) median MTF of the frames that have one; NaN where most have none.

    Args:
        rows: of frames.
        column: ``mtf``, or ``mtf_low`` and ``mtf_high`` for the ends of its interval.
    """
    import numpy as np

    curves = np.array([row[column] for row in rows], dtype=float)
    known = curves[np.isfinite(curves).all(axis=(1, 2))]
    return np.median(known, axis=0) if 2 * len(known) >= max(len(rows), 1) else np.full((2, 8), np.nan)


def noise_mostly_unknown(rows: Sequence[dict[str, Any]]) -> bool:
    """Whether the noise of more frames is unknown than known.

    Those that have an estimate are then no sample of them: behind a codec the noisiest, of bright frames the darkest.
    """
    return 2 * sum(isfinite(row["sigma_dn"]) for row in rows) < len(rows)


def median_noise(rows: Sequence[dict[str, Any]]) -> tuple[float, float, float]:
    """Medians of the frames' noise, of the upper ends of its intervals, and of what there is at most, DN.

    Args:
        rows: of frames.

    Returns:
        NaN where no frame has one; of noise and intervals also where `noise_mostly_unknown`, of bounds where
        `bounded_median` has none.
    """
    sigma, high = (known_median(row[name] for row in rows) for name in NOISE[:2])
    at_most = bounded_median(rows, NOISE[2], float("inf"))
    return (float("nan"), float("nan"), at_most) if noise_mostly_unknown(rows) else (sigma, high, at_most)


def median_noise_parts(rows: Sequence[dict[str, Any]]) -> tuple[float, float]:
    """Medians of the white part of the frames' noise, DN, and of its correlation between neighbours.

    Args:
        rows: of frames.

    Returns:
        NaN where no frame has one, or `noise_mostly_unknown`.
    """
    if noise_mostly_unknown(rows):
        return float("nan"), float("nan")
    white, correlation = (known_median(row[name] for row in rows) for name in NOISE_PARTS)
    return white, correlation


def bounded_median(rows: Sequence[dict[str, Any]], column: str, worst: float) -> float:
    """Median of a bound that frames have; those without one count as the worst that it could be.

    Args:
        rows: of frames.
        column: of the bound.
        worst: infinite, with the sign of what the bound excludes.

    Returns:
        NaN unless more than half of the frames, and of those without an estimate of noise, have a bound: the few that
        have one are no sample of the others.
    """
    without = [row for row in rows if not isfinite(row["sigma_dn"])]
    for part in (rows, without):
        if part and 2 * sum(isfinite(row[column]) for row in part) <= len(part):
            return float("nan")
    return float(median([row[column] if isfinite(row[column]) else worst for row in rows]))


def median_precision(rows: Sequence[dict[str, Any]]) -> float:
    """Median of the expected AP of the frames, percent; NaN where none has one, or `noise_mostly_unknown`."""
    return float("nan") if noise_mostly_unknown(rows) else known_median(row["ap_percent"] for row in rows)


def directed_shares(rows: Sequence[dict[str, Any]]) -> tuple[float, float]:
    """Shares of the blurred frames that are blurred mainly horizontally, and mainly vertically; 0 without any."""
    from pipeline.condition.verdict import AXES, SHARP

    directions = [row["blur_direction"] for row in rows if row["blur"] not in ("", SHARP)]
    horizontal, vertical = (directions.count(axis) / max(len(directions), 1) for axis in AXES)
    return horizontal, vertical


def known_median(values: Any) -> float:
    """Median of the values that are known; NaN where none is."""
    known = [float(value) for value in values if isfinite(value)]
    return median(known) if known else float("nan")
