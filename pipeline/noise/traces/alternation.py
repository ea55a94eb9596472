"""Patterns that alternate from pixel to pixel: a raw colour mosaic, interlaced fields, a checkerboard.

Statistics of neighbouring pixels take them for noise, of any size. In the spectrum they are lines at half the sampling
frequency f_N, along rows, columns or both, where pictures and noise have little or as much as beside it. With windowed
Fourier coefficients F_b of blocks b of 16 x 16 px, and means over four fifths of the blocks (the greatest powers are
of a few bright edges),

    line = mean |F_b(f_N)|^2,    beside = mean |F_b(5/8 f_N)|^2,

a patch alternates where ``line > 4 beside`` and the pattern's amplitude ``sqrt(line - beside)`` exceeds 0.6 DN. A Hann
window keeps gradients of the picture out.

Chosen on frames of eight sets (KITTI, Udacity, the authors' *Sim*, PennFudan, CC, PolyU, charts, photographs), of
whose 4,784 patches none alternates, on raw frames of a FLIR Flea3, of which 70 % do, the rest being dark or without
colour, and on colour frames of KITTI turned into mosaics, of which 89 % do.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.constants import FULL_SCALE_DN

BLOCK_PX = 16
LEAST_DN = 0.6
LEAST_RATIO = 4.0
BESIDE = 5 / 8
"""Of half the sampling frequency: three of the window's bins away, beyond its main lobe."""
KEPT = 0.8  # of the blocks, those with the least power
DARKEST = 1e-3  # DN^2; where nothing varies, nothing is four times as strong


def alternating(stack: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Patches that alternate from pixel to pixel.

    Args:
        stack: (N, H, W) in [0, 1], at least 16 px each way.

    Returns:
        (N,).
    """
    count, down, across = len(stack), _windows(stack.shape[1]), _windows(stack.shape[2])
    levels = stack.astype(np.float32, copy=False) * np.float32(FULL_SCALE_DN)
    rows, columns = len(down) // 4, len(across) // 4
    blocks = (down @ levels @ across.T).reshape(count, 4, rows, 4, columns)
    powers = (blocks.astype(np.float64) ** 2).swapaxes(2, 3).reshape(count, 4, 4, rows * columns)
    kept = max(1, int(KEPT * rows * columns))
    power = np.partition(powers, kept - 1)[..., :kept].mean(axis=-1)
    mean, line, cosine, sine = range(4)
    beside_rows = (power[:, mean, cosine] + power[:, mean, sine]) / 2
    beside_columns = (power[:, cosine, mean] + power[:, sine, mean]) / 2
    beside_both = power[:, (line, line, cosine, sine), (cosine, sine, line, line)].mean(axis=1)
    alternates = np.zeros(count, np.bool_)
    for at, beside in (
        (power[:, mean, line], beside_rows),
        (power[:, line, mean], beside_columns),
        (power[:, line, line], beside_both),
    ):
        alternates |= (at > LEAST_RATIO * np.maximum(beside, DARKEST)) & (at - beside > LEAST_DN**2)
    return alternates


@lru_cache(maxsize=16)
def _windows(side_px: int) -> NDArray[np.float32]:
    """(4 blocks, side) weights of pixels: the mean of every block, then the line, then cosine and sine beside it."""
    blocks, pixel = side_px // BLOCK_PX, np.arange(side_px)
    hann = (1 - np.cos(2 * np.pi * (pixel + 0.5) / BLOCK_PX)) / BLOCK_PX
    waves = (
        np.ones(side_px), np.where(pixel % 2, -1.0, 1.0),
        np.sqrt(2) * np.cos(np.pi * BESIDE * pixel), np.sqrt(2) * np.sin(np.pi * BESIDE * pixel),
    )  # fmt: skip
    mine = pixel // BLOCK_PX == np.arange(blocks)[:, None]
    return np.concatenate([np.where(mine, hann * wave, 0.0) for wave in waves]).astype(np.float32)
