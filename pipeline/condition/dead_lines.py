"""Dead lines: single rows or columns of a sensor that are dark, bright or of another gain over their whole length.

A frame is divided into `STRIPS` strips across the lines. In each, with p the median of every line over up to
`MOST_PIXELS` pixels,

    d = p - median of p over the `AROUND` lines about,    z = d / max(1.4826 median |d| over `NEAR` lines about, .5 DN)

A line is dead where z exceeds `LEAST` in all strips, or -z does, and both lines beside it differ by less than
`MOST_BESIDE` of what it does itself: a scene's thin lines are blurred by the lens, a sensor's are not. Up to
`MOST_CLIPPED` strips that are black or white around the line, where it cannot show, do not count.

Of 280 frames of KITTI, Udacity, Penn-Fudan, CC, PolyU, Levin, *Sim* and that of the paper's authors, and photographs,
with 0 to 25 DN of noise and behind codecs, 3 in 6,720 are flagged; with one row or column of 0 or 255 DN 97 to 99 %,
with one of half the gain 81 to 85 % (`benchmarks/flag_rates.py`). Offsets of less than 15 DN of a single line mostly do
not show in a scene, nor do two dead lines side by side. Offsets of most lines are noise of rows
(`pipeline.condition.row_noise`), which in turn does not see single lines.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from pipeline.condition.structure import MAD_TO_SIGMA

STRIPS = 6
MOST_PIXELS = 48  # of a line in a strip
AROUND, NEAR = 7, 41  # lines
LEAST, LEAST_SCALE_DN = 6.0, 0.5
MOST_BESIDE = 0.25
MOST_CLIPPED = 2  # strips
DARKEST_DN, BRIGHTEST_DN = 6.0, 249.0
LEAST_LINES = 64


def dead_lines(levels: NDArray[np.uint8]) -> int:
    """Number of rows and columns that stand out over their whole length.

    Args:
        levels: (H, W) grey levels, 0..255.

    Returns:
        0 where a side is too short to tell.
    """
    return sum(int(_dead_rows(lines).sum()) for lines in (levels, levels.T))


def _dead_rows(levels: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Which rows (H,) stand out."""
    height, width = levels.shape
    if min(height, width) < LEAST_LINES:
        return np.zeros(height, bool)
    strips = np.array_split(np.arange(width), STRIPS)
    chosen = [strip[:: -(-len(strip) // MOST_PIXELS)] for strip in strips]
    profile = np.stack([np.median(levels[:, columns], axis=1) for columns in chosen])
    around = median_filter(profile, (1, AROUND), mode="nearest")
    apart = profile - around
    beside = np.maximum(np.abs(apart[:, :-2]), np.abs(apart[:, 2:]))
    beside = np.pad(beside, ((0, 0), (1, 1)), constant_values=np.inf)
    sharp = np.median(beside / np.maximum(np.abs(apart), LEAST_SCALE_DN), axis=0) < MOST_BESIDE
    scale = np.maximum(MAD_TO_SIGMA * median_filter(np.abs(apart), (1, NEAR), mode="nearest"), LEAST_SCALE_DN)
    dead = np.zeros(height, bool)
    for sign, shows in ((1, around < BRIGHTEST_DN), (-1, around > DARKEST_DN)):
        stands_out = (sign * apart > LEAST * scale) | ~shows
        dead |= stands_out.all(axis=0) & (np.count_nonzero(~shows, axis=0) <= MOST_CLIPPED)
    return dead & sharp
