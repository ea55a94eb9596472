"""Impulse noise: isolated pixels far brighter or darker than all around them, as a fraction of the pixels.

Hot and dead pixels and errors of transmission (salt and pepper) change single pixels, where light, which a lens
spreads, does not. Estimators of noise that use medians or flat cells leave such pixels out.

A pixel g is an impulse where it is isolated, out of proportion to the noise, and its surroundings are smooth:

    isolated    above the largest of its eight neighbours, or below the least, by more than max(30, 4 s) DN
    sharp       the largest (or least) neighbour deviates from the median m of the nine by at most max(0.2 |g - m|,
                2.5 s): the optical image of a point, as of a star, leaves more than a fifth of its contrast there
    smooth      the medians of 3 by 3 pixels vary by at most max(20, 2.5 s) DN in the 7 by 7 pixels around it: in leaves
                and grass isolated extremes are many

with s the standard deviation of the noise: the third quartile of |g - m| over 1.15, as of normal noise. The frame is
divided into 4 by 4 cells, each with its s, or the median of all where that is more: clipping narrows the noise of dark
ones. The result is the median over the cells of the number of impulses over that of pixels with smooth surroundings.
Impulses are spread evenly over a frame, unlike text, lamps and glints of water. A raw colour mosaic, whose extremes lie
on one or two of the four phases of 2 by 2 pixels, has no impulses.

Impulses that resemble their surroundings, such as white ones on white, do not show, nor do those beside another, so
that dense ones are underestimated. Those that processing has smeared (demosaicing, scaling, a strong codec) are not
isolated any more.
"""

from __future__ import annotations

from itertools import pairwise, product

import cv2
import numpy as np
from numpy.typing import NDArray

CELLS_PER_SIDE = 4
LEAST_CELL_PX = 16
LEAST_STEP_DN, STEP_SIGMAS = 30.0, 4.0
LEAK_RATIO, LEAK_SIGMAS = 0.2, 2.5
SMOOTH_DN, SMOOTH_SIGMAS = 20.0, 2.5
SMOOTH_PX = 7
LEAST_SMOOTH = 0.02  # of a cell's pixels
QUARTILE, QUARTILE_SIGMAS = 0.75, 1.15  # the third quartile of the magnitude of normal noise
COUNTED_PX = 16_384  # of a cell, for its noise
LEAST_OF_PHASES = 0.2  # of the impulses, on the two of the four phases of 2 x 2 px with the fewest: half of random ones
RING = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], np.uint8)


def impulse_fraction(levels: NDArray[np.uint8]) -> float:
    """Fraction of the pixels of a frame that are impulses.

    Args:
        levels: (H, W) grey levels, 0..255.

    Returns:
        0..1; NaN where nothing of the frame is smooth, or a side is shorter than `CELLS_PER_SIDE` cells of
        `LEAST_CELL_PX`.
    """
    if min(levels.shape) < CELLS_PER_SIDE * LEAST_CELL_PX:
        return float("nan")
    levels = np.ascontiguousarray(levels)
    largest, least = cv2.dilate(levels, RING), cv2.erode(levels, RING)
    middle = cv2.medianBlur(levels, 3)
    step = cv2.max(cv2.subtract(levels, largest), cv2.subtract(least, levels))  # saturated: 0 where it is no extreme
    square = np.ones((SMOOTH_PX, SMOOTH_PX), np.uint8)
    variation = cv2.subtract(cv2.dilate(middle, square), cv2.erode(middle, square))
    deviation = np.asarray(cv2.absdiff(levels, middle), dtype=np.uint8)
    cells = list(product(_parts(levels.shape[0]), _parts(levels.shape[1])))
    sigmas = [_sigma_dn(deviation[cell]) for cell in cells]
    fractions, phases = [], np.zeros(4, np.int64)
    for cell, sigma in zip(cells, np.maximum(sigmas, np.median(sigmas)).tolist(), strict=True):
        smooth = variation[cell] <= _whole(max(SMOOTH_DN, SMOOTH_SIGMAS * sigma))
        pixels = np.count_nonzero(smooth)
        if pixels < LEAST_SMOOTH * smooth.size:
            continue
        isolated = smooth & (step[cell] > _whole(max(LEAST_STEP_DN, STEP_SIGMAS * sigma)))
        y, x = np.divmod(np.flatnonzero(isolated), isolated.shape[1])  # ten times as fast as `numpy.nonzero`
        value, around = (image[cell][y, x].astype(np.int16) for image in (levels, middle))
        beyond = np.where(value > around, largest[cell][y, x] - around, around - least[cell][y, x])
        sharp = beyond <= np.maximum(LEAK_RATIO * np.abs(value - around), LEAK_SIGMAS * sigma)
        y, x = y[sharp] + cell[0].start, x[sharp] + cell[1].start
        phases += np.bincount(2 * (y % 2) + x % 2, minlength=4)
        fractions.append(len(y) / pixels)
    if not fractions:
        return float("nan")
    if np.sort(phases)[:2].sum() < LEAST_OF_PHASES * phases.sum():
        return 0.0
    return float(np.median(fractions))


def _parts(size_px: int) -> list[slice]:
    """A side without its outermost pixels, whose neighbours are not all known, in `CELLS_PER_SIDE` parts."""
    ends = np.linspace(1, size_px - 1, CELLS_PER_SIDE + 1).astype(int).tolist()
    return [slice(start, end) for start, end in pairwise(ends)]


def _whole(limit_dn: float) -> np.uint8:
    """The limit for whole levels, which NumPy compares four times as fast as with a broken number."""
    return np.uint8(min(255, int(limit_dn)))


def _sigma_dn(deviation: NDArray[np.uint8]) -> float:
    """Standard deviation of the noise, DN, by the magnitudes of pixels less the median of their surroundings."""
    every = deviation[:: max(1, deviation.size // COUNTED_PX)]  # rows
    counts = np.cumsum(cv2.calcHist([every], [0], None, [256], [0, 256]))
    wanted = QUARTILE * counts[-1]
    level = int(np.searchsorted(counts, wanted))
    before = counts[level - 1] if level else 0.0
    # whole levels stand for what was rounded to them: interpolated within the level
    quartile = level - 0.5 + (wanted - before) / (counts[level] - before)
    return max(0.0, float(quartile)) / QUARTILE_SIGMAS
