"""Sparse kernels: keep the largest coefficients of a tight wavelet frame.

The undecimated piecewise linear framelet (Ron and Shen 1997): three filters per axis, nine subbands, periodic.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

# each filter at offsets -1, 0, +1
FILTERS = np.array([[1.0, 2.0, 1.0], [math.sqrt(2.0), 0.0, -math.sqrt(2.0)], [-1.0, 2.0, -1.0]]) / 4.0


def _filtered(data: NDArray, taps: NDArray, axis: int) -> NDArray:
    """Circular convolution along one axis."""
    before, here, after = (data.dtype.type(tap) for tap in taps)
    return before * np.roll(data, -1, axis) + here * data + after * np.roll(data, 1, axis)


def decompose(kernel: NDArray) -> NDArray:
    """(9, n, n) coefficients of an (n, n) kernel: row filter slowest."""
    return np.stack([_filtered(_filtered(kernel, down, 0), across, 1) for down in FILTERS for across in FILTERS])


def reconstruct(coefficients: NDArray) -> NDArray:
    """The (n, n) kernel of (9, n, n) coefficients: the adjoint, which inverts `decompose`."""
    kernel = np.zeros_like(coefficients[0])
    for index, band in enumerate(coefficients):
        down, across = FILTERS[index // 3], FILTERS[index % 3]
        kernel += _filtered(_filtered(band, across[::-1], 1), down[::-1], 0)
    return kernel


def keep_largest(kernel: NDArray, fraction: float = 0.05) -> NDArray:
    """The kernel from its largest frame coefficients.

    Exact ties occur at the border of the support; of equal coefficients the later one in the order (subband,
    column, row) stays.

    Args:
        kernel: (n, n).
        fraction: of all 9 n^2 coefficients that stays.
    """
    bands = decompose(kernel)
    ordered = bands.transpose(0, 2, 1).reshape(-1)
    order = np.argsort(np.abs(ordered), kind="stable")
    ordered[order[: math.floor(len(order) * (1 - fraction))]] = 0
    size = len(kernel)
    return reconstruct(ordered.reshape(9, size, size).transpose(0, 2, 1))
