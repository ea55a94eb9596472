"""Sensor constants from raw frames: photon transfer and dark current, after EMVA 1288.

Photon transfer: the variance of a linear sensor's grey values grows with their mean,

    sigma^2 = c + K mu,    c = K^2 sigma_d^2 + 1/12,

with K the system gain in DN per electron, sigma_d the dark noise in electrons and 1/12 DN^2 of quantisation. Two frames
a and b of one scene, b of r times the exposure, differ by noise alone once a is scaled,

    var(b - r a) / (1 + r^2) = c + K mu_b (1 + r) / (1 + r^2),

which for r = 1 is half the variance of their difference.

Dark current: the mean of dark frames grows linearly with the exposure time; its slope over K is in electrons per
second. A camera whose black level is at 0 cuts off half of its dark noise: means and variances of its dark frames are
then limits, not measurements, which `DarkCurrent.zero_fraction` shows.

Frames are raw mosaics in DN; each of the four colour planes ("00", "01", "10", "11": row and column of its first
pixel) is a sensor by itself.

Source: EMVA Standard 1288, release 4.0, sections on photon transfer and dark current.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError

PLANES = ("00", "01", "10", "11")
QUANTISATION_DN2 = 1 / 12
BLOCK_PX = 16
LOWEST_DN = 4.0  # below this the black level cuts off part of the noise
CLIPPED_FRACTION = 0.98  # of white: pixels from here on count as clipped
MEAN_BINS = 24


@dataclass(frozen=True)
class TransferPoints:
    """Points of the photon-transfer curve.

    Attributes:
        mean_dn: (N,) mean grey value of a block, DN; of frames of two exposures mu_b (1 + r) / (1 + r^2).
        variance_dn2: (N,) variance of the noise at that grey value, DN^2.
    """

    mean_dn: NDArray[np.float64]
    variance_dn2: NDArray[np.float64]


@dataclass(frozen=True)
class PhotonTransfer:
    """A fitted photon-transfer curve.

    Attributes:
        gain_dn_per_e: system gain K.
        gain_error: its standard error, DN per electron.
        dark_variance_dn2: c, the variance at no light, quantisation included; it can be slightly negative.
        points: of the curve.
    """

    gain_dn_per_e: float
    gain_error: float
    dark_variance_dn2: float
    points: int

    @property
    def dark_sigma_e(self) -> float:
        """Dark noise in electrons, quantisation removed; 0 where that leaves nothing."""
        return float(np.sqrt(max(self.dark_variance_dn2 - QUANTISATION_DN2, 0)) / self.gain_dn_per_e)

    def electrons(self, grey_dn: float) -> float:
        """Electrons at a grey value above black."""
        return grey_dn / self.gain_dn_per_e

    def snr(self, grey_dn: float) -> float:
        """Signal-to-noise ratio at a grey value above black."""
        return float(grey_dn / np.sqrt(self.dark_variance_dn2 + self.gain_dn_per_e * grey_dn))


@dataclass(frozen=True)
class DarkCurrent:
    """A line through the means of dark frames.

    Attributes:
        slope_dn_per_s: dark current, DN per second.
        slope_error: its standard error, DN per second.
        offset_dn: mean of a dark frame of no exposure, the black level.
        zero_fraction: pixels of 0 DN; near 1 the black level cuts off the noise and the slope is of hot pixels alone.
    """

    slope_dn_per_s: float
    slope_error: float
    offset_dn: float
    zero_fraction: float


def plane(frame: NDArray[np.generic], name: str) -> NDArray[np.float64]:
    """One colour plane of a raw mosaic.

    Args:
        frame: (H, W) raw grey values.
        name: one of `PLANES`.

    Returns:
        (H / 2, W / 2) float64, rounded down.

    Raises:
        InputError: not two-dimensional, too small for a block, or no such plane.
    """
    if name not in PLANES:
        raise InputError(f"plane {name!r}: expected one of {', '.join(PLANES)}")
    if frame.ndim != 2 or min(frame.shape) < 2 * BLOCK_PX:
        raise InputError(f"raw frame: shape {frame.shape}, expected (H, W) of {2 * BLOCK_PX} px or more")
    height, width = (side // 2 * 2 for side in frame.shape)
    return np.asarray(frame[int(name[0]) : height : 2, int(name[1]) : width : 2], dtype=np.float64)


def points_of_pair(first: NDArray[np.generic], second: NDArray[np.generic], white_dn: float) -> TransferPoints:
    """Points from two frames of one scene, block by block.

    Args:
        first: (H, W) one colour plane, or a sensor without colour filters, DN above black.
        second: the same at the same or a longer exposure; the ratio is estimated in each block.
        white_dn: grey value of saturation, DN.

    Raises:
        InputError: frames of unequal shape.
    """
    if first.shape != second.shape:
        raise InputError(f"frames: shapes {first.shape} and {second.shape}, expected the same")
    a, b = _blocks(first), _blocks(second)
    keep = (a.mean(axis=(1, 2)) >= LOWEST_DN) & (np.maximum(a, b).max(axis=(1, 2)) < CLIPPED_FRACTION * white_dn)
    a, b = a[keep], b[keep]
    mean = b.mean(axis=(1, 2))
    ratio = mean / a.mean(axis=(1, 2))
    variance = (b - ratio[:, None, None] * a).var(axis=(1, 2), ddof=1) / (1 + ratio**2)
    return TransferPoints(mean * (1 + ratio) / (1 + ratio**2), variance)


def photon_transfer(points: Sequence[TransferPoints]) -> PhotonTransfer:
    """The straight line through points: weighted least squares over robust means of bins of equal count.

    Args:
        points: of any number of frames of one colour plane.

    Returns:
        the fit; weights are the inverse of the squared variance, to which the error of a variance is proportional.

    Raises:
        InputError: fewer than 24 points, or a variance that does not grow with the mean.
    """
    mean = np.concatenate([part.mean_dn for part in points]) if points else np.empty(0)
    variance = np.concatenate([part.variance_dn2 for part in points]) if points else np.empty(0)
    if len(mean) < MEAN_BINS:
        raise InputError(f"photon transfer: {len(mean)} usable blocks, expected {MEAN_BINS} or more; give more frames")
    order = np.argsort(mean, kind="stable")
    bins = np.array_split(order, MEAN_BINS)
    x = np.array([mean[index].mean() for index in bins])
    y = np.array([np.median(variance[index]) for index in bins])
    weight = 1 / np.maximum(y, QUANTISATION_DN2) ** 2
    (slope, offset), error = _line(x, y, weight)
    if not slope > 0:
        raise InputError("photon transfer: the variance does not grow with the mean; expected linear raw frames")
    return PhotonTransfer(slope, error, offset, len(mean))


def dark_current(exposures_s: Sequence[float], frames: Sequence[NDArray[np.generic]]) -> DarkCurrent:
    """The straight line through the means of dark frames over exposure time.

    Args:
        exposures_s: of each frame, seconds; at least three different ones.
        frames: (H, W) dark frames or planes of them, DN.

    Raises:
        InputError: lengths differ, or fewer than three exposures.
    """
    if len(exposures_s) != len(frames) or len(set(exposures_s)) < 3:
        raise InputError(
            f"dark current: {len(frames)} frames of {len(set(exposures_s))} exposures, expected three exposures or more"
        )
    means = np.array([np.asarray(frame, dtype=np.float64).mean() for frame in frames])
    (slope, offset), error = _line(np.asarray(exposures_s, dtype=np.float64), means, np.ones(len(means)))
    zero = float(np.mean([np.mean(frame == 0) for frame in frames]))
    return DarkCurrent(slope, error, offset, zero)


def _blocks(values: NDArray[np.generic]) -> NDArray[np.float64]:
    """Blocks side by side, (N, 16, 16)."""
    height, width = (side // BLOCK_PX for side in values.shape)
    cut = np.asarray(values[: height * BLOCK_PX, : width * BLOCK_PX], dtype=np.float64)
    split = cut.reshape(height, BLOCK_PX, width, BLOCK_PX).transpose(0, 2, 1, 3)
    return split.reshape(-1, BLOCK_PX, BLOCK_PX)


def _line(
    x: NDArray[np.float64], y: NDArray[np.float64], weight: NDArray[np.float64]
) -> tuple[tuple[float, float], float]:
    """Weighted least squares: slope and offset, and the standard error of the slope from the residuals."""
    centre = np.average(x, weights=weight)
    spread = (weight * (x - centre) ** 2).sum()
    slope = (weight * (x - centre) * y).sum() / spread
    offset = np.average(y, weights=weight) - slope * centre
    residual = y - offset - slope * x
    error = np.sqrt((weight * residual**2).sum() / max(len(x) - 2, 1) / spread)
    return (float(slope), float(offset)), float(error)
