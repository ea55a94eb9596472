"""Periodic images: kernels as transfer functions, forward differences and their adjoint, without copies."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import fft


def kernel_spectrum(kernel: NDArray, shape: tuple[int, int]) -> NDArray:
    """Transfer function of a centred odd kernel on a periodic (h, w) image, real transform layout."""
    around = np.zeros(shape, kernel.dtype)
    height, width = kernel.shape
    around[:height, :width] = kernel
    return fft.rfft2(np.roll(around, (-(height // 2), -(width // 2)), axis=(0, 1)))


def power(spectrum: NDArray) -> NDArray:
    """|spectrum|^2."""
    return spectrum.real**2 + spectrum.imag**2


@lru_cache(maxsize=64)
def laplacian_spectrum(shape: tuple[int, int], dtype: np.dtype) -> NDArray:
    """|DFT of the forward differences|^2, both directions together, real transform layout; read-only."""
    down = 2 - 2 * np.cos(2 * np.pi * np.arange(shape[0]) / shape[0])
    across = 2 - 2 * np.cos(2 * np.pi * np.arange(shape[1] // 2 + 1) / shape[1])
    spectrum = (down[:, None] + across).astype(dtype)
    spectrum.setflags(write=False)
    return spectrum


class Differences:
    """Forward differences d of one image shape, x(i + 1) - x(i), and their adjoint.

    The arrays given out are kept and overwritten by the next call: use them before.
    """

    def __init__(self, shape: tuple[int, int], dtype: np.dtype) -> None:
        self.across, self.down, self.result = (np.empty(shape, dtype) for _ in range(3))

    def of(self, image: NDArray) -> tuple[NDArray, NDArray]:
        """Horizontal and vertical differences of a C-contiguous (h, w) image, each (h, w)."""
        # along the memory first, row ends corrected after: three times as fast as row by row
        flat = image.reshape(-1)
        np.subtract(flat[1:], flat[:-1], out=self.across.reshape(-1)[:-1])
        np.subtract(image[:, 0], image[:, -1], out=self.across[:, -1])
        np.subtract(image[1:], image[:-1], out=self.down[:-1])
        np.subtract(image[0], image[-1], out=self.down[-1])
        return self.across, self.down

    def adjoint(self, across: NDArray, down: NDArray) -> NDArray:
        """D' (across, down): what flows into each pixel, (h, w)."""
        result = self.result
        flat = across.reshape(-1)
        np.subtract(flat[:-1], flat[1:], out=result.reshape(-1)[1:])
        np.subtract(across[:, -1], across[:, 0], out=result[:, 0])
        result[1:] += down[:-1]
        result[0] += down[-1]
        result -= down
        return result
