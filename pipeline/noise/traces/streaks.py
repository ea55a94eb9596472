"""Streaks of equal pixels, as a median filter leaves them.

The medians of two windows that overlap by six of nine pixels are often the same pixel's value. So neighbours are equal
far more often than their differences, of standard deviation s, suggest (streaking: Bovik, IEEE Trans. ASSP 35, 1987; as
a trace of such filters: Kirchner and Fridrich, Media Forensics and Security 2010). With h_0 the fraction of differences
of adjacent pixels that are 0, and h_1 half the fraction of those that are 1 or -1,

    excess = ln(h_0 / h_1) - 1 / (2 s^2)

is 0 for normal noise, white or not; what is left of noise behind a median filter looks neither white nor like what a
camera's processing leaves, so that its size is not known. Grey levels are counted by their rank among those that the
patch has, so that a picture whose contrast was stretched, which has gaps between its levels, is judged as before.
Differences are those of the flattest windows without clipped pixels, and must vary: in smooth areas most neighbours are
equal anyway.

Chosen on frames of KITTI, Udacity, *Sim* and that of the paper's authors with noise of 5 and 10 DN. Behind a median of
3 px the excess is 0.7 to 1.5, behind one of 5 px 0.6 to 0.9, where of 5 DN most patches vary too little to be judged.
With noise alone, smoothed or not, it is 0.3 at most. Local equalisation of the histogram looks the same.
"""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.noise.base import WHITE_DN
from pipeline.noise.networks.correlated_features import LEAST_WINDOWS, SIDE, Windows

JUDGED_FRACTION = 0.3  # of the windows, the flattest
LEAST_STEP = 1.2
"""Standard deviation of the differences, in ranks, below which too many neighbours are equal without a filter."""
LEAST_EXCESS = 0.65


def streaked(windows: Windows) -> bool:
    """Whether neighbours in a patch are equal more often than noise leaves them.

    Args:
        windows: of adjacent pixels (`pipeline.noise.networks.correlated_features.fine_windows`).

    Returns:
        False also where fewer than `LEAST_WINDOWS` are free of clipped pixels.
    """
    pixels, power = windows.values + windows.means[:, None], windows.power
    levels = np.rint(pixels, out=pixels).astype(np.uint8)
    if levels.size and (levels.min() <= 1 or levels.max() >= WHITE_DN - 1):
        unclipped = ((levels > 1) & (levels < WHITE_DN - 1)).all(axis=1)
        levels, power = levels[unclipped], power[unclipped]
    if len(levels) < LEAST_WINDOWS:
        return False
    count = max(int(JUDGED_FRACTION * len(levels)), LEAST_WINDOWS)
    flattest = np.argpartition(power, count - 1)[:count]
    rank = np.cumsum(cv2.calcHist([levels], [0], None, [256], [0, 256]) > 0)
    square = rank[levels[flattest]].reshape(-1, SIDE, SIDE)
    steps = np.abs(np.concatenate([np.diff(square, axis=2).ravel(), np.diff(square, axis=1).ravel()]))
    power_of_steps = float(np.square(steps).mean())
    if power_of_steps < LEAST_STEP**2:
        return False
    equal, one = np.count_nonzero(steps == 0), np.count_nonzero(steps == 1) / 2
    return bool(np.log((equal + 1) / (one + 1)) - 1 / (2 * power_of_steps) > LEAST_EXCESS)
