"""Colour filter array: one colour per pixel, in the Bayer pattern RGGB (red at [0, 0], blue at [1, 1])."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float32]
RED, GREEN, BLUE = 0, 1, 2


def mosaic(rgb: Float) -> Float:
    """The colour that each pixel's filter passes.

    Args:
        rgb: (H, W, 3) linear light.

    Returns:
        (H, W) float32: red at even rows and columns, blue at odd ones, green elsewhere.
    """
    raw = rgb[..., GREEN].copy()
    raw[0::2, 0::2] = rgb[0::2, 0::2, RED]
    raw[1::2, 1::2] = rgb[1::2, 1::2, BLUE]
    return raw


def per_pixel(shape: tuple[int, int], red: float, blue: float) -> Float:
    """A factor per colour as a plane over the mosaic, 1 at green pixels.

    Args:
        shape: (H, W).
        red: factor of the red pixels.
        blue: factor of the blue pixels.

    Returns:
        (H, W) float32.
    """
    plane = np.ones(shape, np.float32)
    plane[0::2, 0::2] = red
    plane[1::2, 1::2] = blue
    return plane
