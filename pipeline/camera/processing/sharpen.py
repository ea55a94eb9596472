"""Sharpening: an unsharp mask on luma, with coring.

    y = x + a c(x - G_r * x),   gain(f) = 1 + a (1 - exp(-2 pi^2 r^2 f^2))

c sets differences below a threshold to zero, so that noise is sharpened less than edges.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.processing.gaussian import blurred, transfer
from pipeline.errors import finite_at_least_0

Float = NDArray[np.float32]


@dataclass(frozen=True)
class Sharpening:
    """Settings of an unsharp mask.

    Attributes:
        amount: a, 0 for none.
        radius_px: r, standard deviation of the Gaussian, pixels.
        coring: threshold in units of half the noise's standard deviation.
    """

    amount: float = 0.0
    radius_px: float = 1.0
    coring: float = 0.0

    def __post_init__(self) -> None:
        for name in ("amount", "radius_px", "coring"):
            finite_at_least_0(f"sharpening: {name}", getattr(self, name))


def sharpen(luma: Float, settings: Sharpening, sigma: float) -> Float:
    """Sharpened luma (H, W); `sigma` is the noise that coring counts in, fraction of white."""
    if not settings.amount:
        return luma
    detail = luma - blurred(luma, settings.radius_px)
    threshold = np.float32(settings.coring * sigma * 0.5)
    if threshold:
        detail = np.sign(detail) * np.maximum(np.abs(detail) - threshold, 0)
    return luma + np.float32(settings.amount) * detail


def gain(settings: Sharpening, frequencies: NDArray[np.floating]) -> NDArray[np.floating]:
    """Contrast after sharpening over contrast before, without coring.

    Args:
        settings: of the unsharp mask.
        frequencies: cycles per pixel.
    """
    return 1 + settings.amount * (1 - transfer(settings.radius_px, frequencies))
