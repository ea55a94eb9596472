"""Random fields on a torus: power-law noise and fine grain, the raw material of every texture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft

Array = NDArray[np.float32]


def power_noise(
    generator: np.random.Generator,
    size_px: int,
    exponent: float,
    stretch_u: float = 1.0,
    stretch_v: float = 1.0,
) -> Array:
    """Periodic Gaussian noise whose amplitude falls as a power of frequency: |F(k)| ~ |(s_u k_u, s_v k_v)|^-exponent.

    Natural surfaces have amplitude spectra near 1/f (Field 1987); 0 is white, 2 is smooth hills.

    Args:
        generator: random numbers.
        size_px: side of the field.
        exponent: >= 0.
        stretch_u: weight of frequencies along u; the smaller it is against `stretch_v`, the faster the field
            changes along u, so features are drawn out along v (bark). Equal weights are isotropic.
        stretch_v: the same along v; small draws features out along u (wood grain).

    Returns:
        (size_px, size_px) of zero mean and unit standard deviation.
    """
    spectrum = fft.rfft2(generator.standard_normal((size_px, size_px), dtype=np.float32))
    across = fft.rfftfreq(size_px).astype(np.float32)[None] * np.float32(size_px * stretch_u)
    along = fft.fftfreq(size_px).astype(np.float32)[:, None] * np.float32(size_px * stretch_v)
    frequency = np.hypot(across, along)
    frequency[0, 0] = 1.0
    spectrum *= frequency ** np.float32(-exponent)
    spectrum[0, 0] = 0.0
    field = fft.irfft2(spectrum, s=(size_px, size_px)).astype(np.float32)
    return np.asarray(field / field.std(), np.float32)


def grain(generator: np.random.Generator, size_px: int, sigma_px: float) -> Array:
    """White noise through a periodic Gaussian of standard deviation `sigma_px`, unit standard deviation."""
    spectrum = fft.rfft2(generator.standard_normal((size_px, size_px), dtype=np.float32))
    across = fft.rfftfreq(size_px).astype(np.float32)[None]
    along = fft.fftfreq(size_px).astype(np.float32)[:, None]
    spectrum *= np.exp(-2.0 * (np.pi * sigma_px) ** 2 * (across**2 + along**2)).astype(np.float32)
    spectrum[0, 0] = 0.0
    field = fft.irfft2(spectrum, s=(size_px, size_px)).astype(np.float32)
    return np.asarray(field / field.std(), np.float32)
