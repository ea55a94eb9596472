"""Which pixels of a skeleton image inform about the kernel: strong gradients whose neighbours agree.

L. Xu and J. Jia, "Two-phase kernel estimation for robust motion deblurring", ECCV 2010: in fine texture the
gradients of a window cancel, and edges narrower than the kernel mislead it.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

STRONG_FRACTION = 0.1  # of the pixels, by gradient magnitude
AGREEING_FRACTION = 0.3  # of the pixels, by agreement in the window
WINDOW_PX = 5
AGREEMENT_OFFSET = 0.5  # keeps the ratio low where there is no gradient at all
SLACK = 0.1  # relative, on the fractions
BISECTIONS = 100


def gradients(image: NDArray) -> NDArray:
    """(2, h, w): horizontal and vertical forward differences, zero in the last column and row."""
    both = np.zeros((2, *image.shape), image.dtype)
    both[0, :, :-1] = image[:, 1:] - image[:, :-1]
    both[1, :-1] = image[1:] - image[:-1]
    return both


def bisected_threshold(values: NDArray, fraction: float) -> float:
    """A threshold that a given fraction of the values exceeds, to +-10 % of the fraction.

    Args:
        values: non-negative numbers.
        fraction: in (0, 1).
    """
    low, high = 0.0, float(values.max())
    threshold = high / 2
    for _ in range(BISECTIONS):
        above = np.count_nonzero(values > threshold) / values.size
        if (1 - SLACK) * fraction < above < (1 + SLACK) * fraction:
            break
        if above < fraction:
            high = threshold
        else:
            low = threshold
        threshold = (low + high) / 2
    return threshold


def _box(values: NDArray) -> NDArray:
    """Sum over the window, border replicated."""
    return cv2.boxFilter(values, -1, (WINDOW_PX, WINDOW_PX), normalize=False, borderType=cv2.BORDER_REPLICATE)


def informative_gradients(image: NDArray) -> NDArray:
    """Gradients of a skeleton image, zero where they inform little.

    Kept are the strongest 10 % that also belong to the 30 % with the largest |sum g| / (sum |g| + 0.5) over 5 x 5
    pixels.

    Args:
        image: (h, w) in [0, 1].

    Returns:
        (2, h, w).
    """
    slope = gradients(image)
    magnitude = np.sqrt(slope[0] * slope[0] + slope[1] * slope[1])
    across, down = _box(slope[0]), _box(slope[1])
    agreement = np.sqrt(across * across + down * down) / (_box(magnitude) + AGREEMENT_OFFSET)
    strong = magnitude > bisected_threshold(magnitude, STRONG_FRACTION)
    agreeing = agreement > bisected_threshold(agreement, AGREEING_FRACTION)
    return slope * (strong & agreeing)
