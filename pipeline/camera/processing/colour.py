"""Colour: the matrix from a sensor's colours to sRGB primaries, and luma and chroma of encoded pictures (BT.601)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float32]


def matrix(diagonal: tuple[float, float, float], split: tuple[float, float, float] = (0.5, 0.5, 0.5)) -> Float:
    """A colour matrix whose rows sum to 1, so that grey stays grey.

    Args:
        diagonal: how much of its own colour each output takes, 1 to 2; what exceeds 1 is taken off the other two.
        split: of each row: how much of what is taken off comes from the first of the other two colours, 0 to 1.

    Returns:
        (3, 3) float32.
    """
    rows = np.zeros((3, 3))
    for row in range(3):
        first, second = (column for column in range(3) if column != row)
        rows[row, row] = diagonal[row]
        rows[row, first] = (1 - diagonal[row]) * split[row]
        rows[row, second] = (1 - diagonal[row]) * (1 - split[row])
    return rows.astype(np.float32)


def apply(rgb: Float, colour_matrix: Float) -> Float:
    """Colours (H, W, 3) through a (3, 3) matrix."""
    return np.asarray(rgb @ colour_matrix.T, dtype=np.float32)


def to_luma_chroma(rgb: Float) -> Float:
    """Encoded red, green, blue (H, W, 3) in [0, 1] to luma and two chroma planes, chroma about 0.5."""
    import cv2

    planes: NDArray[Any] = cv2.cvtColor(rgb, cv2.COLOR_RGB2YCrCb)
    return planes


def to_rgb(luma_chroma: Float) -> Float:
    """Inverse of `to_luma_chroma`."""
    import cv2

    rgb: NDArray[Any] = cv2.cvtColor(luma_chroma, cv2.COLOR_YCrCb2RGB)
    return rgb
