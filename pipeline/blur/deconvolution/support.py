"""The support of a blur kernel: drop what is weak or isolated, keep it in the middle, unit sum."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.blur.deconvolution.failure import NoKernel


def normalise(kernel: NDArray) -> NDArray:
    """Clip to non-negative values and scale to unit sum.

    Raises:
        NoKernel: nothing positive, or not finite.
    """
    kernel = np.maximum(kernel, 0)
    total = kernel.sum()
    if not (np.isfinite(total) and total > 0):
        raise NoKernel("the kernel vanished")
    return kernel / total


def drop_weak(kernel: NDArray, fraction: float = 0.05) -> NDArray:
    """Set what is below a fraction of the maximum to zero; unit sum."""
    return normalise(np.where(kernel < fraction * kernel.max(), 0, kernel))


def drop_islands(kernel: NDArray, least_mass: float = 0.1) -> NDArray:
    """Set 8-connected parts of the kernel with less than ``least_mass`` to zero; unit sum."""
    count, labels = cv2.connectedComponents((kernel != 0).astype(np.uint8), connectivity=8)
    if count > 2:  # the background is one of them
        mass = np.bincount(labels.ravel(), weights=kernel.ravel())
        kernel = np.where(mass[labels] < least_mass, 0, kernel)
    return normalise(kernel)


def shifted(kernel: NDArray, down: int, right: int) -> NDArray:
    """Move a kernel by whole pixels, zeros coming in."""
    height, width = kernel.shape
    moved = np.zeros_like(kernel)
    if abs(down) < height and abs(right) < width:
        moved[max(down, 0) : height + min(down, 0), max(right, 0) : width + min(right, 0)] = kernel[
            max(-down, 0) : height - max(down, 0), max(-right, 0) : width - max(right, 0)
        ]
    return moved


def _round_half_away(value: float) -> int:
    return int(np.copysign(np.floor(abs(value) + 0.5), value))


def centre_mass(kernel: NDArray) -> NDArray:
    """Move the centroid to within half a pixel of the middle; unit sum."""
    height, width = kernel.shape
    row = float(kernel.sum(axis=1) @ np.arange(height)) / float(kernel.sum())
    column = float(kernel.sum(axis=0) @ np.arange(width)) / float(kernel.sum())
    down, right = _round_half_away((height - 1) / 2 - row), _round_half_away((width - 1) / 2 - column)
    return normalise(shifted(kernel, down, right))


def centre_box(kernel: NDArray, fraction: float = 0.1) -> NDArray:
    """Move the box of rows and columns that matter to the middle; unit sum.

    A row (column) matters when its sum exceeds ``fraction`` of the kernel's largest **value**. A box whose middle
    falls between two pixels comes to lie half a pixel down (right).
    """
    shifts = []
    for axis in (1, 0):
        sums = kernel.sum(axis=axis)
        result = np.flatnonzero(sums > fraction * kernel.max())
        shifts.append((len(sums) - 1) // 2 - int(result[0] + result[-1]) // 2)
    return normalise(shifted(kernel, *shifts))
