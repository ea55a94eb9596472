"""Noise-aware image quality of Shin et al. 2019 (arXiv 1907.12646): gradient, entropy and noise of one frame.

``f = alpha Kg L_grad + (1 - alpha) L_ent - beta L_noise`` with alpha = beta = 0.4, Kg = 2.

* L_grad: mapped Sobel gradient averaged over a 10 x 10 grid; mean over standard deviation of the cells.
* L_ent: Shannon entropy of the 8-bit histogram in bits, divided by 8.
* L_noise: ``sqrt(pi / 2) / (6 N) sum |I * [1 -2 1; -2 4 -2; 1 -2 1]|`` (Immerkaer 1996) in DN, over the pixels with the
  10 % weakest gradients and grey levels 15..235; over the whole frame where those are fewer than 1e-4 of it.

A black or saturated frame has no gradient at all: its L_grad is 0 (the published program divides 0 by 0).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.control.image.gradient import information, sobel_magnitude

ALPHA, BETA, GRADIENT_WEIGHT = 0.4, 0.4, 2.0
GRID = 10
HOMOGENEOUS_FRACTION = 0.10
UNSATURATED_DN = (15.0, 235.0)
LEAST_FRACTION = 1e-4
_IMMERKAER = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)


class Quality(NamedTuple):
    """Value of a frame (larger is better) and its three parts; noise in DN."""

    value: float
    gradient: float
    entropy: float
    noise_dn: float


def quality(image: NDArray[np.floating]) -> Quality:
    """Image quality of a frame.

    Args:
        image: (H, W) float in [0, 1], at least 20 px a side.
    """
    dn = np.rint(np.asarray(image, dtype=np.float32) * 255.0)
    gradient = sobel_magnitude(dn / np.float32(255.0))
    strength, entropy, noise = _gradient_loss(gradient), _entropy(dn), _noise_dn(dn, gradient)
    value = ALPHA * GRADIENT_WEIGHT * strength + (1.0 - ALPHA) * entropy - BETA * noise
    return Quality(float(value), strength, entropy, noise)


def _gradient_loss(gradient: NDArray[np.float32]) -> float:
    rows, columns = (np.linspace(0, side, GRID + 1).astype(int)[:-1] for side in gradient.shape)
    sums = np.add.reduceat(np.add.reduceat(information(gradient).astype(np.float64), rows, 0), columns, 1)
    heights, widths = (np.diff([*edges, side]) for edges, side in zip((rows, columns), gradient.shape, strict=True))
    cells = sums / np.outer(heights, widths)
    spread = float(cells.std(ddof=1))
    return float(cells.mean()) / spread if spread > 0.0 else 0.0


def _entropy(dn: NDArray[np.float32]) -> float:
    share = np.bincount(dn.astype(np.int64).ravel(), minlength=256) / dn.size
    share = share[share > 0]
    return float(-(share * np.log2(share)).sum() / 8.0)


def _noise_dn(dn: NDArray[np.float32], gradient: NDArray[np.float32]) -> float:
    import cv2

    response = np.abs(cv2.filter2D(dn, cv2.CV_32F, _IMMERKAER, borderType=cv2.BORDER_CONSTANT))
    rank = min(max(round(dn.size * HOMOGENEOUS_FRACTION), 1), dn.size) - 1
    weakest = np.partition(gradient.ravel(), rank)[rank]
    mask = (gradient <= weakest) & (dn >= UNSATURATED_DN[0]) & (dn <= UNSATURATED_DN[1])
    count = int(mask.sum())
    scale = np.sqrt(np.pi / 2.0) / 6.0
    if count < LEAST_FRACTION * dn.size:
        inner = response[1:-1, 1:-1]
        return float(scale * inner.mean(dtype=np.float64))
    return float(scale * response[mask].mean(dtype=np.float64))
