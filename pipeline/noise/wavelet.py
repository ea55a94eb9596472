"""Noise level from the finest wavelet coefficients (Donoho and Johnstone, Biometrika 81(3), 1994).

``sigma = median |d| / Phi^-1(3/4)`` over the diagonal details d of one level of a Daubechies-2 transform, as
`skimage.restoration.estimate_sigma` computes it. A widely used baseline: robust to sparse edges, not to dense texture.
It has no interval.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.camera.saturation import SATURATED_FRACTION
from pipeline.noise.base import Estimator, Measured


class WaveletMedian(Estimator):
    """Median absolute deviation of the finest wavelet details.

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
        from skimage.restoration import estimate_sigma

        sigma_dn = np.full(len(stack), np.nan)
        for index in np.flatnonzero(reason == ""):
            sigma_dn[index] = FULL_SCALE_DN * estimate_sigma(stack[index], channel_axis=None)
        return Measured(sigma_dn)
