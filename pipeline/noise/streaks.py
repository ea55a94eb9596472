"""Streaks of equal pixels, as a median filter leaves them.

The medians of two windows that overlap by six of nine pixels are often the same pixel's value. So neighbours are equal
far more often than their differences, of standard deviation s, suggest (streaking: Bovik, IEEE Trans. ASSP 35, 1987; as
a trace of such filters: Kirchner and Fridrich, Media Forensics and Security 2010). With h_0 the fraction of differences
of adjacent pixels that are 0, and h_1 half the fraction of those that are 1 or -1 DN,

    excess = ln(h_0 / h_1) - 1 / (2 s^2)

is 0 for normal noise, white or not; what is left of noise behind a median filter looks neither white nor like what a
camera's processing leaves, so that its size is not known. Differences are those of the flattest third of the windows,
and must vary by more than `LEAST_DN`: in smooth areas most neighbours are equal anyway. Too few grey levels, as of a
picture that was brightened, show the same.

Chosen on frames of KITTI, Udacity, *Sim* and that of the paper's authors: with noise of 5 and 10 DN behind medians of
3 and 5 px the excess is 0.6 to 1.5, with noise alone, smoothed or not, 0.3 at most; of patches of the photographs CC,
PolyU and PennFudan 0, 1 and 6 % exceed `LEAST_EXCESS`.
"""

from __future__ import annotations

import numpy as np

from pipeline.noise.base import WHITE_DN
from pipeline.noise.correlated_features import LEAST_WINDOWS, SIDE, Windows

FLATTEST = 0.3
LEAST_DN = 1.2
LEAST_EXCESS = 0.65


def streaked(windows: Windows) -> bool:
    """Whether neighbours in a patch are equal more often than noise leaves them.

    Args:
        windows: of adjacent pixels (`pipeline.noise.correlated_features.fine_windows`).
    """
    count = max(int(FLATTEST * len(windows.power)), 1)
    flattest = np.argpartition(windows.power, count - 1)[:count]
    values = windows.values.take(flattest, axis=0)
    levels = values + windows.means.take(flattest)[:, None]
    values = values[(levels.min(axis=1) > 1.5) & (levels.max(axis=1) < WHITE_DN - 1.5)]  # the rest may be clipped
    if len(values) < LEAST_WINDOWS:
        return False
    square = values.reshape(-1, SIDE, SIDE)
    across, down = np.diff(square, axis=2).ravel(), np.diff(square, axis=1).ravel()
    steps = np.abs(np.concatenate([across, down]))
    power = float(np.square(steps).mean())
    if power < LEAST_DN**2:
        return False
    equal, one = np.count_nonzero(steps < 0.5), np.count_nonzero((steps > 0.5) & (steps < 1.5)) / 2
    return bool(np.log((equal + 1) / (one + 1)) - 1 / (2 * power) > LEAST_EXCESS)
