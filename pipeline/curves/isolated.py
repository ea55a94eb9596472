"""One effect at a time: average precision over noise alone, or over blur alone (the paper's isolated curves)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.curves.cells import BRIDGE_BINS, Cells, bin_borders, precision_interval
from pipeline.curves.monotonic import rises
from pipeline.errors import InputError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Curve:
    """Average precision over one quantity; K points, rising in it.

    Attributes:
        quantity: ``"sigma_dn"`` or ``"mtf"``.
        at: (K,) mean noise or MTF of the tuples of each bin.
        ap_percent: (K,).
        low, high: (K,) bootstrap 95 % interval; NaN where unknown.
        count: (K,) tuples.
        non_monotonic: (K,) better than at the next less noisy or less blurred point.
        draws: (B, K) bootstrap.
        edges: (K, 2) ends of each point's bin, as far as it speaks for its surroundings.
        joined: (K - 1,) whether the curve goes on to the next point, or too many bins between them are empty.
        scenes: see `pipeline.curves.cells.precision_interval`.
    """

    quantity: str
    at: Floats
    ap_percent: Floats
    low: Floats
    high: Floats
    count: NDArray[np.int64]
    non_monotonic: NDArray[np.bool_]
    draws: Floats
    edges: Floats
    joined: NDArray[np.bool_]
    scenes: int | None = None

    def query(self, value: float) -> tuple[float, float, float]:
        """Average precision and its interval, linear between points.

        Raises:
            InputError: below 0, outside of the measured range by more than half a bin, or in a gap of empty bins.
        """
        if not np.isfinite(value):
            raise InputError(f"{self.quantity}: expected a number, not {value!r}")
        if value < 0:
            raise InputError(f"{self.quantity} {value:g}: expected a number of at least 0")
        if not self.edges[0, 0] <= value <= self.edges[-1, 1]:
            raise InputError(
                f"{self.quantity} {value:g} is outside of what was measured, {self.at[0]:g} .. {self.at[-1]:g};"
                " it is not extrapolated"
            )
        right = int(np.searchsorted(self.at, value))
        left = right - 1
        if left < 0 or right == len(self.at):
            weights = {min(right, len(self.at) - 1): 1.0}  # beyond the outermost point, within its bin
        elif self.joined[left]:
            share = float((value - self.at[left]) / (self.at[right] - self.at[left]))
            weights = {left: 1.0 - share, right: share}
        elif value <= self.edges[left, 1]:
            weights = {left: 1.0}
        elif value >= self.edges[right, 0]:
            weights = {right: 1.0}
        else:
            raise InputError(
                f"{self.quantity} {value:g} lies in a gap between {self.at[left]:g} and {self.at[right]:g}, where"
                " nothing was measured"
            )
        used, shares = list(weights), np.array(list(weights.values()))
        precision = float(self.ap_percent[used] @ shares)
        return precision, *precision_interval(self.draws[:, used] @ shares, precision, self.scenes)


def isolated(cells: Cells, quantity: str, tolerance: float = 0.0, scenes: int | None = None) -> Curve:
    """The curve through the bins without the other effect: those of the highest MTF, or of the lowest noise.

    Args:
        cells: binned tuples.
        quantity: ``"sigma_dn"`` or ``"mtf"``, the axis of the curve.
        tolerance: see `pipeline.curves.monotonic.rises`.
        scenes: see `pipeline.curves.cells.precision_interval`.

    Raises:
        InputError: an unknown quantity, or no tuple without the other effect.
    """
    along_sigma = quantity == "sigma_dn"
    if quantity not in ("sigma_dn", "mtf"):
        raise InputError(f"quantity: expected sigma_dn or mtf, not {quantity!r}")
    pick = (slice(None), -1) if along_sigma else (0, slice(None))
    centres = cells.sigma_bins_dn if along_sigma else cells.mtf_bins
    position = (cells.sigma_dn if along_sigma else cells.mtf)[pick]
    full = np.flatnonzero(cells.count[pick] > 0)
    if not len(full):
        without = f"MTF bin {cells.mtf_bins[-1]:g}" if along_sigma else f"noise bin {cells.sigma_bins_dn[0]:g}"
        raise InputError(f"no tuple lies in the {without}")
    precision, (low, high) = cells.ap_percent[pick], cells.interval(scenes)
    worse = rises(precision if along_sigma else precision[::-1], 0, tolerance)
    worse = worse if along_sigma else worse[::-1]
    borders = bin_borders(centres)
    return Curve(
        quantity=quantity,
        at=position[full],
        ap_percent=precision[full],
        low=low[pick][full],
        high=high[pick][full],
        count=cells.count[pick][full],
        non_monotonic=worse[full],
        draws=cells.draws[:, *pick][:, full],
        edges=np.stack([borders[full], borders[full + 1]], axis=1),
        joined=np.diff(full) <= 1 + BRIDGE_BINS,
        scenes=scenes,
    )
