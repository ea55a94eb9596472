"""Noise level from one Laplacian mask (Immerkaer, Computer Vision and Image Understanding 64(2), 1996).

The difference of two Laplacians, ``[[1, -2, 1], [-2, 4, -2], [1, -2, 1]]``, is blind to constant, linear and straight
second-order structure; on white noise its output has standard deviation 6 sigma. The mean absolute value then gives::

    sigma = sqrt(pi / 2) / 6 * mean |I * N|

The cheapest baseline of all. It reads fine texture as noise. It has no interval.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.camera.saturation import SATURATED_FRACTION
from pipeline.noise.base import Estimator, Measured

_MASK = np.outer([1.0, -2.0, 1.0], [1.0, -2.0, 1.0]).astype(np.float32)


class Immerkaer(Estimator):
    """Fast noise variance estimation.

    Args:
        saturated_fraction: of saturated pixels, (0, 1], from which a patch is refused.

    Raises:
        InputError: a fraction out of range.
    """

    min_size_px = 8

    def __init__(self, saturated_fraction: float = SATURATED_FRACTION) -> None:
        super().__init__(saturated_fraction)

    def measure(self, stack: NDArray[np.floating], reason: NDArray[np.object_]) -> Measured:
        """See `pipeline.noise.base.Estimator.measure`."""
        return Measured(np.array([_sigma_dn(patch) for patch in stack], dtype=np.float64).reshape(len(stack)))


def _sigma_dn(patch: NDArray[np.floating]) -> float:
    """One patch, (H, W) in [0, 1]; the one-pixel border is left out."""
    inner = cv2.filter2D(np.ascontiguousarray(patch, dtype=np.float32), cv2.CV_32F, _MASK)[1:-1, 1:-1]
    mean = cv2.norm(inner, cv2.NORM_L1) / inner.size
    return FULL_SCALE_DN * math.sqrt(math.pi / 2.0) / 6.0 * mean
