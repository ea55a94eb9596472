"""Gradient information of a frame: the mapping shared by Shim et al. (2014, 2018) and Shin et al. (2019).

``g~ = log(lambda (g - gamma) + 1) / log(lambda (1 - gamma) + 1)`` for a normalised gradient ``g >= gamma``, else 0,
with ``lambda = 1000`` and ``gamma = 0.06``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

LAMBDA, THRESHOLD = 1000.0, 0.06
_SOBEL_FULL_SCALE = 4.0 * np.sqrt(2.0)  # magnitude of a unit step along both axes


def sobel_magnitude(image: NDArray[np.floating]) -> NDArray[np.float32]:
    """(H, W) magnitude of the 3x3 Sobel gradient, 0..1 for images in [0, 1]; borders replicated."""
    import cv2

    frame = np.ascontiguousarray(image, dtype=np.float32)
    x, y = (
        cv2.Sobel(frame, cv2.CV_32F, dx, dy, ksize=3, borderType=cv2.BORDER_REPLICATE) for dx, dy in ((1, 0), (0, 1))
    )
    return np.asarray(np.hypot(x, y) / np.float32(_SOBEL_FULL_SCALE), dtype=np.float32)


def information(gradient: NDArray[np.floating]) -> NDArray[np.float32]:
    """Mapped gradient, 0..1; weak gradients, mostly noise, count nothing."""
    above = np.maximum(gradient - np.float32(THRESHOLD), np.float32(0.0))
    mapped = np.log1p(np.float32(LAMBDA) * above) / np.float32(np.log1p(LAMBDA * (1.0 - THRESHOLD)))
    return np.asarray(mapped, dtype=np.float32)
