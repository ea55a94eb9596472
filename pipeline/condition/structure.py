"""Whether a patch holds structure that blur can be read from along both axes, or only a gradient and noise, or stripes.

Estimators of blur abstain from patches without variation. A clear sky, a wall or a defocused cap vary too: by shading
and by noise, neither of which tells blur. The means of blocks of 16 x 16 px hardly hold noise any more, and shading is
a quadratic surface in them; what remains is structure, however blurred:

    s = std(block means - quadratic surface),    structureless: s < max(1 DN, 1.5 sigma / 16)

with the noise sigma by the median absolute deviation of second differences d = (I(0,0) - I(0,1) - I(1,0) + I(1,1)) / 2.

A fence, blinds or a single edge vary in one direction only: along its lines nothing tells how blurred they are, and
estimators take their straightness for blur along them. With l1 <= l2, the eigenvalues of the structure tensor, the mean
of grad grad^T over the patch smoothed with s = 4 px,

    striped: l1 - n < 0.005 (l2 - n),    n = sigma^2 / (8 pi s^4), the part of white noise in each,

because a blurred picture still varies along its motion at the scale of s, if less. Of some 625 patches of KITTI,
Udacity, *Sim* of the paper's authors and Penn-Fudan none is striped as recorded, with 5 or 10 DN of noise or behind
JPEG 50; one is with 20 DN and one out of focus by a Gaussian of 8 px, 1 to 2 moved by 41 px, 2 to 3 by 81 px; of 64
patches of CC none, of 78 of PolyU two, which hold a wire and two edges. Of 120 patches of upright bars turned by 5 to
12 degrees all are, behind JPEG 85 or with 8 DN of noise too. Ours; the tensor is that of Foerstner and Guelch (1987).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.constants import FULL_SCALE_DN

STRUCTURELESS = "structureless"
"""Reason: the patch holds shading and noise only."""

STRIPED = "striped"
"""Reason: the patch varies in one direction only."""

BLOCK_PX = 16
LEAST_DN = 1.0
NOISE_FACTOR = 1.5
MAD_TO_SIGMA = 1.4826
STRIDE_PX = 6  # of the second differences looked at
SMOOTHED_PX = 4.0
LEAST_RATIO = 0.005  # of the eigenvalues of the structure tensor, without noise
ROUNDING_DN = 12**-0.5


def structureless(patches: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Patches that hold nothing but shading and noise.

    Args:
        patches: (N, 1, H, W) in [0, 1], at least 64 px each way.

    Returns:
        (N,).
    """
    count, _, height, width = patches.shape
    rows, columns = height // BLOCK_PX, width // BLOCK_PX
    levels = patches[:, 0].astype(np.float32, copy=False) * np.float32(FULL_SCALE_DN)
    whole = levels[:, : rows * BLOCK_PX, : columns * BLOCK_PX]
    means = whole.reshape(count, rows, BLOCK_PX, columns, BLOCK_PX).mean(axis=(2, 4), dtype=np.float64)
    flat = means.reshape(count, -1)
    surface = _surface(rows, columns)
    left = (flat - flat @ surface @ surface.T).std(axis=1)
    noise_dn = sigma_dn(levels)
    return np.asarray(left < np.maximum(LEAST_DN, NOISE_FACTOR * noise_dn / BLOCK_PX))


def striped(patches: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Patches whose structure has one direction, along which it tells no blur.

    Args:
        patches: (N, 1, H, W) in [0, 1], at least 64 px each way.

    Returns:
        (N,).
    """
    levels = patches[:, 0].astype(np.float32, copy=False) * np.float32(FULL_SCALE_DN)
    noise = np.maximum(sigma_dn(levels), ROUNDING_DN) ** 2 / (8 * np.pi * SMOOTHED_PX**4)
    across, mixed, down = np.array([_structure_tensor(patch) for patch in levels], float).reshape(-1, 3).T
    middle, reach = (across + down) / 2 - noise, np.hypot((across - down) / 2, mixed)
    return np.asarray(middle - reach < LEAST_RATIO * (middle + reach))


def _structure_tensor(levels: NDArray[np.float32]) -> tuple[float, float, float]:
    """Mean of g_x^2, g_x g_y and g_y^2, DN^2 per square pixel, of a patch (H, W) smoothed with `SMOOTHED_PX`."""
    import cv2

    height, width = levels.shape
    half = cv2.resize(levels, (width // 2, height // 2), interpolation=cv2.INTER_AREA)  # quarters the time
    smooth = cv2.GaussianBlur(half, (0, 0), SMOOTHED_PX / 2)
    # Within two s of the border, smoothing mirrors lines that meet it aslant.
    inside = slice(round(SMOOTHED_PX), -round(SMOOTHED_PX))
    g_x, g_y = (
        cv2.Sobel(smooth, cv2.CV_32F, *axis, ksize=1, scale=0.25)[inside, inside].ravel() for axis in ((1, 0), (0, 1))
    )
    return float(g_x @ g_x) / g_x.size, float(g_x @ g_y) / g_x.size, float(g_y @ g_y) / g_x.size


def sigma_dn(levels: NDArray[np.float32]) -> NDArray[np.floating]:
    """(N,) noise of patches (N, H, W) in DN, by second differences."""
    down, across = slice(0, -1, STRIDE_PX), slice(1, None, STRIDE_PX)
    twice = levels[:, down, down] - levels[:, down, across] - levels[:, across, down] + levels[:, across, across]
    return np.asarray(MAD_TO_SIGMA * np.median(np.abs(twice.reshape(len(levels), -1)), axis=1) / 2)


@lru_cache(maxsize=4)
def _surface(rows: int, columns: int) -> NDArray[np.float64]:
    """(rows columns, 6) orthonormal columns that span the quadratic surfaces."""
    y, x = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, columns), indexing="ij")
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1).reshape(-1, 6)
    return np.asarray(np.linalg.qr(terms)[0])
