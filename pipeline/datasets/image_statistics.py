"""What a frame looks like in numbers: brightness, spectrum, gradients.

They show at a glance how far two datasets differ where blur and noise estimators are sensitive: a real drive has an
amplitude spectrum near 1/f (power slope about -2), saturated sky and many flat patches.

Definitions, on the 8-bit scale (DN):

* dark and saturated: share of pixels at most 2 and at least 253 DN;
* spectrum slope: least-squares slope of log power over log frequency, 0.008 to 0.3 cycles/px, where power is the
  squared magnitude of the Fourier transform of the mean-free frame under a Hann window, averaged over rings
  (van der Schaaf and van Hateren, Vision Research 1996);
* gradient: length of the vector of forward differences to the right and downwards; flat: share under 1.5 DN, strong:
  share over 30 DN.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

DARK_DN, SATURATED_DN = 2.0, 253.0
FLAT_DN, STRONG_DN = 1.5, 30.0
SLOPE_BAND = (0.008, 0.3)  # cycles per pixel
_RINGS = 40


@dataclass(frozen=True)
class ImageStatistics:
    """Statistics of one frame; names and units as the columns of `pipeline.tables.FRAMES`."""

    mean_dn: float
    std_dn: float
    dark_fraction: float
    saturated_fraction: float
    spectrum_slope: float
    gradient_mean_dn: float
    gradient_median_dn: float
    gradient_p90_dn: float
    gradient_p99_dn: float
    flat_fraction: float
    strong_fraction: float


def measure(image: np.ndarray) -> ImageStatistics:
    """Statistics of one frame.

    Args:
        image: (H, W) float in [0, 1], at least 2x2.

    Returns:
        the numbers; the spectrum slope is NaN for a frame without any structure.
    """
    grey_dn = image.astype(np.float32) * np.float32(255)
    right = grey_dn[:-1, 1:] - grey_dn[:-1, :-1]
    down = grey_dn[1:, :-1] - grey_dn[:-1, :-1]
    gradient = np.hypot(right, down)
    median, p90, p99 = np.percentile(gradient, [50, 90, 99])
    return ImageStatistics(
        mean_dn=float(grey_dn.mean(dtype=np.float64)),
        std_dn=float(grey_dn.std(dtype=np.float64)),
        dark_fraction=float((grey_dn <= DARK_DN).mean()),
        saturated_fraction=float((grey_dn >= SATURATED_DN).mean()),
        spectrum_slope=spectrum_slope(grey_dn),
        gradient_mean_dn=float(gradient.mean(dtype=np.float64)),
        gradient_median_dn=float(median),
        gradient_p90_dn=float(p90),
        gradient_p99_dn=float(p99),
        flat_fraction=float((gradient < FLAT_DN).mean()),
        strong_fraction=float((gradient > STRONG_DN).mean()),
    )


def radial_power(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Radially averaged power spectrum.

    Args:
        image: (H, W), any unit.

    Returns:
        ring centres in cycles per pixel, evenly spaced in their logarithm over the band of the slope, and mean power
        in each; rings no frequency falls into are left out.
    """
    height, width = image.shape
    window = np.hanning(height + 2)[1:-1, None] * np.hanning(width + 2)[None, 1:-1]
    centred = image - np.average(image, weights=window)  # no leak of the mean through the window
    edges = np.geomspace(*SLOPE_BAND, _RINGS + 1)
    power = ring_power((centred * window).astype(np.float32), edges)
    filled = np.isfinite(power)
    return np.sqrt(edges[:-1] * edges[1:])[filled], power[filled]


def spectrum_slope(image: np.ndarray) -> float:
    """Slope of log power over log frequency; see the module."""
    frequency, power = radial_power(image)
    usable = power > 1e-6  # rounding noise of the transform of a constant
    if usable.sum() < 2:
        return float("nan")
    return float(np.polyfit(np.log(frequency[usable]), np.log(power[usable]), 1)[0])


def ring_power(image: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Mean squared magnitude of the Fourier transform in rings of spatial frequency.

    A real transform holds half of the plane. Its columns stand for their mirror images too and count twice, but for
    that of frequency 0 and, of even widths, that of Nyquist, which hold their mirror images: the transpose of an image
    has the same powers.

    Args:
        image: (H, W), windowed; float32 is transformed in single precision.
        edges: (B + 1,) rising, cycles per pixel; a ring holds its lower edge.

    Returns:
        (B,) float64; NaN where no frequency falls into a ring.
    """
    import scipy.fft

    count = len(edges) - 1
    ring, weights, samples = _rings(*image.shape, tuple(edges.tolist()))
    power = np.abs(scipy.fft.rfft2(image)) ** 2
    sums = np.bincount(ring.ravel(), weights=(power * weights).ravel(), minlength=count + 1)[:count]
    return np.divide(sums, samples, out=np.full(count, np.nan), where=samples > 0)


@lru_cache(maxsize=4)
def _rings(height: int, width: int, edges: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ring number of each coefficient of a real transform (B outside), weights of the columns and (B,) their sums."""
    count = len(edges) - 1
    radius = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(width)[None])
    ring = np.searchsorted(edges, radius, side="right") - 1
    ring[(ring < 0) | (ring >= count)] = count
    weights = np.full(radius.shape[1], 2.0, np.float32)
    weights[0] = 1
    if width % 2 == 0:
        weights[-1] = 1
    samples = np.bincount(ring.ravel(), weights=np.broadcast_to(weights, ring.shape).ravel(), minlength=count + 1)
    return ring, weights, samples[:count]
