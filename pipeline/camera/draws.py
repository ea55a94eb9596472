"""Fast, exact random draws for whole frames: forked streams, normals and Poisson counts.

A frame of half a million pixels needs millions of draws. Two observations make them cheap without giving up
exactness:

* Normals by Box and Muller (1958) vectorise: two uniform words give two normals.
* A Poisson count is the Poisson quantile of a normal's probability, ``k = F^-1(Phi(w); rate)``. Giles (2016,
  "Algorithm 955: approximation of the inverse Poisson cumulative distribution function", ACM TOMS 42(1)) gives
  that quantile as an expansion in ``1 / sqrt(rate)`` so accurate that rounding it down *is* the exact answer
  except within a narrow band around whole numbers, where the distribution function decides.

The second one has a use beyond speed: a count is a monotone function of one normal per pixel, so two frames drawn
from the same stream at different light levels have *common* noise and differ as little as they can. This holds for
pixels with a mean of at least `HYBRID_FROM` counts in both frames. Fainter pixels are drawn by NumPy's sampler, whose
counts at two light levels are practically independent.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.camera.blocks import blocks
from pipeline.errors import InputError, did_you_mean
from pipeline.streams import stream

Float = NDArray[np.float32]
Double = NDArray[np.float64]
PoissonMethod = Literal["exact", "hybrid"]

HYBRID_FROM = 64.0
"""Mean count from which the normal approximation (``hybrid``) or the expansion (``exact``) serves, and from which
frames of equal streams have common noise."""

_FARTHEST = 6.8  # no 32-bit Box-Muller normal lies beyond sqrt(2 ln 2^33) = 6.77
_LARGEST_RATE = 2.0**20  # whole counts and rounding bounds hold in float32 below this
_CELLS = 1 << 16


def fork(generator: np.random.Generator, count: int) -> list[np.random.Generator]:
    """Independent generators, one per noise source, each keyed by 256 bits of ``generator``.

    Every source has its own, so switching one source on or off does not change the noise of the others.

    Args:
        generator: parent stream (`pipeline.streams.stream`); it advances by ``4 * count`` words.
        count: how many children.

    Returns:
        the children; the same parent state gives the same children.
    """
    words = generator.integers(0, 2**64 - 1, size=(count, 4), dtype=np.uint64, endpoint=True)
    return [stream(first, "fork", *rest) for first, *rest in words.tolist()]


def normals(shape: int | tuple[int, ...], generator: np.random.Generator, sigma: float = 1.0) -> Float:
    """Normal numbers of mean 0: ``sqrt(-2 ln u) cos(2 pi v)`` and the same with sine, times sigma.

    ``u`` has 32 bits, so the tails reach 6.7 standard deviations; NumPy's own float32 sampler is as exact but
    takes three times as long.

    Args:
        shape: of the result.
        generator: where the words come from.
        sigma: standard deviation.

    Returns:
        float32 array of that shape.
    """
    out = np.empty(shape, np.float32)
    for part in blocks(out):
        _fill_normals(part, generator)
        if sigma != 1.0:
            part *= np.float32(sigma)
    return out


def _fill_normals(out: Float, generator: np.random.Generator) -> None:
    """Standard normals into ``out`` (B,), from B words of 32 bits: the first half radii, the second half angles."""
    half = (out.size + 1) // 2
    words = generator.integers(0, 2**64 - 1, size=half, dtype=np.uint64, endpoint=True).view(np.uint32)
    radius = words[:half].astype(np.float32)
    radius += np.float32(0.5)  # u in (0, 1]: the logarithm never sees zero
    radius *= np.float32(2.0**-32)
    np.log(radius, out=radius)
    radius *= np.float32(-2.0)
    np.sqrt(radius, out=radius)
    angle = words[half:].astype(np.float32)
    angle *= np.float32(2.0 * np.pi * 2.0**-32)
    np.multiply(np.cos(angle), radius, out=out[:half])
    rest = out.size - half
    np.multiply(np.sin(angle[:rest]), radius[:rest], out=out[half:])


def poisson(rate: ArrayLike, generator: np.random.Generator, method: PoissonMethod = "exact") -> Float:
    """Poisson counts, each with its own mean.

    Args:
        rate: means, at least 0, any shape.
        generator: where the draws come from; one normal per pixel, plus library draws for means below 64.
        method: ``exact``: Poisson distributed, by inversion (to the 32-bit resolution of the normals) where the
            mean is 64 or more and by NumPy's sampler below. ``hybrid``: a rounded normal with the same mean and
            variance from 64 upwards, exact below; to be declared wherever its frames are used.

    Returns:
        float32 counts, whole numbers, same shape.

    Raises:
        InputError: a mean is negative, not a number or above 2^20, or the method is unknown.
    """
    if method not in ("exact", "hybrid"):
        raise InputError(f"poisson method '{method}' is unknown; {did_you_mean(str(method), ('exact', 'hybrid'))}")
    means = np.ascontiguousarray(rate, dtype=np.float32)
    lowest, highest = (float(means.min()), float(means.max())) if means.size else (0.0, 0.0)
    _check_means(lowest, highest)
    counts = np.empty(means.shape, np.float32)
    rounding = 1e-5 + 3e-7 * _FARTHEST * highest**0.5
    doubts: list[_Doubtful] = []
    for part, mean in zip(blocks(counts), blocks(means), strict=True):
        _fill_normals(part, generator)
        safe = np.maximum(mean, np.float32(HYBRID_FROM)) if lowest < HYBRID_FROM else mean
        if method == "exact":
            doubts.append(_to_quantile(part, safe, rounding))
        else:
            _to_rounded_normal(part, safe)
    _settle(doubts)
    if lowest < HYBRID_FROM:
        few = means < HYBRID_FROM
        counts[few] = generator.poisson(means[few])
    return counts


def poisson_even(mean: float, shape: tuple[int, ...], generator: np.random.Generator) -> Float:
    """Poisson counts that all have the same mean, by table.

    The distribution function is inverted at evenly spaced probabilities once; 16 random bits look a count up. A cell
    of the table within which the count changes is settled by 53 more bits and a search (guide table, Chen and Asau
    1974). Exact to 2^-69 in probability.

    Args:
        mean: at least 0.
        shape: of the result.
        generator: where the words come from.

    Returns:
        float32 counts, whole numbers.

    Raises:
        InputError: the mean is negative, not a number or above 2^20.
    """
    _check_means(mean, mean)
    out = np.zeros(shape, np.float32)
    if mean == 0.0 or out.size == 0:
        return out
    first, distribution, table = _guide_table(float(mean))
    flat = out.reshape(-1)
    words = generator.integers(0, 2**64 - 1, size=(flat.size + 3) // 4, dtype=np.uint64, endpoint=True)
    cells = words.view(np.uint16)[: flat.size]
    np.take(table, cells, out=flat, mode="clip")
    split = np.flatnonzero(np.isnan(flat))
    probability = (cells[split] + generator.random(split.size)) / _CELLS
    result = np.searchsorted(distribution, probability, side="right")
    flat[split] = np.minimum(result, distribution.size - 1) + first
    return out


@lru_cache(maxsize=8)
def _guide_table(mean: float) -> tuple[int, Double, Float]:
    """Inverse of a Poisson distribution function for `poisson_even`.

    Returns:
        the first count considered, the distribution function from there on, and for each of 2^16 cells of
        probability the count it belongs to, NaN where it belongs to several.
    """
    from scipy import special

    reach = 9.0 * mean**0.5 + 40.0  # beyond it lies less than 1e-17 of the distribution, for any mean
    first = max(0, int(mean - reach))
    distribution = special.pdtr(np.arange(first, int(mean + reach) + 1, dtype=np.float64), mean)
    cuts = distribution * _CELLS
    steps = np.bincount(np.ceil(cuts).astype(np.int64), minlength=_CELLS + 1)[:_CELLS]
    table = np.cumsum(steps).astype(np.float32)
    table += np.float32(first)
    table[np.floor(cuts[cuts % 1.0 > 0.0]).astype(np.int64)] = np.nan
    table[-1] = np.nan  # the upper tail
    return first, distribution, table


def _check_means(lowest: float, highest: float) -> None:
    if not (lowest >= 0.0 and highest <= _LARGEST_RATE):
        raise InputError(f"Poisson means lie in [0, {_LARGEST_RATE:.0f}], got {lowest:g} .. {highest:g}")


def _to_rounded_normal(w: Float, rate: Float) -> None:
    """Normals ``w`` (B,) become whole numbers near ``rate + sqrt(rate - 1/12) w``: rounding adds 1/12 of variance."""
    w *= np.sqrt(rate - np.float32(1.0 / 12.0))
    w += rate
    np.rint(w, out=w)
    np.maximum(w, np.float32(0.0), out=w)


@dataclass(frozen=True, eq=False)
class _Doubtful:
    """Counts of a block whose rounding is not settled by the expansion.

    Attributes:
        counts: (B,) of the whole block, in place.
        index: (D,) of the doubtful ones.
        normal: (D,) their normals.
        step: (D,) the whole numbers ``m`` in question: the count is m or m - 1.
        rate: (D,) their means.
    """

    counts: Float
    index: NDArray[np.intp]
    normal: Double
    step: Double
    rate: Double


def _to_quantile(w: Float, rate: Float, rounding: float) -> _Doubtful:
    """Normals ``w`` (B,) become the Poisson quantiles of ``Phi(w)``, in place, but for a few doubtful ones.

    ``Q = rate + s w + 1/3 + w^2/6 - (w/36 + w^3/72)/s``, ``s = sqrt(rate)`` (Giles 2016), rounded down. The whole part
    of the rate is added last, so float32 errors stay near 1e-4 for 20 000 electrons. The expansion's own error was
    measured against a root search on the regularised gamma function; it stays below
    ``(0.006 w^4 + 0.01 w^2 + 0.021) / rate`` for |w| < 6.8 and rate >= 64. Where ``Q`` is nearer than that to a whole
    number its rounding is doubtful.

    Args:
        w: (B,) normals; counts on return.
        rate: (B,) means, at least 64.
        rounding: bound of the float32 error of ``Q``.

    Returns:
        the doubtful counts, for `_settle`.
    """
    float32 = np.float32
    whole = np.floor(rate)
    root = np.sqrt(rate)
    inverse = float32(1.0) / root
    square = w * w
    quantile = square * float32(-1.0 / 72.0)  # Q less the whole part of the rate
    quantile -= float32(1.0 / 36.0)
    quantile *= w
    quantile *= inverse
    term = square * float32(1.0 / 6.0)
    quantile += term
    np.multiply(root, w, out=term)
    quantile += term
    quantile += rate - whole + float32(1.0 / 3.0)
    # how near a whole number is too near: 0.5 less the bound, against the distance from the middle
    farthest = np.multiply(square, float32(-0.006), out=term)
    farthest -= float32(0.01)
    farthest *= square
    farthest -= float32(0.021)
    farthest *= inverse
    farthest *= inverse
    farthest += float32(0.5 - rounding)
    floor = np.floor(quantile, out=square)
    from_middle = np.subtract(quantile, floor, out=quantile)
    from_middle -= float32(0.5)
    index = np.flatnonzero(np.abs(from_middle) > farthest)
    step = (floor[index] + whole[index]).astype(np.float64) + (from_middle[index] > 0.0)
    normal = w[index].astype(np.float64)
    counts = np.add(floor, whole, out=w)
    return _Doubtful(counts, index, normal, step, rate[index].astype(np.float64))


def _settle(doubts: list[_Doubtful]) -> None:
    """Decide doubtful counts by the distribution function: ``k >= m`` exactly if ``Phi(w) > F(m - 1)``, else m - 1.

    Args:
        doubts: of each block; the counts are written in place.
    """
    if not any(block.index.size for block in doubts):
        return
    from scipy import special

    w = np.concatenate([block.normal for block in doubts])
    step = np.concatenate([block.step for block in doubts])
    rate = np.concatenate([block.rate for block in doubts])
    below = step - 1.0
    # the smaller of the two tails, where float64 has all its digits
    reached = np.empty(w.shape, bool)
    left, right = np.flatnonzero(w < 0.0), np.flatnonzero(w >= 0.0)
    reached[left] = special.ndtr(w[left]) > special.pdtr(below[left], rate[left])
    reached[right] = special.ndtr(-w[right]) < special.pdtrc(below[right], rate[right])
    sure = np.where(reached, step, below).astype(np.float32)
    start = 0
    for block in doubts:
        block.counts[block.index] = sure[start : start + block.index.size]
        start += block.index.size
