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

from pipeline.blur.deconvolution.block_minima import shrink_all, shrink_first
from pipeline.blur.deconvolution.boundary import fast_length
from pipeline.blur.deconvolution.periodic import Differences, kernel_spectrum, laplacian_spectrum, power


@dataclass(frozen=True)
class Schedule:
    """How often, and how exactly, the splitting is solved.

    Attributes:
        inner: solves per penalty.
        growth: of the penalty alpha.
        last_penalty: alpha stays below this.
        aligned: make the periodic image a whole number of blocks, and treat equal minima alike.
        dtype: float64 or float32.
    """

    inner: int = 3
    growth: float = 2.0
    last_penalty: float = 1e5
    aligned: bool = False
    dtype: DTypeLike = np.float64

    def length(self, least: int, block: int) -> int:
        """Side of the periodic image: at least ``least`` pixels."""
        return block * fast_length(-(-least // block)) if self.aligned else fast_length(least)


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
        hard: how minima are shrunk, see `block_minima`.
        schedule: of the penalties.

    Returns:
        (h, w).
    """
    shape, number = wrapped.shape, wrapped.dtype.type
    transfer = kernel_spectrum(kernel, (shape[0], shape[1]))
    data = transfer.conj() * fft.rfft2(wrapped)
    fidelity = power(transfer)
    smoothness = laplacian_spectrum((shape[0], shape[1]), wrapped.dtype)
    grid = Differences((shape[0], shape[1]), wrapped.dtype)
    shrink = shrink_all if schedule.aligned else shrink_first
    square, other = np.empty_like(wrapped), np.empty_like(wrapped)
    image = wrapped.copy()
    penalty = 2 * gradient_weight
    while penalty < schedule.last_penalty:
        scale = 1 / (fidelity + number(penalty) * smoothness)
        for _ in range(schedule.inner):
            shrink(image, block, minima_weight, hard)
            across, down = grid.of(image)
            np.multiply(across, across, out=square)
            np.multiply(down, down, out=other)
            square += other
            keep = square >= gradient_weight / penalty
            across *= keep
            down *= keep
            spectrum = fft.rfft2(grid.adjoint(across, down))
            spectrum *= number(penalty)
            spectrum += data
            spectrum *= scale
            image = fft.irfft2(spectrum, s=shape, overwrite_x=True)
        penalty *= schedule.growth
    return image
