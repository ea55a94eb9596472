"""Tuples (sigma~, MTF~, AP) gathered in bins, with a bootstrap.

The paper measures, for each corruption, the average precision of a detector, and the median noise and MTF that the
estimators report for the same frames; the tuples are gathered in bins of noise (0, 5, .. 25 DN) and MTF (0.1, 0.2, ..
1). A tuple belongs to the nearest bin. A bin's average precision is the mean of its tuples; its place is their mean
noise and MTF, which need not be the bin's centre.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.cluster_intervals import bias_corrected
from pipeline.errors import InputError

Floats = NDArray[np.float64]

SIGMA_BINS_DN: tuple[float, ...] = (0.0, 5.0, 10.0, 15.0, 20.0, 25.0)
MTF_BINS: tuple[float, ...] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
BRIDGE_BINS = 1
"""Empty bins in a row that are interpolated over: five sizes of blur do not fill ten bins of MTF."""


@dataclass(frozen=True)
class Cells:
    """Binned tuples; S noise bins, M MTF bins. Empty bins are NaN with a count of 0.

    Attributes:
        sigma_bins_dn: (S,) centres, rising.
        mtf_bins: (M,) centres, rising.
        count: (S, M) tuples.
        sigma_dn: (S, M) mean noise of the tuples.
        mtf: (S, M) mean MTF of the tuples.
        ap_percent: (S, M) mean average precision.
        draws: (B, S, M) bootstrap of the same; NaN where the uncertainty of a bin is unknown.
        left_out: tuples that had a NaN, or lay more than half a bin beyond the outermost bins.
    """

    sigma_bins_dn: Floats
    mtf_bins: Floats
    count: NDArray[np.int64]
    sigma_dn: Floats
    mtf: Floats
    ap_percent: Floats
    draws: Floats
    left_out: int

    def interval(self, scenes: int | None = None) -> tuple[Floats, Floats]:
        """Ends of the bootstrap 95 % interval of each bin, (S, M) each; see `precision_interval`."""
        ends = np.full((2, *self.count.shape), np.nan)
        for at in zip(*np.nonzero(self.count), strict=True):
            ends[(slice(None), *at)] = precision_interval(self.draws[(slice(None), *at)], self.ap_percent[at], scenes)
        return ends[0], ends[1]


def precision_interval(draws: Floats, ap_percent: float, scenes: int | None = None) -> tuple[float, float]:
    """Ends of the bootstrap 95 % interval of an average precision.

    Args:
        draws: (B,) percent.
        ap_percent: the average precision itself.
        scenes: that the draws resample and that hold an object (`pipeline.cluster_intervals`); None where that is
            unknown, which gives plain quantiles.

    Returns:
        lower and upper end in percent. With `scenes`, draws that are NaN are left out, and the ends are NaN without any
        other draw or with fewer than two scenes; without, they are NaN where any draw is. Near 0 and 100 % intervals of
        few scenes are too narrow, and have no width where all draws are equal (`pipeline.cluster_intervals`).
    """
    if scenes is not None:
        return bias_corrected(draws, ap_percent, scenes, bounds=(0.0, 100.0))
    low, high = np.percentile(draws, [2.5, 97.5])
    return float(low), float(high)


def refuse_inconsistent(arrays: Mapping[str, NDArray[Any]], path: object) -> None:
    """Refuse arrays, read from a file, that are no bins.

    Args:
        arrays: by the names of the attributes of `Cells`.
        path: the file, for the message.

    Raises:
        InputError: an array is not of numbers or has another shape than the bins give it, bins do not rise, or a full
            bin has a noise, MTF or average precision that is not finite, or an average precision not in 0..100.
    """
    for name, values in arrays.items():
        if values.dtype.kind not in "iuf":
            raise InputError(f"{path}: array '{name}' holds {values.dtype}, expected numbers")
    rows, columns = arrays["sigma_bins_dn"], arrays["mtf_bins"]
    if rows.ndim != 1 or columns.ndim != 1:
        raise InputError(f"{path}: sigma_bins_dn {rows.shape} and mtf_bins {columns.shape}: expected two lists")
    shape = (len(rows), len(columns))
    expected: dict[str, tuple[int, ...]] = dict.fromkeys(("count", "sigma_dn", "mtf", "ap_percent"), shape)
    expected |= {"draws": (*arrays["draws"].shape[:1], *shape), "left_out": ()}
    for name, wanted in expected.items():
        if arrays[name].shape != wanted or 0 in wanted:
            raise InputError(f"{path}: array '{name}' has shape {arrays[name].shape}, expected {wanted}")
    for name in ("sigma_bins_dn", "mtf_bins"):
        if min(len(rows), len(columns)) < 2 or not (np.diff(arrays[name]) > 0).all():
            raise InputError(f"{path}: {name}: expected at least two rising bin centres")
    if not 0 <= float(arrays["left_out"]) < np.inf:
        raise InputError(f"{path}: array 'left_out' is {arrays['left_out']}, expected a count")
    full = arrays["count"] > 0
    for name in ("sigma_dn", "mtf", "ap_percent"):
        if not np.isfinite(arrays[name][full]).all():
            raise InputError(f"{path}: array '{name}' holds values that are not finite in full bins")
    for name, values in (("ap_percent", arrays["ap_percent"][full]), ("draws", arrays["draws"][:, full])):
        if ((values < 0) | (values > 100)).any():
            raise InputError(f"{path}: array '{name}' holds values out of range, expected 0..100")


def gather(
    sigma_dn: ArrayLike,
    mtf: ArrayLike,
    ap_percent: ArrayLike,
    generator: np.random.Generator,
    ap_draws: ArrayLike | None = None,
    draws: int = 500,
    sigma_bins_dn: ArrayLike = SIGMA_BINS_DN,
    mtf_bins: ArrayLike = MTF_BINS,
) -> Cells:
    """Gather tuples in bins.

    Args:
        sigma_dn: (n,) estimated noise; NaN leaves a tuple out.
        mtf: (n,) estimated MTF (mean of H and V at the second frequency).
        ap_percent: (n,) average precision, 0..100.
        generator: of the bootstrap.
        ap_draws: (n, B) each tuple's average precision on resampled frames, the same frames for all tuples. None
            resamples the tuples of a bin, which has no spread where there is only one.
        draws: resamples if ``ap_draws`` is None.
        sigma_bins_dn: centres, rising.
        mtf_bins: centres, rising.

    Raises:
        InputError: lengths differ, bins do not rise, an average precision is not in 0..100, there is no resample, or no
            tuple is left.
    """
    sigma, contrast, precision = (np.asarray(values, dtype=float) for values in (sigma_dn, mtf, ap_percent))
    if sigma.ndim != 1 or not sigma.shape == contrast.shape == precision.shape:
        shapes = f"{sigma.shape}, {contrast.shape}, {precision.shape}"
        raise InputError(f"sigma_dn, mtf, ap_percent: expected three lists of one length, not shapes {shapes}")
    finite = np.isfinite(sigma) & np.isfinite(contrast) & np.isfinite(precision)
    if ((precision[finite] < 0) | (precision[finite] > 100)).any():
        raise InputError("ap_percent: expected numbers in 0..100")
    resampled = None if ap_draws is None else np.asarray(ap_draws, dtype=float)
    if resampled is not None and (resampled.ndim != 2 or len(resampled) != len(sigma)):
        raise InputError(f"ap_draws: expected shape ({len(sigma)}, draws), not {resampled.shape}")
    if (draws if resampled is None else resampled.shape[1]) < 1:
        raise InputError("draws: expected at least one resample")
    sigma_centres, mtf_centres = _rising("sigma_bins_dn", sigma_bins_dn), _rising("mtf_bins", mtf_bins)
    row, column = nearest_bin(sigma, sigma_centres), nearest_bin(contrast, mtf_centres)
    used = finite & (row >= 0) & (column >= 0)
    if not used.any():
        raise InputError("no tuple lies in any bin; are noise in DN (0..255) and MTF in 0..1?")
    shape = (len(sigma_centres), len(mtf_centres))
    count = np.zeros(shape, dtype=np.int64)
    means = np.full((3, *shape), np.nan)
    drawn = np.full((draws if resampled is None else resampled.shape[1], *shape), np.nan)
    for s, m in sorted(set(zip(row[used].tolist(), column[used].tolist(), strict=True))):
        mine = np.flatnonzero(used & (row == s) & (column == m))
        count[s, m] = len(mine)
        means[:, s, m] = sigma[mine].mean(), contrast[mine].mean(), precision[mine].mean()
        if resampled is not None:
            drawn[:, s, m] = resampled[mine].mean(axis=0)
        elif len(mine) > 1:
            picks = generator.integers(len(mine), size=(draws, len(mine)))
            drawn[:, s, m] = precision[mine][picks].mean(axis=1)
    left_out = int(len(sigma) - used.sum())
    return Cells(sigma_centres, mtf_centres, count, means[0], means[1], means[2], drawn, left_out)


def nearest_bin(values: ArrayLike, centres: Floats) -> NDArray[np.int64]:
    """Number of the bin (n,) whose centre is nearest; -1 for NaN and beyond half a bin outside."""
    given = np.asarray(values, dtype=float)
    borders = bin_borders(centres)
    slack = 1e-9 * (borders[-1] - borders[0])
    inside = (given >= borders[0] - slack) & (given <= borders[-1] + slack)
    return np.where(inside, np.searchsorted(borders[1:-1], given, side="right"), -1).astype(np.int64)


def bin_borders(centres: Floats) -> Floats:
    """Ends of the bins (K + 1,): halfway between centres, and as far beyond the outermost ones."""
    middle = (centres[1:] + centres[:-1]) / 2
    return np.concatenate([[2 * centres[0] - middle[0]], middle, [2 * centres[-1] - middle[-1]]])


def _rising(name: str, centres: ArrayLike) -> Floats:
    array = np.asarray(centres, dtype=float)
    if array.ndim != 1 or len(array) < 2 or not (np.diff(array) > 0).all():
        raise InputError(f"{name}: expected at least two rising bin centres, not {centres!r}")
    return array
