"""Radially averaged power spectrum of a frame."""

from __future__ import annotations

import numpy as np

from pipeline.datasets.image_statistics import ring_power


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
    edges = np.geomspace(0.008, 0.5, bins + 1)
    power = ring_power((grey - grey.mean()) * window, edges) / max((window**2).sum(), 1e-12)
    return np.sqrt(edges[1:] * edges[:-1]), power
