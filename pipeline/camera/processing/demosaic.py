"""Demosaicing: three colours at every pixel from one.

bilinear    mean of the nearest pixels of a colour
malvar      linear 5 x 5 filters that add the other colours' Laplacian (Malvar, He, Cutler 2004)
edge_aware  interpolation along the smaller gradient (OpenCV's "edge-aware" mode)
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.processing.mosaic import mosaic
from pipeline.errors import InputError, did_you_mean
from pipeline.streams import stream

Float = NDArray[np.float32]

METHODS = ("bilinear", "malvar", "edge_aware")

# OpenCV demosaics 16-bit integers: values from -OFFSET to SPAN - OFFSET keep the noise below black.
_OFFSET, _SPAN, _LEVELS = np.float32(0.15), np.float32(1.4), np.float32(65535)

_AT_GREEN = np.array([[0, 0, -1, 0, 0], [0, 0, 2, 0, 0], [-1, 2, 4, 2, -1], [0, 0, 2, 0, 0], [0, 0, -1, 0, 0]])
_ALONG_ROW = np.array([[0, 0, 0.5, 0, 0], [0, -1, 0, -1, 0], [-1, 4, 5, 4, -1], [0, -1, 0, -1, 0], [0, 0, 0.5, 0, 0]])
_DIAGONAL = np.array([[0, 0, -1.5, 0, 0], [0, 2, 0, 2, 0], [-1.5, 0, 6, 0, -1.5], [0, 2, 0, 2, 0], [0, 0, -1.5, 0, 0]])


def demosaic(raw: Float, method: str) -> Float:
    """Colours of an RGGB mosaic.

    Args:
        raw: (H, W) mosaic, fraction of white, -0.15 to 1.25; at least 8 x 8 px, even sides.
        method: one of `METHODS`.

    Returns:
        (H, W, 3) float32 red, green, blue.

    Raises:
        InputError: an unknown method.
    """
    import cv2

    if method not in METHODS:
        raise InputError(f"demosaicing: no method {method!r}; {did_you_mean(method, METHODS)}")
    if method == "malvar":
        return _malvar(raw)
    code = cv2.COLOR_BayerBG2RGB if method == "bilinear" else cv2.COLOR_BayerBG2RGB_EA  # OpenCV's name for RGGB
    whole = np.clip((raw + _OFFSET) / _SPAN * _LEVELS, 0, _LEVELS).astype(np.uint16)
    colours: NDArray[Any] = cv2.cvtColor(whole, code)
    return colours.astype(np.float32) * (_SPAN / _LEVELS) - _OFFSET


def _malvar(raw: Float) -> Float:
    import cv2

    def filtered(kernel: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(cv2.filter2D(raw, -1, (kernel / 8).astype(np.float32), borderType=cv2.BORDER_REFLECT_101))

    along_row, along_column, diagonal = filtered(_ALONG_ROW), filtered(_ALONG_ROW.T), filtered(_DIAGONAL)
    red, green, blue = raw.copy(), filtered(_AT_GREEN), raw.copy()
    green[0::2, 1::2], green[1::2, 0::2] = raw[0::2, 1::2], raw[1::2, 0::2]
    red[0::2, 1::2], red[1::2, 0::2], red[1::2, 1::2] = (
        along_row[0::2, 1::2],
        along_column[1::2, 0::2],
        diagonal[1::2, 1::2],
    )
    blue[0::2, 1::2], blue[1::2, 0::2], blue[0::2, 0::2] = (
        along_column[0::2, 1::2],
        along_row[1::2, 0::2],
        diagonal[0::2, 0::2],
    )
    return np.stack([red, green, blue], axis=-1)


_TEST_PX = 512
_TEST_CONTRAST = 0.12
_TEST_SMOOTHING_PX = 0.6
_BAND = 0.012  # cycles per pixel, half-width over which the response is averaged, along and across the axis


@lru_cache(maxsize=32)
def transfer(method: str, frequencies: tuple[float, ...]) -> tuple[float, ...]:
    """What a method does to the contrast of a grey scene, per frequency along an axis.

    H(f) = sum conj(S) Y / sum |S|^2 over the frequencies near the axis, where S is the spectrum of a grey random
    picture and Y that of the demosaiced one's mean over colours: the linear part of the method.

    Args:
        method: one of `METHODS`.
        frequencies: cycles per pixel, 0 to 0.5.

    Returns:
        the mean over both axes at each frequency; 1 is full contrast.
    """
    import cv2

    # White noise as a lens leaves it: where the scene has no contrast an edge-aware method has nothing to follow.
    scene = stream(0, "demosaicing response").standard_normal((_TEST_PX, _TEST_PX), dtype=np.float32)
    smooth = cv2.GaussianBlur(scene, (0, 0), _TEST_SMOOTHING_PX)
    grey = np.float32(0.4) + np.float32(_TEST_CONTRAST) * np.asarray(smooth, dtype=np.float32) / np.float32(
        smooth.std()
    )
    colours = demosaic(mosaic(np.repeat(grey[..., None], 3, axis=2)), method)
    window = np.outer(np.hanning(_TEST_PX), np.hanning(_TEST_PX))
    before, after = (np.fft.fft2((image - 0.4) * window) for image in (grey, colours.mean(axis=2)))
    cross, power = (np.conj(before) * after).real, np.abs(before) ** 2
    along = np.fft.fftfreq(_TEST_PX)
    responses = []
    for frequency in frequencies:
        near = np.abs(np.abs(along) - frequency) <= _BAND
        axis = np.abs(along) <= _BAND
        row, column = np.outer(axis, near), np.outer(near, axis)
        responses.append(float((cross[row].sum() + cross[column].sum()) / (power[row].sum() + power[column].sum())))
    return tuple(responses)
