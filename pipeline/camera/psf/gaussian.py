"""Gaussian blur: the usual stand-in for lens aberrations and diffraction together.

    h(x, y) = exp(-(x^2 + y^2) / (2 sigma^2)) / (2 pi sigma^2),

integrated exactly over each pixel (differences of the error function) and cut at four sigma.
"""

from __future__ import annotations

import math

import numpy as np

from pipeline.camera.psf.kernel import checked_size, finished

SIGMAS_PER_WIDTH = 1 / math.sqrt(8 * math.log(2))
"""Standard deviation of a Gaussian of unit full width at half maximum."""


def create(size_px: float, angle_deg: float = 0.0, generator: np.random.Generator | None = None) -> np.ndarray:
    """The PSF of Gaussian blur.

    Args:
        size_px: full width at half maximum, pixels, >= 0 (sigma = size / 2.355).
        angle_deg: not used (the kernel is round); here because all kinds are called alike.
        generator: not used (nothing is random).

    Returns:
        (n, n) float32, non-negative, sum 1, n odd.

    Raises:
        InputError: a negative or infinite size.
    """
    return gaussian(checked_size(size_px, "gaussian") * SIGMAS_PER_WIDTH)


def gaussian(sigma_px: float) -> np.ndarray:
    """A Gaussian of any standard deviation, area-sampled: (n, n) float32, sum 1; n about 8 sigma, odd."""
    from scipy.special import erf

    sigma_px = max(float(sigma_px), 1e-6)
    half = math.ceil(4 * sigma_px)
    edges = np.arange(-half, half + 2) - 0.5
    profile = np.diff(erf(edges / (math.sqrt(2) * sigma_px)))
    return finished(np.outer(profile, profile))
