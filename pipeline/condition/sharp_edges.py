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
rest. There other edges are soft: of the blocks of 12 x 12 px with as high a contrast, those whose steepest slope,
whatever its direction, is less than a fifth of it after averaging over 3 x 3 px. Of charts none is, at 0 to 10 DN of
noise and behind a lens of MTF50 down to .38; a patch with more than a twentieth of them keeps its estimate. Ours.
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
SOFT_SLOPE, MOST_SOFT = 0.2, 0.05
LEAST_MTF50 = ((0.25, 0.30, 0.36, 0.46, 0.60), (0.0, 0.13, 0.18, 0.25, 0.40))
"""Steepness of edges -> MTF50, fraction of Nyquist, that the patch has at least; by straight lines."""


def contradicted(estimate: BlurEstimate, patches: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Patches whose edges are sharper than their estimate of blur allows, along either axis, and hardly any is soft.

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
        too_steep = (most[index] < np.interp(steepness(levels), *LEAST_MTF50)).any()
        result[index] = too_steep and soft_share(levels) <= MOST_SOFT
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


def soft_share(levels: NDArray[np.float32]) -> float:
    """Share of soft edges among blocks of high contrast; 0 without such blocks.

    Args:
        levels: (H, W), DN.
    """
    smooth = np.asarray(cv2.blur(levels, (AVERAGED_ROWS, AVERAGED_ROWS)), np.float32)
    slope = np.hypot(smooth[:-1, 1:] - smooth[:-1, :-1], smooth[1:, :-1] - smooth[:-1, :-1])
    rows, columns = (side // SPAN_PX for side in slope.shape)

    def blocks(values: NDArray[np.float32]) -> NDArray[np.float32]:
        whole = values[: rows * SPAN_PX, : columns * SPAN_PX]
        return whole.reshape(rows, SPAN_PX, columns, SPAN_PX)

    most, height = blocks(smooth).max(axis=(1, 3)), np.ptp(blocks(smooth), axis=(1, 3))
    counts = (height >= _needed_dn(smooth, float(sigma_dn(levels[None])[0]))) & (most < WHITE_DN)
    soft = blocks(slope).max(axis=(1, 3)) < SOFT_SLOPE * height
    return float(np.mean(soft[counts])) if counts.any() else 0.0


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
