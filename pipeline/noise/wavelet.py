"""Noise level from the finest wavelet coefficients (Donoho and Johnstone, Biometrika 81(3), 1994).

``sigma = median |d| / Phi^-1(3/4)`` over the diagonal details d of one level of a Daubechies-2 transform, as
`skimage.restoration.estimate_sigma` computes it. A widely used baseline: robust to sparse edges, not to dense texture.
It has no interval.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

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


class WaveletMedian:
    """Median absolute deviation of the finest wavelet details.

    Args:
        saturated_fraction: share of clipped pixels, (0, 1], from which a patch is refused.

    Raises:
        InputError: a share out of range.
    """

    def __init__(self, saturated_fraction: float = SATURATED_FRACTION) -> None:
        self.saturated_fraction = check_fraction("saturated_fraction", saturated_fraction)

    def estimate(self, patches: NDArray[np.floating] | torch.Tensor) -> NoiseEstimate:
        """See `pipeline.noise.base.NoiseEstimator.estimate`; patches of at least 8 x 8 px."""
        from skimage.restoration import estimate_sigma

        stack = as_stack(patches, LEAST_PX)
        reason = screen(stack, self.saturated_fraction)
        sigma_dn = np.full(len(stack), np.nan)
        for index in np.flatnonzero(reason == ""):
            sigma_dn[index] = WHITE_DN * estimate_sigma(stack[index], channel_axis=None)
        return assemble(sigma_dn, reason)
