"""Cells that do better than they should: average precision that rises where noise or blur grows.

The paper marks such cells, for a controller that climbs a curve step by step can be caught there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

ROUNDING_PERCENT = 1e-9
"""Smaller differences are rounding, as of means over directions that are all alike, and no rise."""


def rises(ap_percent: Floats, axis: int, tolerance: float = 0.0) -> NDArray[np.bool_]:
    """Cells above the nearest cell before them that has a value.

    Args:
        ap_percent: any shape; NaN is an empty cell. Along the axis the condition grows worse.
        axis: along which to compare.
        tolerance: rises up to this are none, percent points.

    Returns:
        the same shape; never true for an empty cell or the first one.
    """
    ahead = np.moveaxis(np.asarray(ap_percent, dtype=float), axis, 0)
    before = previous(ahead)
    with np.errstate(invalid="ignore"):
        marked = ahead - before > tolerance + ROUNDING_PERCENT
    return np.moveaxis(marked, 0, axis)


def rise_z(ap_percent: Floats, draws: Floats, axis: int, tolerance: float = 0.0) -> Floats:
    """Rise of a cell above the nearest one before it, in standard errors.

    Args:
        ap_percent: (...) NaN for an empty cell.
        draws: (B, ...) bootstrap draws of the same.
        axis: of the cells, not counting that of the draws.
        tolerance: rises up to this are none, percent points.

    Returns:
        (...): (rise - tolerance) / standard deviation of the drawn rises; infinite where the draws are all alike, NaN
        where the values are so too, for an empty cell, the first one, and cells without draws.
    """
    ahead = np.moveaxis(np.asarray(ap_percent, dtype=float), axis, 0)
    drawn = np.moveaxis(np.asarray(draws, dtype=float), axis + 1, 0)  # (along, B, ...)
    with np.errstate(invalid="ignore", divide="ignore"):
        excess, scatter = ahead - previous(ahead) - tolerance, (drawn - previous(drawn)).std(axis=1)
        excess, scatter = (np.where(np.abs(part) <= ROUNDING_PERCENT, 0.0, part) for part in (excess, scatter))
        z = excess / scatter
    return np.moveaxis(z, 0, axis)


def previous(ahead: Floats) -> Floats:
    """For each entry along the first axis, the last finite one before it; NaN where there is none."""
    result = np.full_like(ahead, np.nan)
    for i in range(1, len(ahead)):
        result[i] = np.where(np.isfinite(ahead[i - 1]), ahead[i - 1], result[i - 1])
    return result
