"""Noise level by block selection and Gaussian filtering, "B+F" (Shin et al. 2005; as in Wischow et al. 2023).

1. A patch is cut into blocks 16 px wide and 8 px high; the standard deviation of each is taken. The smallest, s_min, is
   a first guess of the noise.
2. Blocks whose standard deviation agrees with s_min are homogeneous: with s_min's fraction below one half,
   ``|floor(s) - floor(s_min)| < 2``, else ``|round(s) - round(s_min)| < 2`` (halves to even).
3. Each homogeneous block is smoothed on its own by a Gaussian of standard deviation s_min px on ``ceil(3 s_min)`` taps
   (made odd; mirrored at the block's border without repeating the edge).
4. sigma is the standard deviation of (block - smoothed block) over all homogeneous blocks.

Where s_min is at most 1/3 DN the filter has a single tap and step 4 gives 0 whatever the noise: such a patch is
answered with 0 and the interval from 0 to what normal noise may have been where the quietest of M blocks varies so
little. With F the distribution of chi squared of n - 1 = 127 degrees of freedom (n pixels of a block, by which its sum
of squares is divided), the quietest falls below q sigma in one of twenty patches,

    sigma <= s_min / q,     1 - (1 - F(n q^2))^M = 0.05.

A block that does not vary at all is no such bound (it has been clipped or smoothed by the camera), and the patch is
flat. Elsewhere the method has no interval: its error is bias (the filter follows part of the noise), not scatter.
Where every block varies by more than 100 DN, none is homogeneous and the patch is abstained from as ``"uncertain"``.
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincinv

from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.camera.saturation import SATURATED_FRACTION
from pipeline.noise.base import LEAST_SIGMA_DN, UNCERTAIN, Estimator, Measured

BLOCK_WIDTH_PX = 16
BLOCK_HEIGHT_PX = 8

START_DN = 100.0
"""The authors' search for the smallest standard deviation starts here, so s_min is never larger."""

_CHUNK = 16


class BlockAndFilter(Estimator):
    """B+F noise estimator. Pixels right of and below the last whole block are not used.

    Args:
        quantise_like_paper: patches and smoothed blocks are 8 bit (with OpenCV's fixed-point kernels), the answer is in
            whole DN (truncated), and nothing abstains (0 instead), as in the authors' program.
        saturated_fraction: of saturated pixels, (0, 1], from which a patch is refused.

    Raises:
        InputError: a fraction out of range.
    """

    min_size_px = 32  # eight blocks

    def __init__(self, quantise_like_paper: bool = False, saturated_fraction: float = SATURATED_FRACTION) -> None:
        super().__init__(saturated_fraction, quantise_like_paper=quantise_like_paper)

    def measure(self, stack: NDArray[np.floating], reason: NDArray[np.object_]) -> Measured:
        """See `pipeline.noise.base.Estimator.measure`."""
        sigma_dn, quietest_dn = np.empty(len(stack)), np.empty(len(stack))
        for first in range(0, len(stack), _CHUNK):
            part = slice(first, first + _CHUNK)
            sigma_dn[part], quietest_dn[part] = _estimate(stack[part], self.quantise_like_paper)
        reason[(reason == "") & np.isnan(sigma_dn)] = UNCERTAIN
        unresolved = _taps(quietest_dn) == 1
        nan = np.full(len(stack), np.nan)
        most_dn = quietest_dn / _least_ratio(stack.shape[1] // BLOCK_HEIGHT_PX * (stack.shape[2] // BLOCK_WIDTH_PX))
        return Measured(sigma_dn, np.where(unresolved, 0.0, nan), np.where(unresolved, most_dn, nan))


@functools.lru_cache(maxsize=16)
def _least_ratio(blocks: int) -> float:
    """Smallest deviation of so many blocks of normal noise over its sigma, which 95 % of patches exceed."""
    pixels = BLOCK_WIDTH_PX * BLOCK_HEIGHT_PX
    chi_squared = 2 * gammaincinv((pixels - 1) / 2, 1 - 0.95 ** (1 / blocks))
    return float(np.sqrt(chi_squared / pixels))


def _estimate(stack: NDArray[np.floating], eight_bit: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Raw estimate and smallest block deviation, both (n,) DN, of patches (n, H, W) in [0, 1]."""
    height = stack.shape[1] // BLOCK_HEIGHT_PX * BLOCK_HEIGHT_PX
    width = stack.shape[2] // BLOCK_WIDTH_PX * BLOCK_WIDTH_PX
    # A fixed grey as origin keeps whole numbers whole, so that float32 sums over a block stay exact for 8-bit patches.
    patch = np.multiply(stack[:, :height, :width], FULL_SCALE_DN, dtype=np.float32)
    if eight_bit:
        patch = np.rint(patch)
    patch = patch - np.float32(128.0)
    deviation = np.sqrt(_block_moments(patch)[1])
    quietest = np.minimum(deviation.min(axis=(1, 2)), START_DN)
    chosen = _homogeneous(deviation, quietest)
    smooth = _smooth_blocks(patch, quietest, eight_bit)
    mean, variance = _block_moments(patch - smooth)
    count = chosen.sum(axis=(1, 2))
    centre = (mean * chosen).sum(axis=(1, 2)) / np.maximum(count, 1)
    spread = variance + (mean - centre[:, None, None]) ** 2
    sigma = np.sqrt((spread * chosen).sum(axis=(1, 2)) / np.maximum(count, 1))
    # With every block above START_DN none may agree with it; the authors' program then has nothing to pool.
    return np.where(count > 0, sigma, np.nan), quietest


def _block_moments(patch: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean and population variance of each block, each (n, rows, columns), of (n, H, W)."""
    size = BLOCK_WIDTH_PX * BLOCK_HEIGHT_PX
    mean = _block_sums(patch) / size
    variance = _block_sums(np.square(patch)) / size - mean * mean
    return mean, np.maximum(variance, 0.0)


def _block_sums(values: NDArray[np.float32]) -> NDArray[np.float64]:
    """Sum over each block, (n, rows, columns), of (n, H, W), as two matrix products: down, then along."""
    n, height, width = values.shape
    down = np.ones((1, BLOCK_HEIGHT_PX), dtype=np.float32) @ values.reshape(-1, BLOCK_HEIGHT_PX, width)
    along = down.reshape(-1, BLOCK_WIDTH_PX) @ np.ones(BLOCK_WIDTH_PX, dtype=np.float32)
    return along.reshape(n, height // BLOCK_HEIGHT_PX, width // BLOCK_WIDTH_PX).astype(np.float64)


def _homogeneous(deviation: NDArray[np.float64], quietest: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which blocks (n, rows, columns) agree with the smallest deviation (n,)."""
    least = quietest[:, None, None]
    by_floor = np.abs(np.floor(deviation) - np.floor(least)) < 2
    by_round = np.abs(np.rint(deviation) - np.rint(least)) < 2
    return np.where(np.rint(least) - np.floor(least) < 1, by_floor, by_round)


def _taps(sigma_px: NDArray[np.float64]) -> NDArray[np.int64]:
    """Length of the Gaussian: ceil(3 sigma), made odd, at least 1."""
    taps = np.ceil(3.0 * sigma_px).astype(np.int64)
    return taps + (taps % 2 == 0)


def _smooth_blocks(patch: NDArray[np.float32], sigma_px: NDArray[np.float64], eight_bit: bool) -> NDArray[np.float32]:
    """Every block of every patch smoothed on its own, (n, H, W); patch n by a Gaussian of sigma_px[n]."""
    n, height, width = patch.shape
    kernels = _gaussians(sigma_px)
    if eight_bit:
        kernels = np.stack([_fixed_point(kernel) for kernel in kernels])
    radius = kernels.shape[1] // 2
    # One matrix per patch and direction. Float64 up to here, so that a patch does not feel its batch's longest kernel.
    down = (kernels @ _mirrored(BLOCK_HEIGHT_PX, radius)).astype(np.float32).reshape(n, 1, *2 * (BLOCK_HEIGHT_PX,))
    along = (kernels @ _mirrored(BLOCK_WIDTH_PX, radius)).astype(np.float32).reshape(n, *2 * (BLOCK_WIDTH_PX,))
    columns = down @ patch.reshape(n, -1, BLOCK_HEIGHT_PX, width)
    smooth = columns.reshape(n, -1, BLOCK_WIDTH_PX) @ np.ascontiguousarray(along.transpose(0, 2, 1))
    if eight_bit:  # fixed point with 8 fractional bits each way; a constant offset passes a unit-sum kernel unchanged
        smooth = np.floor(smooth + np.float32(0.5))
    return smooth.reshape(n, height, width)


def _gaussians(sigma_px: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sampled Gaussians of unit sum and `_taps` taps each, in the middle of rows as long as the longest, (n, k)."""
    half = _taps(sigma_px) // 2
    offset = np.arange(-half.max(), half.max() + 1)
    with np.errstate(under="ignore"):  # far taps are 0
        kernels = np.exp(-0.5 * (offset / np.maximum(sigma_px, LEAST_SIGMA_DN)[:, None]) ** 2)
    kernels *= np.abs(offset) <= half[:, None]
    kernels /= kernels.sum(axis=1, keepdims=True)
    return kernels


def _fixed_point(kernel: NDArray[np.float64]) -> NDArray[np.float64]:
    """The kernel (k,) in multiples of 1/256, as OpenCV smooths 8-bit images.

    Rounded from the outside in, each rounding error carried to the next tap, and the rest given to the middle.
    """
    rounded = kernel.copy()
    middle, carried = len(kernel) // 2, 0.0
    for index in range(middle):
        wanted = kernel[index] * 256.0 + carried
        carried = wanted - np.rint(wanted)
        rounded[index] = rounded[-1 - index] = np.rint(wanted) / 256.0
    rounded[middle] = 1.0 - 2.0 * rounded[:middle].sum()
    return rounded


@functools.lru_cache(maxsize=256)
def _mirrored(size: int, radius: int) -> NDArray[np.float64]:
    """0 and 1: tap o of output pixel i reads pixel j of a block mirrored at both ends, (2 radius + 1, size * size)."""
    reach = np.arange(size)[None, :] + np.arange(-radius, radius + 1)[:, None]
    period = 2 * (size - 1)
    source = (size - 1) - np.abs(reach % period - (size - 1))
    table = np.zeros((2 * radius + 1, size, size))
    taps, outputs = np.indices(source.shape)
    table[taps, outputs, source] = 1.0
    return table.reshape(2 * radius + 1, size * size)
