"""Intervals over frames: whole frames are resampled, each with all its patches, which share its scene, lens and light.

The interval is that of `pipeline.cluster_intervals`: bias-corrected, so that it contains its estimate, and wider for
few frames.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.cluster_intervals import NO_INTERVAL, bias_corrected, resamples
from pipeline.statistics import REJECT_BEYOND_MAD
from pipeline.streams import KeyPart, stream

if TYPE_CHECKING:
    from numpy.typing import NDArray

FIRST_NAMES = {"camera_calibrated": "fitted", "generic_lens": "typical"}
"""Renamed estimators -> their name in the keys of random streams, kept so that their intervals stay the same."""

_BLOCK = 2_000_000  # numbers resampled together


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
    least: float = -math.inf,
) -> tuple[float, float]:
    """Bias-corrected 95 % interval of a statistic over patches, whole frames resampled.

    Frames without an estimate do not count: they neither scatter nor say how the others do.

    Args:
        values: (N, ...) of N patches, NaN where there is no estimate.
        frames: (N,) the frame of each.
        statistic: reduces (M, draws, ...) resampled patches, NaN among them, to (draws,) numbers.
        generator: random stream of the bootstrap.
        draws: resamples, of more than a few frames (`pipeline.cluster_intervals.resamples`).
        least: value that the statistic can have, below which the interval does not reach; 0 for what is never
            negative.

    Returns:
        lower and upper end, which enclose the statistic of the values given; NaN with fewer than two frames that hold
        an estimate, or without draws.
    """
    known = np.isfinite(values).reshape(len(values), -1).any(axis=1)
    values = values[known]
    names, numbers = np.unique(np.asarray(frames)[known], return_inverse=True)
    if len(names) < 2 or draws == 0:
        return NO_INTERVAL
    members = [np.flatnonzero(numbers == number) for number in range(len(names))]
    padded = np.full((len(names), max(map(len, members)), *values.shape[1:]), np.nan)
    for number, rows in enumerate(members):
        padded[number, : len(rows)] = values[rows]
    picks = resamples(len(names), draws, generator)
    block = max(1, _BLOCK // padded.size)
    results = []
    for part in np.split(picks, range(block, len(picks), block)):
        resampled = padded[part.T].swapaxes(1, 2)  # frames, patches, draws, ...
        results.append(statistic(resampled.reshape(-1, *resampled.shape[2:])))
    resampled, estimate = np.concatenate(results), float(statistic(values[:, None])[0])
    return bias_corrected(resampled, estimate, len(names), (least, math.inf))


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
    from scipy.special import ndtr

    x = np.linspace(-8.0, 8.0, 3201)
    below = ndtr(x)
    expected = {
        n: float(np.trapezoid(1 - below**n - (1 - below) ** n, x)) if n >= 2 else math.nan for n in np.unique(count)
    }
    spread = np.asarray(width, dtype=float) / np.array([expected[n] for n in count])
    return np.asarray(1.96 * math.sqrt(math.pi / 2) * spread / np.sqrt(count))
