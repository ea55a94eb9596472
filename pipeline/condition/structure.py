"""Whether a patch holds structure that blur can be read from, or only a gradient and noise.

Estimators of blur abstain from patches without variation. A clear sky, a wall or a defocused cap vary too: by shading
and by noise, neither of which tells blur. The means of blocks of 16 x 16 px hardly hold noise any more, and shading is
a quadratic surface in them; what remains is structure, however blurred:

    s = std(block means - quadratic surface),    structureless: s < max(1 DN, 1.5 sigma / 16)

with the noise sigma by the median absolute deviation of second differences d = (I(0,0) - I(0,1) - I(1,0) + I(1,1)) / 2.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.constants import FULL_SCALE_DN

STRUCTURELESS = "structureless"
"""Reason: the patch holds shading and noise only."""

BLOCK_PX = 16
LEAST_DN = 1.0
NOISE_FACTOR = 1.5
MAD_TO_SIGMA = 1.4826
STRIDE_PX = 6  # of the second differences looked at


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
    down, across = slice(0, -1, STRIDE_PX), slice(1, None, STRIDE_PX)
    twice = levels[:, down, down] - levels[:, down, across] - levels[:, across, down] + levels[:, across, across]
    sigma_dn = MAD_TO_SIGMA * np.median(np.abs(twice.reshape(count, -1)), axis=1) / 2
    return np.asarray(left < np.maximum(LEAST_DN, NOISE_FACTOR * sigma_dn / BLOCK_PX))


@lru_cache(maxsize=4)
def _surface(rows: int, columns: int) -> NDArray[np.float64]:
    """(rows columns, 6) orthonormal columns that span the quadratic surfaces."""
    y, x = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, columns), indexing="ij")
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1).reshape(-1, 6)
    return np.asarray(np.linalg.qr(terms)[0])
