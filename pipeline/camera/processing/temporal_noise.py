"""Noise in delivered pictures, measured from several shots of one scene through one camera.

    sigma^2 = mean over pixels of the unbiased variance over shots

It needs no noise-free reference, whose processing would differ (a denoiser adapts to the noise), and it is what the
data sets of real camera noise measure. Beside it the white part of the noise and the correlation between neighbours:

    white sigma^2   the least power of the noise in eight rings of spatial frequency and the corners: sensor noise that
                    no later step has smoothed
    correlation     mean correlation of the noise of horizontally and vertically adjacent pixels (lag 1); white: 0

Two errors are known and kept, since labels of training samples and released weights follow from these numbers:

* the least of nine powers, each of which varies, is too low on average: white noise of 5.00 DN has a white sigma of
  4.74 DN from 3 shots of 128 px, of 4.87 DN from 8;
* powers are means over the half of the plane that a real transform holds, where the columns of horizontal frequency 0
  and Nyquist have twice the weight that they have in the whole plane: with 2.5 DN of noise of rows beside 5 DN of
  white noise the lowest ring has 112 DN^2, with as much noise of columns 78 DN^2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError

Float = NDArray[np.float32]
CELL_PX = 8
RINGS = 8
LEAST_SIDE_PX = 24
"""Sides of 8 and 16 px have no spatial frequency in the lowest ring, up to 1/16 cycle per pixel."""


@dataclass(frozen=True)
class TemporalNoise:
    """Noise of a patch.

    Attributes:
        sigma_dn: total standard deviation, DN.
        white_sigma_dn: its white part, DN; biased low, see the module.
        correlation: lag-1 correlation, -1 to 1; 0 where there is no noise.
        map_dn: (H / 8, W / 8) standard deviation per cell, DN.
        spectrum_dn2: (9,) noise power in rings of 0 to 0.5 cycles per pixel and in the corners beyond; each is
            sigma^2 for white noise.
    """

    sigma_dn: float
    white_sigma_dn: float
    correlation: float
    map_dn: Float
    spectrum_dn2: NDArray[np.float64]


def measure(shots: NDArray[np.uint8] | Float) -> TemporalNoise:
    """Noise of shots of one scene.

    Args:
        shots: (K, H, W) grey levels 0..255, K >= 2; sides a multiple of 8, at least 24 px.

    Raises:
        InputError: fewer than two shots, or sides that are no multiple of 8 or below 24 px.
    """
    sides = shots.shape[1:]
    if shots.ndim != 3 or len(shots) < 2 or min(sides) < LEAST_SIDE_PX or any(side % CELL_PX for side in sides):
        raise InputError(
            f"shots: {shots.shape}, expected (K, H, W) with K >= 2 and sides a multiple of {CELL_PX}, "
            f"at least {LEAST_SIDE_PX} px"
        )
    values = shots.astype(np.float32)
    residual = values - values.mean(axis=0)
    residual -= residual.mean(axis=(1, 2), keepdims=True)
    unbiased = len(values) / (len(values) - 1)
    variance = (residual**2).mean(axis=0) * unbiased
    height, width = variance.shape
    cells = variance.reshape(height // CELL_PX, CELL_PX, width // CELL_PX, CELL_PX).mean(axis=(1, 3))
    total = float(variance.mean())
    spectrum = _ring_power(residual) * unbiased
    products = (residual[:, :, 1:] * residual[:, :, :-1]).mean() + (residual[:, 1:] * residual[:, :-1]).mean()
    correlation = float(products) / 2 * unbiased / total if total > 1e-6 else 0.0
    white = min(float(spectrum.min()), total)
    return TemporalNoise(np.sqrt(total), np.sqrt(white), correlation, np.sqrt(cells), spectrum)


def _ring_power(residual: Float) -> NDArray[np.float64]:
    """Mean power of residuals (K, H, W) in the rings and corners, DN^2."""
    window, rings = _rings(residual.shape[1], residual.shape[2])
    power = (np.abs(np.fft.rfft2(residual * window)) ** 2).mean(axis=0) / window.size
    return np.array([power[ring].mean() for ring in rings])


@lru_cache(maxsize=8)
def _rings(height: int, width: int) -> tuple[Float, tuple[NDArray[np.bool_], ...]]:
    window = np.outer(np.hanning(height), np.hanning(width)).astype(np.float32)
    window /= np.sqrt((window**2).mean())
    radius = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(width)[None])
    ends = np.linspace(0, 0.5, RINGS + 1)
    rings = [(radius >= low) & (radius < high) for low, high in pairwise(ends)]
    rings[0][0, 0] = False
    return window, (*rings, radius >= 0.5)
