"""The latent image of the patch-wise minimal pixels prior.

F. Wen, R. Ying, Y. Liu, P. Liu, T.-K. Truong, "A simple local minimal intensity prior and an improved algorithm
for blind image deblurring", IEEE TCSVT 2021. Blurring lifts the darkest pixel of every small block; a sharp
image has sparse minima and sparse gradients. Half-quadratic splitting alternates

    minima of S  <- shrunk by lambda,
    g = (gh, gv) <- circular gradients of S where gh^2 + gv^2 >= mu / alpha, else 0,
    S            <- argmin ||k * S - y||^2 + alpha ||grad S - g||^2   (closed form in the Fourier domain)

while alpha grows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import DTypeLike, NDArray
from scipy import fft

LARGEST_HARD_THRESHOLD = 0.1


@dataclass(frozen=True)
class Schedule:
    """How often the splitting is solved.

    Attributes:
        inner: solves per penalty.
        growth: of the penalty alpha.
        last_penalty: alpha stays below this.
        dtype: float64 or float32.
    """

    inner: int = 3
    growth: float = 2.0
    last_penalty: float = 1e5
    dtype: DTypeLike = np.float64


def kernel_spectrum(kernel: NDArray, shape: tuple[int, int]) -> NDArray:
    """Transfer function of a centred odd kernel on a periodic (h, w) image, real transform layout."""
    around = np.zeros(shape, kernel.dtype)
    height, width = kernel.shape
    around[:height, :width] = kernel
    return fft.rfft2(np.roll(around, (-(height // 2), -(width // 2)), axis=(0, 1)))


class Blocks:
    """Minima of r x r blocks of one image shape; blocks at the right and bottom may be smaller."""

    def __init__(self, shape: tuple[int, int], size: int, dtype: DTypeLike) -> None:
        self.shape, self.size = shape, size
        self.rows, self.columns = -(-shape[0] // size), -(-shape[1] // size)
        self.padded = np.full((self.rows * size, self.columns * size), np.inf, dtype)

    def shrink(self, image: NDArray, weight: float, hard: bool) -> None:
        """Shrink every block's minimum in place; of equal ones the first, down columns.

        Args:
            image: (h, w), changed.
            weight: lambda.
            hard: minima below min(max(lambda, mean |minima|), 0.1) become 0; otherwise soft threshold by lambda.
        """
        height, width = self.shape
        size = self.size
        self.padded[:height, :width] = image
        # one row per block, pixels down columns
        split = self.padded.reshape(self.rows, size, self.columns, size).transpose(0, 2, 3, 1)
        blocks = split.reshape(self.rows * self.columns, size * size)
        where = blocks.argmin(axis=1)
        minima = blocks[np.arange(len(blocks)), where]
        if hard:
            threshold = min(max(weight, float(np.abs(minima).mean())), LARGEST_HARD_THRESHOLD)
            minima[np.abs(minima) < threshold] = 0
        else:
            minima = np.maximum(minima - image.dtype.type(weight), 0)
        block_row, block_column = np.divmod(np.arange(len(blocks)), self.columns)
        column, row = np.divmod(where, size)
        image[block_row * size + row, block_column * size + column] = minima


def latent_image(
    wrapped: NDArray,
    kernel: NDArray,
    minima_weight: float,
    gradient_weight: float,
    block: int,
    hard: bool,
    schedule: Schedule,
) -> NDArray:
    """The sharp image, given the blurred one and the kernel.

    Args:
        wrapped: (h, w) blurred image, periodic.
        kernel: (n, n) centred, unit sum.
        minima_weight: lambda.
        gradient_weight: mu.
        block: side of the blocks, pixels.
        hard: see `Blocks.shrink`.
        schedule: penalties.

    Returns:
        (h, w).
    """
    shape = wrapped.shape
    transfer = kernel_spectrum(kernel, shape)
    data = transfer.conj() * fft.rfft2(wrapped)
    fidelity = transfer.real**2 + transfer.imag**2
    down = 2 - 2 * np.cos(2 * np.pi * np.arange(shape[0]) / shape[0])
    across = 2 - 2 * np.cos(2 * np.pi * np.arange(shape[1] // 2 + 1) / shape[1])
    smoothness = (down[:, None] + across).astype(wrapped.dtype)  # |DFT of the forward differences|^2
    blocks = Blocks(shape, block, wrapped.dtype)
    image = wrapped.copy()
    right, below, power, divergence = (np.empty_like(image) for _ in range(4))
    penalty = 2 * gradient_weight
    while penalty < schedule.last_penalty:
        denominator = fidelity + wrapped.dtype.type(penalty) * smoothness
        for _ in range(schedule.inner):
            blocks.shrink(image, minima_weight, hard)
            np.subtract(image[:, 1:], image[:, :-1], out=right[:, :-1])
            np.subtract(image[:, 0], image[:, -1], out=right[:, -1])
            np.subtract(image[1:], image[:-1], out=below[:-1])
            np.subtract(image[0], image[-1], out=below[-1])
            np.multiply(right, right, out=power)
            np.multiply(below, below, out=divergence)
            power += divergence
            keep = power >= gradient_weight / penalty
            right *= keep
            below *= keep
            np.add(right, below, out=divergence)  # minus the adjoint of the differences
            np.negative(divergence, out=divergence)
            divergence[:, 1:] += right[:, :-1]
            divergence[:, 0] += right[:, -1]
            divergence[1:] += below[:-1]
            divergence[0] += below[-1]
            spectrum = fft.rfft2(divergence)
            spectrum *= wrapped.dtype.type(penalty)
            spectrum += data
            spectrum /= denominator
            image = fft.irfft2(spectrum, s=shape, overwrite_x=True)
        penalty *= schedule.growth
    return image
