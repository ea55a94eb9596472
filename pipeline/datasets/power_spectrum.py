"""Radially averaged power spectrum of a frame."""

from __future__ import annotations

import numpy as np


def power_spectrum(image: np.ndarray, bins: int = 24) -> tuple[np.ndarray, np.ndarray]:
    """Power spectrum averaged over directions, of the frame under a Hann window with its mean removed.

    Args:
        image: (H, W) grey levels, 0..255.
        bins: logarithmically spaced, from 0.008 to 0.5 cycles per pixel.

    Returns:
        (bins,) frequency in cycles per pixel, (bins,) mean power in DN^2; bins without a sample are NaN.
    """
    grey = image.astype(np.float64)
    window = np.hanning(grey.shape[0])[:, None] * np.hanning(grey.shape[1])[None, :]
    power = np.abs(np.fft.rfft2((grey - grey.mean()) * window)) ** 2 / max((window**2).sum(), 1e-12)
    radius = np.hypot(np.fft.fftfreq(grey.shape[0])[:, None], np.fft.rfftfreq(grey.shape[1])[None, :])
    edges = np.geomspace(0.008, 0.5, bins + 1)
    ring = np.digitize(radius.ravel(), edges) - 1
    inside = (ring >= 0) & (ring < bins)
    total = np.bincount(ring[inside], power.ravel()[inside], bins)
    count = np.bincount(ring[inside], minlength=bins)
    mean = np.divide(total, count, out=np.full(bins, np.nan), where=count > 0)
    return np.sqrt(edges[1:] * edges[:-1]), mean
