"""From many patches to one number: the median of what is left when outliers are rejected, with its interval.

The rule is the paper's (`pipeline.statistics`): a value further than 3.5 median absolute deviations from the median,
about 5 % of them, is left out. Where the patches carry predictive intervals, the interval of the summary is the same
median of their ends: neighbouring patches err together, and correlated errors do not average out. Without intervals
that of blur is a bootstrap interval of the median, which knows of the spread between patches only; noise has none, for
its upper end is used as a bound.

A frame whose tiles mostly abstain because a codec may have removed the noise has no noise level either: the few that
answer are those whose own grain looks like noise (asphalt, foliage), not a sample of the frame. Nor has one whose tiles
mostly alternate from pixel to pixel, or show the streaks of a median filter: both are of whole frames. Nor has one of
which hardly any tile answers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.mtf import FREQUENCIES
from pipeline.camera.saturation import SATURATED
from pipeline.condition.picture_area import COVERED_REASON
from pipeline.noise.abstentions import UNDETECTED_DN, UNDETECTED_LOW_DN
from pipeline.noise.base import ALTERNATING, BEYOND, COMPRESSED, FLAT, STREAKED, UNCERTAIN, NoiseEstimate
from pipeline.statistics import bootstrap_interval, inliers
from pipeline.streams import stream

Floats = NDArray[np.float64]
BOOTSTRAP_DRAWS = 200
HALF = 0.5
SHARP_MTF50 = 0.2
"""Fraction of Nyquist below which a frame that was given as sharp is doubted: about a 4 px disc of defocus."""

LEAST_ANSWERING = 0.25
"""Share of a frame's tiles, but for flat, saturated and covered ones, that must answer for its noise. Of 12 frames of
KITTI, Udacity, *Sim* and that of the paper's authors, means of PolyU and Penn-Fudan with 0 to 10 DN, 43 were answered
as they are, 1 of them by fewer; turned by 2 degrees 31, 11 of them by fewer, 5 of these wrong (by 20 % and .5 DN). Of
11 frames of KITTI through a simulated camera without a codec at ISO 1600 all were answered, 9 by fewer, 8 of these
wrong."""

BOUND_QUANTILE = 0.4
"""Of the tiles' upper ends, which bounds the noise of a coded frame: rough tiles allow too much, and in smooth ones a
codec left less than elsewhere. The lower quartile holds the noise of 8 of 10 noisy photographs (PolyU)."""


def half_contrast(mtf: NDArray[np.floating]) -> Floats:
    """Where contrast falls to half (MTF50), by straight lines between the eight frequencies, from 1 at zero.

    Args:
        mtf: (..., 8) at `pipeline.camera.mtf.FREQUENCIES`.

    Returns:
        (...) fractions of Nyquist; infinite where it stays above half, NaN where the MTF is NaN.
    """
    values = np.asarray(mtf, dtype=np.float64).reshape(-1, len(FREQUENCIES))
    frequency = np.concatenate([[0.0], FREQUENCIES])
    result = np.full(len(values), np.inf)
    for position, curve in enumerate(np.concatenate([np.ones((len(values), 1)), values], axis=1)):
        below = np.flatnonzero(curve <= HALF)
        if not np.isfinite(curve).all():
            result[position] = np.nan
        elif below.size:
            at = below[0]
            share = (curve[at - 1] - HALF) / (curve[at - 1] - curve[at])
            result[position] = frequency[at - 1] + share * (frequency[at] - frequency[at - 1])
    return result.reshape(np.shape(mtf)[:-1])


def unsharp(mtf: NDArray[np.floating]) -> str:
    """Why a picture that was given as sharp does not look it; empty where it does or nothing is known.

    Args:
        mtf: (2, 8) of the picture, NaN where unknown.
    """
    mtf50 = half_contrast(mtf)
    if not np.isfinite(mtf50).any() or np.nanmin(mtf50) >= SHARP_MTF50:
        return ""
    return (
        f"does not look sharp: contrast falls to half at {np.nanmin(mtf50):.2f} of Nyquist, expected "
        f"{SHARP_MTF50:g} or more; blur relative to it will be underestimated"
    )


@dataclass(frozen=True)
class Summary:
    """Robust statistics over N patches, of one quantity or of each of several.

    Attributes:
        value: median of the inliers; NaN where every patch abstains.
        low, high: 95 % interval of the value; NaN where there is none.
        least, greatest: of the inliers.
        count: patches that answered; rejected: of those, how many were outliers; abstained: patches without answer.
    """

    value: Floats
    low: Floats
    high: Floats
    least: Floats
    greatest: Floats
    count: NDArray[np.int64]
    rejected: NDArray[np.int64]
    abstained: NDArray[np.int64]


def summarise(
    values: NDArray[np.floating],
    low: NDArray[np.floating] | None = None,
    high: NDArray[np.floating] | None = None,
    *,
    bootstrap: bool = True,
) -> Summary:
    """Summarise patches.

    Args:
        values: (N, ...) answers, NaN where a patch abstains.
        low: (N, ...) lower ends of the patches' predictive intervals, where the estimator has them.
        high: (N, ...) upper ends.
        bootstrap: whether an interval that patches do not have is that of the median over them; else NaN.

    Returns:
        a summary whose arrays have shape (...).
    """
    shape = values.shape[1:]
    names = ("value", "low", "high", "least", "greatest", "count", "rejected", "abstained")
    result: dict[str, NDArray] = {
        name: np.zeros(shape, dtype=np.int64 if position > 4 else np.float64) for position, name in enumerate(names)
    }
    for position in np.ndindex(shape):
        column = np.asarray(values[(slice(None), *position)], dtype=np.float64)
        ends = [end[(slice(None), *position)] for end in (low, high) if end is not None]
        inside = inliers(column)
        kept, answered = column[inside], int(np.isfinite(column).sum())
        interval = (np.nan, np.nan)
        if len(kept) and len(ends) == 2 and all(np.isfinite(end[inside]).all() for end in ends):
            interval = (float(np.median(ends[0][inside])), float(np.median(ends[1][inside])))
        elif len(kept) and bootstrap:
            interval = bootstrap_interval(kept, stream(0, "condition", *position), draws=BOOTSTRAP_DRAWS)
        middle, least, greatest = (np.median(kept), kept.min(), kept.max()) if len(kept) else (np.nan, np.nan, np.nan)
        numbers = (
            middle, *interval, least, greatest, answered, answered - len(kept), len(column) - answered,
        )  # fmt: skip
        for name, number in zip(names, numbers, strict=True):
            result[name][position] = number
    return Summary(**result)


def summarise_noise(estimate: NoiseEstimate) -> Summary:
    """Summarise the noise of a frame's tiles, or withhold an answer.

    Where more tiles abstain because of a codec, of a pattern that alternates or of streaks than answer, the frame
    abstains; counts stay. In 610 coded frames (23 frames of KITTI, Udacity, CC and the *Sim* of the paper's
    authors with 0 to 10 DN behind JPEG, MPEG-4, H.264 and Motion JPEG) the median of the answering tiles was wrong (by
    20 % and .5 DN) in 240 of 366 of which this is so, in 19 of the others. So it does where less than `LEAST_ANSWERING`
    of the tiles that hold noise at all answer: they are no sample of the frame.

    Args:
        estimate: of the tiles.

    Returns:
        a summary whose arrays have shape (); without an interval where an answering tile has none.
    """
    summary = summarise(estimate.sigma_dn, estimate.low_dn, estimate.high_dn, bootstrap=False)
    processed = np.isin(estimate.reason, (COMPRESSED, ALTERNATING, STREAKED)).sum()
    measurable = np.count_nonzero(~np.isin(estimate.reason, (FLAT, SATURATED, COVERED_REASON)))
    if processed <= summary.count and summary.count >= LEAST_ANSWERING * measurable:
        return summary
    unknown = np.full_like(summary.value, np.nan)
    return replace(summary, value=unknown, low=unknown, high=unknown, least=unknown, greatest=unknown)


def with_upper_end(summary: Summary, least_high_dn: float) -> Summary:
    """The summary () with an interval that ends at this or above; as it is where this or the interval is NaN."""
    return replace(summary, high=np.where(least_high_dn > summary.high, least_high_dn, summary.high))


def at_most_dn(estimate: NoiseEstimate, summary: Summary, least_dn: float = np.nan) -> float:
    """Noise that a frame holds at most.

    Args:
        estimate: of the frame's tiles.
        summary: of the frame.
        least_dn: what the bound is at least, DN; NaN for nothing.

    Returns:
        the upper end of the frame's interval, or without an answer `most_noise_dn`, DN; NaN where there is none.
    """
    if not np.isnan(summary.value):
        return float(summary.high)
    most = most_noise_dn(estimate)
    return least_dn if least_dn > most else most


def noise_parts(estimate: NoiseEstimate, summary: Summary) -> tuple[float, float]:
    """White part of the noise of a frame, and how much the noise of adjacent pixels is correlated.

    Both are medians over the tiles that the noise itself is the median of, its inliers: so the white part, of no tile
    above the noise, is not above that of the frame either.

    Args:
        estimate: of the frame's tiles.
        summary: of the frame, `summarise_noise`.

    Returns:
        white sigma, DN, and correlation, -1 to 1; NaN where the frame has no noise level or the estimator does not
        separate them. Of a frame without detectable noise the correlation is NaN too: that of zero means nothing.
    """
    inside = inliers(estimate.sigma_dn)

    def middle(values: NDArray[np.float64] | None) -> float:
        return float("nan") if values is None or np.isnan(summary.value) else float(np.median(values[inside]))

    undetected = summary.value < UNDETECTED_DN and summary.low < UNDETECTED_LOW_DN
    return middle(estimate.white_sigma_dn), float("nan") if undetected else middle(estimate.correlation)


def most_noise_dn(estimate: NoiseEstimate) -> float:
    """How much noise a coded frame holds at most, be it too little for an estimate.

    Args:
        estimate: of the frame's tiles.

    Returns:
        `BOUND_QUANTILE` of the tiles' upper ends, DN; NaN where as many tiles or more abstain for other reasons
        than because of a codec, or the estimator has no intervals.
    """
    others = np.isin(estimate.reason, (UNCERTAIN, BEYOND, ALTERNATING, STREAKED)).sum()
    if estimate.at_most_dn is None or others >= (estimate.reason == COMPRESSED).sum():
        return float("nan")
    known = estimate.at_most_dn[np.isfinite(estimate.at_most_dn)]
    return float(np.quantile(known, BOUND_QUANTILE)) if len(known) else float("nan")
