"""Average precision by direction of motion blur, its length, and noise (the paper's supplement).

A detector suffers from motion along one direction more than along another, since objects are longer one way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.curves.monotonic import rises
from pipeline.errors import InputError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Directions:
    """The table; S noise levels, A angles, D lengths. Missing cells are NaN.

    Attributes:
        sigma_dn: (S,) rising.
        angle_deg: (A,) rising.
        size_px: (D,) rising.
        ap_percent: (S, A, D).
        rises_with_size: (S, A, D) better than with the next shorter blur.
        rises_with_sigma: (S, A, D) better than at the next lower noise.
    """

    sigma_dn: Floats
    angle_deg: Floats
    size_px: Floats
    ap_percent: Floats
    rises_with_size: NDArray[np.bool_]
    rises_with_sigma: NDArray[np.bool_]

    @property
    def non_monotonic(self) -> NDArray[np.bool_]:
        """(S, A, D) better than with less blur or with less noise."""
        return self.rises_with_size | self.rises_with_sigma

    @property
    def spread_percent(self) -> Floats:
        """(S, D) best less worst direction, percent points; NaN where a direction is missing."""
        spread: Floats = self.ap_percent.max(axis=1) - self.ap_percent.min(axis=1)
        return spread

    @property
    def worst_angle_deg(self) -> Floats:
        """(S, D) direction with the lowest average precision; NaN where a direction is missing."""
        known = np.isfinite(self.spread_percent)
        filled = np.where(np.isfinite(self.ap_percent), self.ap_percent, np.inf)
        return np.where(known, self.angle_deg[np.argmin(filled, axis=1)], np.nan)

    @property
    def mean_percent(self) -> Floats:
        """(S, D) mean over directions, as the paper's blur curves take it; NaN where a direction is missing."""
        mean: Floats = self.ap_percent.mean(axis=1)
        return mean


def by_direction(
    sigma_dn: ArrayLike, angle_deg: ArrayLike, size_px: ArrayLike, ap_percent: ArrayLike, tolerance: float = 0.0
) -> Directions:
    """Arrange measurements by noise, direction and length.

    Args:
        sigma_dn: (n,).
        angle_deg: (n,).
        size_px: (n,).
        ap_percent: (n,) 0..100, or NaN.
        tolerance: rises up to this, in percent points, are not marked.

    Raises:
        InputError: lengths differ, there is none, a setting is not finite, an average precision is out of range, or a
            setting occurs twice.
    """
    columns = [np.asarray(values, dtype=float) for values in (sigma_dn, angle_deg, size_px, ap_percent)]
    if any(column.ndim != 1 or column.shape != columns[0].shape for column in columns) or not len(columns[0]):
        shapes = ", ".join(str(column.shape) for column in columns)
        raise InputError(f"sigma_dn, angle_deg, size_px, ap_percent: expected lists of one length, not shapes {shapes}")
    if not all(np.isfinite(column).all() for column in columns[:3]):
        raise InputError("sigma_dn, angle_deg, size_px: expected finite numbers")
    precision = columns[3]
    if ((precision < 0) | (precision > 100)).any():
        raise InputError("ap_percent: expected numbers in 0..100")
    levels, positions = zip(*(np.unique(column, return_inverse=True) for column in columns[:3]), strict=True)
    table = np.full([len(level) for level in levels], np.nan)
    flat = np.ravel_multi_index(positions, table.shape)
    values, counts = np.unique(flat, return_counts=True)
    if (counts > 1).any():
        s, a, d = np.unravel_index(values[counts > 1][0], table.shape)
        raise InputError(
            f"sigma {levels[0][s]:g} DN, angle {levels[1][a]:g} deg, size {levels[2][d]:g} px occurs more than once"
        )
    table.flat[flat] = precision
    sigmas, angles, sizes = levels
    return Directions(sigmas, angles, sizes, table, rises(table, 2, tolerance), rises(table, 0, tolerance))
