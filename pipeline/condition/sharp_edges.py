"""Edges that are sharper than the blur read from their patch allows: the estimate is wrong, or of a part only.

Blur of a point to the line spread l(x) spreads a step of any height h over its neighbours: one pixel holds at most
h max l of it. A grid of dots, a chart of discs or a sharp fence before a wall out of focus have few fine details, which
estimators take for strong blur; their steps tell. Of every upright step along an axis, over nine rows,

    s = least step from pixel to pixel / (greatest - least level within 12 px along the axis),

where the denominator is large, so that no step beyond the 12 px explains it: at least 35 % of the range of the patch,
six times the noise sigma and 20 DN, or 90 DN; steps to white are left out, as light beyond it is cut off. The eighth
largest s of a patch is at most .35 where it was moved by 5 px, .32 by 9, .22 by 15, .44 behind a disc of defocus of
5 px, .26 of 9, .31 and .25 behind Gaussians of 5 and 9 px full width (250 patches of KITTI, Udacity, Penn-Fudan, CC and
PolyU with 0, 3 and 15 DN of noise), and .3 to .4 at an edge behind a lens whose contrast falls to half at .38 of
Nyquist. The lower bound on MTF50 drawn through these kernels is `LEAST_MTF50`.

A patch that is sharp in part, before a background out of focus, has such steps too, and its estimate is right of the
rest. There other edges are soft. The slope of a block of 12 x 12 px with as high a contrast is the steepest one in it,
in any direction, after averaging over 3 x 3 px, as part of that contrast in one pixel; t is the slope that 95 % of the
blocks reach. Of charts of dots, discs, squares, letters, bricks and rings t is .32 to .4 behind a lens of MTF50 .75,
.27 to .32 of .38, .18 to .21 of .19 and .13 to .17 of .12. A patch with t < .2 keeps its estimate.

That also tells of edges that lie aslant, as of a star, where all of twelve blocks or more, with a contrast of 30 sigma,
are steep: behind discs of 5, 7 and 11 px t is at most .26, .21 and .16, moved aslant by 7, 9 and 15 px .30, .35 and .25
(357 patches of the same datasets, with 0 and 4 DN). Edges along a motion stay sharp, so the bound drawn through these,
`LEAST_MTF50_ASLANT`, is of the axis with less blur. Ours.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.blur.base import BlurEstimate
from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.condition.structure import sigma_dn
from pipeline.condition.summary import half_contrast

CONTRADICTED = "contradicted"
"""Reason: edges of the patch are sharper than the estimate allows."""

ROWS, SPAN_PX = 9, 12
AVERAGED_ROWS = 3  # before the least step of the others is taken: less noise
LEAST_SHARE, LEAST_SIGMAS, LEAST_DN, ENOUGH_DN = 0.35, 6.0, 20.0, 90.0
WHITE_DN = 250.0
RANK = 8
SOFT_SLOPE, SOFTEST_SHARE = 0.2, 0.05
LEAST_BLOCKS, CLEAR_SIGMAS = 12, 30.0
LEAST_MTF50 = ((0.25, 0.30, 0.36, 0.46, 0.60), (0.0, 0.13, 0.18, 0.25, 0.40))
"""Steepness of edges -> MTF50, fraction of Nyquist, that the patch has at least; by straight lines."""
LEAST_MTF50_ASLANT = ((0.22, 0.26, 0.30, 0.34), (0.0, 0.11, 0.23, 0.26))
"""Slope of nearly all blocks -> MTF50 along the axis with less blur, likewise."""


def contradicted(estimate: BlurEstimate, patches: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Patches whose edges are sharper than their estimate of blur allows: steps along an axis, or nearly all edges.

    Args:
        estimate: of N patches; what counts is the upper end of its interval, where it has one.
        patches: (N, 1, H, W) in [0, 1].

    Returns:
        (N,).
    """
    most = half_contrast(estimate.mtf if estimate.high is None else estimate.high)  # (N, 2)
    result = np.zeros(len(patches), bool)
    for index in np.flatnonzero((most < LEAST_MTF50[1][-1]).any(axis=1)):
        levels = patches[index, 0].astype(np.float32, copy=False) * np.float32(FULL_SCALE_DN)
        result[index] = _has_steep_steps(levels, most[index]) or _is_steep_everywhere(levels, most[index])
    return result


def steepness(levels: NDArray[np.float32]) -> tuple[float, float]:
    """Part of their height that the steepest steps of a patch rise within one pixel, along x and along y.

    Args:
        levels: (H, W), DN.

    Returns:
        0..1 each; 0 where it is too little to tell anything, or without steps that are high enough.
    """
    noise = float(sigma_dn(levels[None])[0])
    return _along_x(levels, noise), _along_x(np.ascontiguousarray(levels.T), noise)


def slopes(levels: NDArray[np.float32], least_sigmas: float = LEAST_SIGMAS) -> NDArray[np.float32]:
    """Slopes of the blocks of high contrast; see the module.

    Args:
        levels: (H, W), DN.
        least_sigmas: of noise, contrast that is enough.

    Returns:
        (blocks,) part of their contrast in one pixel.
    """
    smooth = np.asarray(cv2.blur(levels, (AVERAGED_ROWS, AVERAGED_ROWS)), np.float32)
    slope = np.zeros_like(smooth)
    slope[:-1, :-1] = np.hypot(smooth[:-1, 1:] - smooth[:-1, :-1], smooth[1:, :-1] - smooth[:-1, :-1])
    rows, columns = (side // SPAN_PX for side in slope.shape)

    def blocks(values: NDArray[np.float32]) -> NDArray[np.float32]:
        whole = values[: rows * SPAN_PX, : columns * SPAN_PX]
        return whole.reshape(rows, SPAN_PX, columns, SPAN_PX)

    noise_dn = float(sigma_dn(levels[None])[0])
    most, height = blocks(smooth).max(axis=(1, 3)), np.ptp(blocks(smooth), axis=(1, 3))
    counts = (height >= max(_needed_dn(smooth, noise_dn), least_sigmas * noise_dn)) & (most < WHITE_DN)
    # The last slopes of a block are to pixels beyond it.
    return np.asarray((blocks(slope)[:, :-1, :, :-1].max(axis=(1, 3))[counts] / height[counts]), np.float32)


def _has_steep_steps(levels: NDArray[np.float32], most: NDArray[np.floating]) -> bool:
    """Whether upright steps rule out an MTF50 (2,) along their axis, and no other edges are soft."""
    if not (most < np.interp(steepness(levels), *LEAST_MTF50)).any():
        return False
    slope = slopes(levels)
    return not slope.size or float(np.quantile(slope, SOFTEST_SHARE)) >= SOFT_SLOPE


def _is_steep_everywhere(levels: NDArray[np.float32], most: NDArray[np.floating]) -> bool:
    """Whether nearly all edges rule out an MTF50 (2,) of both axes."""
    if not (most < LEAST_MTF50_ASLANT[1][-1]).all():
        return False
    slope = slopes(levels, CLEAR_SIGMAS)
    if slope.size < LEAST_BLOCKS:
        return False
    return bool((most < np.interp(np.quantile(slope, SOFTEST_SHARE), *LEAST_MTF50_ASLANT)).all())


def _needed_dn(levels: NDArray[np.float32], noise_dn: float) -> float:
    """Height from which a step of a patch counts."""
    return min(max(LEAST_SHARE * float(np.ptp(levels)), LEAST_SIGMAS * noise_dn, LEAST_DN), ENOUGH_DN)


def _along_x(levels: NDArray[np.float32], noise_dn: float) -> float:
    smooth = np.asarray(cv2.blur(levels, (1, AVERAGED_ROWS)), np.float32)
    step = smooth[:, 1:] - smooth[:, :-1]
    rows = ROWS - AVERAGED_ROWS + 1
    column, around = np.ones((rows, 1), np.uint8), np.ones((rows, SPAN_PX), np.uint8)
    rise = np.maximum(cv2.erode(step, column), cv2.erode(-step, column))
    needed_dn = _needed_dn(smooth, noise_dn)
    if rise.max() < LEAST_MTF50[0][0] * needed_dn:  # as of most patches that are blurred, which saves half the time
        return 0.0
    anchor = (SPAN_PX // 2 - 1, rows // 2)
    most, least = cv2.dilate(smooth, around, anchor=anchor)[:, :-1], cv2.erode(smooth, around, anchor=anchor)[:, :-1]
    height = most - least
    counts = (height >= needed_dn) & (most < WHITE_DN)
    # What lies beyond the patch is not known.
    counts[:, : SPAN_PX // 2] = counts[:, -SPAN_PX // 2 :] = False
    counts[: ROWS // 2] = counts[-(ROWS // 2) :] = False
    if np.count_nonzero(counts) < RANK:
        return 0.0
    return max(float(np.partition(rise[counts] / height[counts], -RANK)[-RANK]), 0.0)
