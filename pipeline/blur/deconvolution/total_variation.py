"""Total-variation denoising before blind deblurring.

    x = argmin_x  1/2 ||x - y||^2 + weight (|dx|_1 + |dy|_1)

by split Bregman iterations (Goldstein and Osher, SIAM J. Imaging Sci. 2009) in the Fourier domain, stopped after a
few steps.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft

MARGIN_PX = 8  # replicated around the image
FRAME_PX = 4  # of zeros behind the margin: the periodic domain is that much larger


def denoise(image: NDArray, weight: float = 0.01, penalty: float = 0.1, steps: int = 10) -> NDArray:
    """Remove noise and texture, keep edges.

    Args:
        image: (h, w) in [0, 1].
        weight: of the total variation.
        penalty: of the splitting.
        steps: iterations.

    Returns:
        (h, w), about [0, 1].
    """
    padded = np.pad(image, MARGIN_PX, mode="edge")
    height, width = padded.shape
    shape = (height + FRAME_PX, width + FRAME_PX)
    down = 2 - 2 * np.cos(2 * np.pi * np.arange(shape[0]) / shape[0])
    across = 2 - 2 * np.cos(2 * np.pi * np.arange(shape[1] // 2 + 1) / shape[1])
    denominator = (1 + penalty * (down[:, None] + across)).astype(image.dtype)
    data = fft.rfft2(padded, s=shape)
    split = np.zeros((2, height, width), image.dtype)  # the sparse gradients, horizontal and vertical
    multiplier = np.zeros_like(split)
    slope = np.zeros_like(split)
    limit = weight / penalty
    result = padded
    for _ in range(steps):
        field = np.zeros((2, *shape), image.dtype)
        field[:, :height, :width] = split + multiplier
        adjoint = np.roll(field[0], 1, 1) - field[0] + np.roll(field[1], 1, 0) - field[1]
        spectrum = (data + image.dtype.type(penalty) * fft.rfft2(adjoint)) / denominator
        result = fft.irfft2(spectrum, s=shape)[:height, :width]
        slope[0, :, :-1] = np.diff(result, axis=1)
        slope[1, :-1] = np.diff(result, axis=0)
        shifted = slope - multiplier
        split = np.sign(shifted) * np.maximum(np.abs(shifted) - limit, 0)
        multiplier -= slope - split
    return result[MARGIN_PX:-MARGIN_PX, MARGIN_PX:-MARGIN_PX].astype(image.dtype)
