"""Changing size in image pyramids: phase-true separable resizing, Gaussian reduction, and fitting kernels.

Blind deconvolution is sensitive to fractions of a pixel: a kernel that is resized off its centre shifts the
latent image. Resizing here keeps the image corners in place (pixel centres at half-integers), reflects at the
border and, when shrinking, stretches the interpolation kernel by 1/scale against aliasing.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray


def _cubic(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Keys' cubic interpolation kernel, a = -1/2 (Keys, IEEE T-ASSP 1981)."""
    t = np.abs(t)
    near = 1.5 * t**3 - 2.5 * t**2 + 1.0
    far = -0.5 * t**3 + 2.5 * t**2 - 4.0 * t + 2.0
    return np.where(t <= 1.0, near, np.where(t <= 2.0, far, 0.0))


def _triangle(t: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.maximum(1.0 - np.abs(t), 0.0)


_KERNELS: dict[str, tuple[Callable[[NDArray[np.float64]], NDArray[np.float64]], float]] = {
    "cubic": (_cubic, 4.0),
    "linear": (_triangle, 2.0),
}


@lru_cache(maxsize=256)
def resize_matrix(before: int, after: int, scale: float, method: str) -> NDArray[np.float64]:
    """Weights of a one-dimensional resize.

    Output sample i lies at u = (i + 1/2) / scale - 1/2 of the input; weights are normalised per sample.

    Args:
        before: input length.
        after: output length.
        scale: output pixels per input pixel (its own argument, since ``after`` is rounded).
        method: "cubic" or "linear".

    Returns:
        (after, before) matrix.
    """
    kernel, width = _KERNELS[method]
    stretch = min(scale, 1.0)
    width /= stretch
    centre = (np.arange(after) + 0.5) / scale - 0.5
    left = np.floor(centre - width / 2)
    taps = left[:, None] + np.arange(math.ceil(width) + 2)
    weight = kernel((centre[:, None] - taps) * stretch)
    weight /= weight.sum(axis=1, keepdims=True)
    source = taps.astype(int) % (2 * before)  # half-sample reflection
    source = np.where(source < before, source, 2 * before - 1 - source)
    matrix = np.zeros((after, before))
    np.add.at(matrix, (np.arange(after)[:, None], source), weight)
    matrix.setflags(write=False)
    return matrix


def resize(image: NDArray, shape: tuple[int, int], method: str, scale: float | None = None) -> NDArray:
    """Resize an image.

    Args:
        image: (h, w).
        shape: (rows, columns) wanted.
        method: "cubic" or "linear".
        scale: output pixels per input pixel; the quotient of the lengths, per axis, if not given.
    """
    (rows, columns), (height, width) = shape, image.shape
    down = resize_matrix(height, rows, scale or rows / height, method)
    across = resize_matrix(width, columns, scale or columns / width, method)
    return (down @ image @ across.T).astype(image.dtype, copy=False)


def gaussian_reduce(image: NDArray[np.float64], ratio: float) -> NDArray[np.float64]:
    """Shrink an image after a truncated Gaussian low-pass, as multi-scale kernel estimators do.

    Taps exp(-t^2 s^2 / 2) at t = 2 pi (-50..50) with s = ratio / pi; those with less than 5 % of the mass beyond
    them, on their own side, are dropped **without** renormalising, so that the image darkens by up to 8 %. Only
    where the taps fit is kept, then sampled bilinearly every 1 / ratio pixels from the first.

    Args:
        image: (h, w).
        ratio: size after / size before, in (0, 1]; 1 returns the image.
    """
    if ratio == 1.0:
        return image
    with np.errstate(under="ignore"):  # far taps are 0
        taps = np.exp(-0.5 * (np.arange(-50, 51) * 2 * np.pi) ** 2 * (ratio / np.pi) ** 2)
        taps /= taps.sum()
    mass = np.cumsum(taps)
    taps = taps[np.minimum(mass, mass[::-1]) > 0.05]
    margin = len(taps) // 2
    smooth: NDArray = cv2.sepFilter2D(image, -1, taps, taps)[margin:-margin, margin:-margin]
    for _ in range(2):
        where = np.arange(0.0, smooth.shape[0] - 1 + 1e-9, 1.0 / ratio)
        first = np.minimum(where.astype(int), smooth.shape[0] - 2)
        part = (where - first)[:, None]
        smooth = (smooth[first] * (1.0 - part) + smooth[first + 1] * part).T
    return np.ascontiguousarray(smooth)


def fit(kernel: NDArray, size: int) -> NDArray:
    """Trim or pad a kernel to size x size, a row and a column at a time.

    Trimming drops the border row (column) with the smaller sum, the last one of equals. Padding adds a row of
    zeros at the end where the first row is the lighter one, else at the start.

    Args:
        kernel: (h, w) non-negative.
        size: rows and columns wanted.
    """
    for axis in (0, 1):
        kernel = np.moveaxis(kernel, axis, 0)
        while len(kernel) > size:
            kernel = kernel[1:] if kernel[0].sum() < kernel[-1].sum() else kernel[:-1]
        while len(kernel) < size:
            after = kernel[0].sum() < kernel[-1].sum()
            kernel = np.pad(kernel, ((0, 1) if after else (1, 0), (0, 0)))
        kernel = np.moveaxis(kernel, 0, axis)
    return kernel
