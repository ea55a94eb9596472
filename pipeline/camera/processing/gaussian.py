"""The Gaussian by which a camera denoises, softens and finds what to sharpen, and its transfer function.

    transfer(f) = exp(-2 pi^2 r^2 f^2)

Below `LEAST_PX` the kernel is a single pixel: neither does anything.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

LEAST_PX = 0.15


def blurred(plane: NDArray[np.float32], radius_px: float) -> NDArray[np.float32]:
    """A plane (H, W) blurred by a Gaussian of this standard deviation, boundaries reflected."""
    import cv2

    if radius_px < LEAST_PX:
        return plane
    return np.asarray(cv2.GaussianBlur(plane, (0, 0), float(radius_px), borderType=cv2.BORDER_REFLECT_101))


def transfer(radius_px: float, frequencies: NDArray[Any]) -> NDArray[Any]:
    """Contrast that the blur keeps, of the shape of the frequencies, in cycles per pixel."""
    if radius_px < LEAST_PX:
        return np.ones_like(frequencies)
    return np.asarray(np.exp(-2 * np.pi**2 * radius_px**2 * frequencies**2))
