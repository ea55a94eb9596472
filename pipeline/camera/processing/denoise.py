"""Denoising inside a camera: of luma by one of several methods, of chroma by a Gaussian.

    none
    gaussian    a Gaussian of `radius_px`
    shrinkage   soft thresholds on three band-pass scales, strongest on the finest (as wavelet denoisers do)
    bilateral   mean over near pixels of similar value
    nlm         non-local means (OpenCV)
    median      3 x 3 median

The thresholds follow the noise that the camera knows it has, `sigma` behind the tone curve.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.processing.gaussian import blurred
from pipeline.errors import InputError, did_you_mean, finite_at_least_0

Float = NDArray[np.float32]

METHODS = ("none", "gaussian", "shrinkage", "bilateral", "nlm", "median")
_SCALES_PX = (0.7, 1.4, 2.8)
_BAND_WEIGHTS = (0.7, 0.45, 0.25)
"""Of the thresholds in the three bands that these scales separate; of white noise .72, .28 and .14 lie in them."""


@dataclass(frozen=True)
class Denoising:
    """Settings of a camera's denoising.

    Attributes:
        method: of luma, one of `METHODS`.
        blend: fraction of the denoised luma in the result, 0 to 1.
        strength: threshold in units of the noise's standard deviation, times .6 for shrinkage and non-local means, 1.5
            for the bilateral filter.
        radius_px: of the Gaussian, and of the bilateral filter beyond 1.2 px.
        coarse: how much the middle scale is shrunk relative to the finest (the coarsest: half its square).
        softness_px: Gaussian on luma before all else (a soft pipeline), standard deviation.
        chroma_px: Gaussian on chroma, standard deviation.
    """

    method: str = "none"
    blend: float = 1.0
    strength: float = 1.0
    radius_px: float = 1.0
    coarse: float = 0.5
    softness_px: float = 0.0
    chroma_px: float = 0.0

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise InputError(f"denoising: no method {self.method!r}; {did_you_mean(self.method, METHODS)}")
        for name in ("blend", "strength", "radius_px", "coarse", "softness_px", "chroma_px"):
            finite_at_least_0(f"denoising: {name}", getattr(self, name))
        if self.blend > 1:
            raise InputError(f"denoising: blend={self.blend}, expected 0 to 1")


def denoise_luma(luma: Float, settings: Denoising, sigma: float) -> Float:
    """Luma after denoising.

    Args:
        luma: (H, W) encoded, [0, 1].
        settings: method and strength.
        sigma: standard deviation of its noise, fraction of white; 0 leaves it unchanged but for `softness_px`.

    Returns:
        (H, W) float32.
    """
    soft = blurred(luma, settings.softness_px)
    if settings.method == "none" or sigma <= 0:
        return soft
    return soft + np.float32(settings.blend) * (_denoised(soft, settings, sigma) - soft)


def denoise_chroma(chroma: Float, settings: Denoising) -> Float:
    """One chroma plane (H, W) after its Gaussian."""
    return blurred(np.ascontiguousarray(chroma), settings.chroma_px)


def _denoised(luma: Float, settings: Denoising, sigma: float) -> Float:
    import cv2

    if settings.method == "gaussian":
        return blurred(luma, settings.radius_px)
    if settings.method == "median":
        return np.asarray(cv2.medianBlur(luma, 3))
    if settings.method == "bilateral":
        return np.asarray(cv2.bilateralFilter(luma, 5, settings.strength * sigma * 1.5, 1.2 + settings.radius_px))
    if settings.method == "nlm":
        whole = np.clip(np.rint(luma * 255), 0, 255).astype(np.uint8)
        filtered: NDArray[Any] = cv2.fastNlMeansDenoising(
            whole, None, max(settings.strength * 0.6 * sigma * 255, 0.5), 3, 9
        )
        return filtered.astype(np.float32) / np.float32(255)
    weights = (1.0, settings.coarse, 0.5 * settings.coarse**2)
    rest, detail = luma, np.zeros_like(luma)
    for scale_px, share, weight in zip(_SCALES_PX, _BAND_WEIGHTS, weights, strict=True):
        lower = blurred(luma, scale_px)
        band = rest - lower
        threshold = np.float32(settings.strength * sigma * share * weight * 0.6)
        detail += np.sign(band) * np.maximum(np.abs(band) - threshold, 0)
        rest = lower
    return np.asarray(rest + detail, dtype=np.float32)
