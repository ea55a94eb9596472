"""The filter between a scene and its pixels: a Gaussian lens, then the mean of N x N regular samples.

Along each axis the samples of a pixel lie at (j + 1/2) / N. The lens acts on the dense grid of samples, the mean
over the pixel follows, and every N-th value is kept; both are one separable filter with taps w_k at x_k pixels
from the pixel's centre. Its transfer function is known exactly::

    H(f) = sum_k w_k cos(2 pi f x_k)  ~  exp(-2 pi^2 sigma^2 f^2) * sin(pi f) / (N sin(pi f / N))

(lens times comb of N samples; to 2e-4 for N = 2 and 1e-5 for N >= 3 at sigma = 0.44 px). N samples are *not* the box
filter of an ideal pixel, sin(pi f) / (pi f), which they approach for large N only.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float32]

LENS_SIGMA_PX = 0.44  # with 3 x 3 samples this is the MTF of the paper's Sim (its Siemens star), to .005
_REACH = 4.0  # standard deviations


@lru_cache(maxsize=32)
def taps(samples: int, sigma_px: float = LENS_SIGMA_PX) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The filter of one axis.

    Args:
        samples: N, samples of a pixel along the axis, at least 1.
        sigma_px: standard deviation of the lens, pixels; 0 (or below 1e-3) for none.

    Returns:
        (T,) weights of unit sum and (T,) positions, pixels from the pixel's centre; T has the parity of N.
    """
    half = int(np.ceil(_REACH * sigma_px * samples))
    offsets = np.arange(-half, half + 1) / samples
    lens = np.exp(-0.5 * (offsets / sigma_px) ** 2) if sigma_px > 1e-3 else np.ones(1)
    weights = np.convolve(lens / lens.sum(), np.full(samples, 1.0 / samples))
    positions = (np.arange(len(weights)) - (len(weights) - 1) / 2) / samples
    return weights, positions


def margin_px(samples: int, sigma_px: float = LENS_SIGMA_PX) -> int:
    """Pixels a dense image must extend beyond the frame on each side, so that the filter sees no border."""
    _, positions = taps(samples, sigma_px)
    return int(np.ceil(max(0.0, positions[-1] - 0.5 + 0.5 / samples)))


def expose(dense: Array, samples: int, sigma_px: float = LENS_SIGMA_PX) -> Array:
    """Lens and pixels applied to a dense image of samples.

    Args:
        dense: ((H + 2m) N, (W + 2m) N) float32 samples, with m = `margin_px`.
        samples: N.
        sigma_px: see `taps`.

    Returns:
        (H, W) float32.
    """
    import cv2

    weights, _ = taps(samples, sigma_px)
    margin = margin_px(samples, sigma_px)
    anchor = len(weights) // 2
    kernel = weights.astype(np.float32)
    filtered = cv2.sepFilter2D(dense, cv2.CV_32F, kernel, kernel, anchor=(anchor, anchor))
    # the pixel's centre is on its middle sample (N odd) or just before it (N even): index N // 2 in both cases
    rows, columns = (slice(margin * samples + samples // 2, size - margin * samples, samples) for size in dense.shape)
    return np.ascontiguousarray(filtered[rows, columns])


def transfer(frequencies: ArrayLike, samples: int, sigma_px: float = LENS_SIGMA_PX) -> NDArray[np.float64]:
    """Modulation of a sinusoid along one axis.

    Args:
        frequencies: cycles per pixel, any shape, any sign.
        samples: see `taps`.
        sigma_px: see `taps`.

    Returns:
        H(f), real, the shape of `frequencies`.
    """
    weights, positions = taps(samples, sigma_px)
    phase = 2.0 * np.pi * np.asarray(frequencies, np.float64)[..., None] * positions
    return (np.cos(phase) * weights).sum(axis=-1)


def true_mtf(
    frequencies: ArrayLike, samples: int, lens_sigma_px: float = LENS_SIGMA_PX, angle_deg: float | None = None
) -> NDArray[np.float64]:
    """The dataset's ground truth: MTF of lens and pixel samples.

    Args:
        frequencies: (F,) cycles per pixel.
        samples: N, samples of a pixel along each axis.
        lens_sigma_px: standard deviation of the lens, pixels.
        angle_deg: direction of the wave vector, from horizontal; without it, both axes are given.

    Returns:
        (2, F), horizontal and vertical (equal, the filter being the same along both axes), or (F,) for a direction.
    """
    frequencies = np.asarray(frequencies, np.float64)
    if angle_deg is None:
        one = np.abs(transfer(frequencies, samples, lens_sigma_px))
        return np.stack([one, one])
    turn = np.deg2rad(angle_deg)
    across, down = frequencies * np.cos(turn), frequencies * np.sin(turn)
    return np.abs(transfer(across, samples, lens_sigma_px) * transfer(down, samples, lens_sigma_px))
