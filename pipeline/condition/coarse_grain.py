"""How much noise a frame may hold that is coarser than what noise estimators look for.

Estimators tell noise from the picture by the finest detail. In a frame that was enlarged after the noise came in, by a
digital zoom say, the finest detail is smooth: noise is taken for the picture, read as none, and bounded far too low. A
blurred frame without noise looks alike. Both vary the more the further pixels lie apart, even where they vary least:

    v_s(tile) = root of the mean variance in the flattest tenth of its windows of 4 x 4 pixels that lie s px apart

    most noise = FACTOR q_0.1(v_4)    where    median(v_2) > SMOOTH median(v_1)

over the tiles of the frame, q the quantile. Elsewhere there is fine detail, and the estimators' own bounds stand. A
blurred frame without noise nearly always has some smooth tiles, so that it is still bounded to a few grey levels.

The constants were chosen on 42 frames of KITTI, Udacity, *Sim* and that of the paper's authors, Penn-Fudan and means
of CC and PolyU. With noise of 3 / 10 / 25 DN, enlarged 3 to 6 times by bicubic interpolation, 98 / 100 / 94 % are
smooth in this sense, and the bound holds in 100 / 100 / 94 % of these; enlarged twice up to 12 % are, not enlarged
none. Without noise half are smooth as they are and nine of ten that are blurred or enlarged, bounded by 1 to 4 DN by
the median.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.camera.constants import FULL_SCALE_DN

SMOOTH = 1.75
"""Variation of flat areas at 2 px over that at 1 px: 1 for white noise, 2 for a slope."""

FACTOR = 2.5
"""Noise over the variation of the flattest tenth of windows of 13 px: 1.2 to 2.1 for noise enlarged 3 to 6 times."""

SIDE = 4
STEP = 2  # between windows of adjacent pixels, which overlap by more than half otherwise
FLATTEST = 0.1
CLIPPED_DN = (8.0, 247.0)  # means of windows below and above which noise may be lost
TILES = 0.1  # of the tiles that vary least


def most_coarse_noise_dn(tiles: NDArray[np.floating]) -> float:
    """The most noise that a frame without fine detail may hold.

    Args:
        tiles: (N, 1, H, W) of the frame that are neither flat nor saturated, float in [0, 1], sides of at least 16 px.

    Returns:
        DN; NaN where the frame has fine detail, which estimators read noise from, or no tile.
    """
    if not len(tiles):
        return float("nan")
    finest, fine, far = (_variations(tiles, spacing) for spacing in (1, 2, 4))
    if not (len(fine) and len(far)) or not np.median(fine) > SMOOTH * np.median(finest):
        return float("nan")
    return float(FACTOR * np.quantile(far, TILES))


def _variations(tiles: NDArray[np.floating], spacing: int) -> NDArray[np.float64]:
    """`_variation` of those of the tiles (N, 1, H, W) that have one."""
    each = np.array([_variation(tile[0], spacing) for tile in tiles])
    return each[np.isfinite(each)]


def _variation(tile: NDArray[np.floating], spacing: int) -> float:
    """Root mean variance, DN, in the flattest tenth of a tile's windows of pixels so far apart; NaN where all clip."""
    pixels = np.ascontiguousarray(tile[::spacing, ::spacing], dtype=np.float64) * FULL_SCALE_DN
    mean = cv2.boxFilter(pixels, cv2.CV_64F, (SIDE, SIDE), borderType=cv2.BORDER_REFLECT)
    square = cv2.sqrBoxFilter(pixels, cv2.CV_64F, (SIDE, SIDE), borderType=cv2.BORDER_REFLECT)
    inside = slice(SIDE // 2, 1 - SIDE // 2, STEP if spacing == 1 else 1)  # windows that lie in the tile
    mean, square = mean[inside, inside], square[inside, inside]
    variance = np.maximum(square - mean**2, 0.0)[(mean > CLIPPED_DN[0]) & (mean < CLIPPED_DN[1])]
    if not len(variance):
        return float("nan")
    count = max(int(FLATTEST * len(variance)), 1)
    return float(np.sqrt(np.partition(variance, count - 1)[:count].mean() * SIDE**2 / (SIDE**2 - 1)))
