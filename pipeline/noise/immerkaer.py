"""Noise level from one Laplacian mask (Immerkaer, Computer Vision and Image Understanding 64(2), 1996).

The difference of two Laplacians, ``[[1, -2, 1], [-2, 4, -2], [1, -2, 1]]``, is blind to constant, linear and straight
second-order structure; on white noise its output has standard deviation 6 sigma. The mean absolute value then gives::

    sigma = sqrt(pi / 2) / 6 * mean |I * N|

The cheapest baseline of all. It reads fine texture as noise. It has no interval.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.noise.base import (
    SATURATED_FRACTION,
    WHITE_DN,
    NoiseEstimate,
    as_stack,
    assemble,
    check_fraction,
    screen,
)

if TYPE_CHECKING:
    import torch

LEAST_PX = 8
_MASK = np.outer([1.0, -2.0, 1.0], [1.0, -2.0, 1.0]).astype(np.float32)


class Immerkaer:
    """Fast noise variance estimation.

    Args:
        saturated_fraction: share of clipped pixels, (0, 1], from which a patch is refused.

    Raises:
        InputError: a share out of range.
    """

    def __init__(self, saturated_fraction: float = SATURATED_FRACTION) -> None:
        self.saturated_fraction = check_fraction("saturated_fraction", saturated_fraction)

    def estimate(self, patches: NDArray[np.floating] | torch.Tensor) -> NoiseEstimate:
        """See `pipeline.noise.base.NoiseEstimator.estimate`; patches of at least 8 x 8 px."""
        stack = as_stack(patches, LEAST_PX)
        sigma_dn = np.array([_sigma_dn(patch) for patch in stack], dtype=np.float64).reshape(len(stack))
        return assemble(sigma_dn, screen(stack, self.saturated_fraction))


def _sigma_dn(patch: NDArray[np.floating]) -> float:
    """One patch, (H, W) in [0, 1]; the one-pixel border is left out."""
    inner = cv2.filter2D(np.ascontiguousarray(patch, dtype=np.float32), cv2.CV_32F, _MASK)[1:-1, 1:-1]
    mean = cv2.norm(inner, cv2.NORM_L1) / inner.size
    return WHITE_DN * math.sqrt(math.pi / 2.0) / 6.0 * mean
