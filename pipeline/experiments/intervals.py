"""Intervals over frames: a cluster bootstrap whose bias-corrected interval contains its estimate, also of few frames.

Patches of one frame share its scene, lens and light and err together, so whole frames are resampled, each with all its
patches (Davison and Hinkley 1997, Sec. 3.8). With resampled statistics t* of the estimate t and of n frames,

    bias = median(t*) - t,   interval = t + k (2.5 % and 97.5 % quantiles of t* - median(t*)),
    k = sqrt(n / (n - 1)) t_{0.975, n - 1} / z_{0.975}

A mean absolute error of resampled medians is on average larger than that of the median, so that quantiles of t* itself
can lie above t altogether (bias estimate: Efron and Tibshirani 1993, Sec. 10.2, here with the median of t*). Few frames
scatter too little about their own mean, and their scatter is itself uncertain: plain quantiles hold the true value in
71 to 87 % of the cases for 3 or 4 frames; expanded by k, in 90 % or more (expansion: Hesterberg 2015, "What Teachers
Should Know About the Bootstrap", The American Statistician 69). k is 9.2 for 2 frames, 2.7 for 3, 1.9 for 4, 1.3 for 8,
1.1 for 16 and 1 for many.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.statistics import REJECT_BEYOND_MAD
from pipeline.streams import KeyPart, stream

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

FIRST_NAMES = {"camera_calibrated": "fitted", "generic_lens": "typical"}
"""Renamed estimators -> their name in the keys of random streams, kept so that their intervals stay the same."""

_BLOCK = 2_000_000  # numbers resampled together
_NO_INTERVAL = (math.nan, math.nan)
_TAIL = 0.975


def bootstrap_stream(seed: int, purpose: str, *key: KeyPart) -> np.random.Generator:
    """The random stream that resamples one cell.

    Args:
        seed: root of the random streams.
        purpose: of the table, e.g. ``"blur"``.
        key: what the cell's rows have in common: dataset, estimator, condition.
    """
    return stream(seed, "bootstrap", purpose, *(FIRST_NAMES.get(str(part), part) for part in key))


def median(values: NDArray[np.floating]) -> NDArray[np.float64]:
    """Median over the first axis of the values that are numbers.

    Args:
        values: (N, ...) numbers; NaN are left out.

    Returns:
        (...); NaN where there is no number.
    """
    data = np.array(np.moveaxis(np.asarray(values, dtype=np.float64), 0, -1), order="C")
    if data.shape[-1] == 0:
        return np.full(data.shape[:-1], np.nan)
    data.sort(axis=-1)  # NaN come last
    count = np.isfinite(data).sum(axis=-1)
    middle = np.stack([np.maximum(count - 1, 0) // 2, count // 2], axis=-1)
    return np.where(count == 0, np.nan, np.take_along_axis(data, middle, axis=-1).sum(axis=-1) / 2)


def robust_median(values: NDArray[np.floating]) -> NDArray[np.float64]:
    """Median over the first axis of the values within 3.5 MAD of the plain median (`pipeline.statistics.inliers`).

    Args:
        values: (N, ...) numbers; NaN are left out.

    Returns:
        (...); NaN where there is no number.
    """
    data = np.asarray(values, dtype=np.float64)
    deviation = np.abs(data - median(data))
    mad = median(deviation)
    return median(np.where(deviation < REJECT_BEYOND_MAD * np.where(mad == 0, 1.0, mad), data, np.nan))


def frame_interval(
    values: NDArray[np.float64],
    frames: NDArray[Any],
    statistic: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    generator: np.random.Generator,
    draws: int,
) -> tuple[float, float]:
    """Bias-corrected 95 % interval of a statistic over patches, whole frames resampled.

    Args:
        values: (N, ...) of N patches, NaN where there is no estimate.
        frames: (N,) the frame of each.
        statistic: reduces (M, draws, ...) resampled patches, NaN among them, to (draws,) numbers.
        generator: random stream of the bootstrap.
        draws: resamples.

    Returns:
        lower and upper end, which enclose the statistic of the values given; NaN with fewer than two frames, or
        without draws or numbers.
    """
    names, numbers = np.unique(frames, return_inverse=True)
    if len(names) < 2 or draws == 0:
        return _NO_INTERVAL
    members = [np.flatnonzero(numbers == number) for number in range(len(names))]
    padded = np.full((len(names), max(map(len, members)), *values.shape[1:]), np.nan)
    for number, rows in enumerate(members):
        padded[number, : len(rows)] = values[rows]
    picks = generator.integers(len(names), size=(draws, len(names)))
    block = max(1, _BLOCK // padded.size)
    results = []
    for part in np.split(picks, range(block, draws, block)):
        resampled = padded[part.T].swapaxes(1, 2)  # frames, patches, draws, ...
        results.append(statistic(resampled.reshape(-1, *resampled.shape[2:])))
    return bias_corrected(np.concatenate(results), float(statistic(values[:, None])[0]), len(names))


def cluster_mean(
    values: pd.Series,
    clusters: pd.Series,
    generator: np.random.Generator,
    draws: int = 500,
    bounds: tuple[float, float] = (-math.inf, math.inf),
) -> tuple[float, float, float, int]:
    """Mean over values with a 95 % interval from a bootstrap over clusters, whose members err together.

    Args:
        values: (N,) numbers; NaN are left out.
        clusters: (N,) names, e.g. the frame of each patch.
        generator: random stream of the bootstrap.
        draws: resamples.
        bounds: least and greatest value possible, which the interval does not leave.

    Returns:
        mean, lower and upper end, number of values; NaN without values, no interval with fewer than two clusters.
    """
    known = values.notna()
    if not known.any():
        return math.nan, math.nan, math.nan, 0
    groups = values[known].groupby(clusters[known])
    sums, sizes = groups.sum().to_numpy(float), groups.size().to_numpy(float)
    mean, (low, high) = float(values[known].mean()), _NO_INTERVAL
    if len(sums) > 1:
        picks = generator.integers(len(sums), size=(draws, len(sums)))
        low, high = bias_corrected(sums[picks].sum(axis=1) / sizes[picks].sum(axis=1), mean, len(sums))
    return mean, max(low, bounds[0]), min(high, bounds[1]), int(known.sum())


def bias_corrected(results: NDArray[np.float64], estimate: float, clusters: int) -> tuple[float, float]:
    """Bias-corrected 95 % interval, which contains the estimate; of statistics that are never negative, nor is it.

    Args:
        results: (B,) resampled statistics; NaN are left out.
        estimate: the statistic itself.
        clusters: frames that were resampled, at least two.

    Returns:
        lower and upper end; NaN without numbers.
    """
    known = results[np.isfinite(results)]
    if len(known) == 0 or not math.isfinite(estimate):
        return _NO_INTERVAL
    low, middle, high = np.quantile(known, [1 - _TAIL, 0.5, _TAIL])
    factor = small_sample_factor(clusters)
    least = 0.0 if estimate >= 0 and known.min() >= 0 else -math.inf
    return max(float(estimate - factor * (middle - low)), least), float(estimate + factor * (high - middle))


@lru_cache
def small_sample_factor(clusters: int) -> float:
    """Factor by which a bootstrap interval of few clusters is wider than its quantiles; 1 for many.

        k = sqrt(n / (n - 1)) t_{0.975, n - 1} / z_{0.975}

    Args:
        clusters: n, at least two.
    """
    from scipy.special import ndtri, stdtrit

    return math.sqrt(clusters / (clusters - 1)) * float(stdtrit(clusters - 1, _TAIL) / ndtri(_TAIL))


def median_error_of_range(width: NDArray[np.float64], count: NDArray[np.float64]) -> NDArray[np.float64]:
    """Half the 95 % interval of a median of which only the range of its values is known.

        sigma = width / E[range of n standard normal numbers],  error = 1.96 sqrt(pi / 2) sigma / sqrt(n)

    Normal approximation, for independent values. Source of the expected range: Tippett (1925), "On the extreme
    individuals and the range of samples".

    Args:
        width: (K,) largest less smallest value.
        count: (K,) number of values n; below two there is no range.

    Returns:
        (K,) in the unit of the values; NaN below two values.
    """
    x = np.linspace(-8.0, 8.0, 3201)
    below = np.array([0.5 * (1 + math.erf(value / math.sqrt(2))) for value in x])
    expected = {
        n: float(np.trapezoid(1 - below**n - (1 - below) ** n, x)) if n >= 2 else math.nan for n in np.unique(count)
    }
    spread = np.asarray(width, dtype=float) / np.array([expected[n] for n in count])
    return np.asarray(1.96 * math.sqrt(math.pi / 2) * spread / np.sqrt(count))
