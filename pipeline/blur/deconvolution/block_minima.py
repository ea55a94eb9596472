"""Shrinking the smallest pixel of every block of an image: the proximal step of a sparse-minima prior.

Blocks of r x r pixels tile the image from its top left corner. Hard shrinking sets minima m with
|m| < min(max(lambda, mean |m|), 0.1) to zero; soft shrinking replaces m by max(m - lambda, 0).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

LARGEST_HARD_THRESHOLD = 0.1


def _hard_threshold(minima: NDArray, weight: float) -> float:
    return min(max(weight, float(np.abs(minima).mean())), LARGEST_HARD_THRESHOLD)


def shrink_first(image: NDArray, block: int, weight: float, hard: bool) -> None:
    """Shrink one pixel per block in place: of equal minima the first, down columns.

    Args:
        image: (h, w); blocks at the right and bottom border may be smaller.
        block: r, pixels.
        weight: lambda.
        hard: how, see above.
    """
    height, width = image.shape
    rows, columns = -(-height // block), -(-width // block)
    padded = np.full((rows * block, columns * block), np.inf, image.dtype)
    padded[:height, :width] = image
    # one row per block, pixels down columns
    split = padded.reshape(rows, block, columns, block).transpose(0, 2, 3, 1)
    blocks = split.reshape(rows * columns, block * block)
    where = blocks.argmin(axis=1)
    minima = blocks[np.arange(len(blocks)), where]
    if hard:
        minima[np.abs(minima) < _hard_threshold(minima, weight)] = 0
    else:
        minima = np.maximum(minima - image.dtype.type(weight), 0)
    block_row, block_column = np.divmod(np.arange(len(blocks)), columns)
    column, row = np.divmod(where, block)
    image[block_row * block + row, block_column * block + column] = minima


def shrink_all(image: NDArray, block: int, weight: float, hard: bool) -> None:
    """Shrink the minima in place, all of equal ones; several times faster than `shrink_first`.

    Equal minima are common in 8-bit images only, that is at the first step of a deconvolution.

    Args:
        image: (h, w), C-contiguous, both sides multiples of ``block``.
        block: r, pixels.
        weight: lambda.
        hard: how, see above.
    """
    height, width = image.shape
    bands = image.reshape(height // block, block, width)
    lowest = np.minimum.reduce(bands, axis=1)
    minima = lowest[:, 0::block]
    for offset in range(1, block):
        minima = np.minimum(minima, lowest[:, offset::block])
    if hard:
        # what is not to be changed equals no pixel
        marked = np.where(np.abs(minima) < _hard_threshold(minima, weight), minima, np.inf).astype(image.dtype)
        bands *= bands != np.repeat(marked, block, axis=1)[:, None]
    else:
        change = np.maximum(minima - image.dtype.type(weight), 0) - minima
        bands += (bands == np.repeat(minima, block, axis=1)[:, None]) * np.repeat(change, block, axis=1)[:, None]
