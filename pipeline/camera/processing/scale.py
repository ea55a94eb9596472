"""Scaling of the picture to the delivered number of pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError, did_you_mean

Float = NDArray[np.float32]
METHODS = ("area", "linear", "cubic")


def resize(picture: Float, factor: float, method: str = "area") -> Float:
    """A picture (H, W, C) at another size.

    Args:
        picture: float32.
        factor: delivered over original pixels per axis; 1 leaves it as it is.
        method: one of `METHODS`.

    Raises:
        InputError: an unknown method or a factor that is not positive.
    """
    import cv2

    if factor == 1.0:
        return picture
    if method not in METHODS:
        raise InputError(f"scaling: no method {method!r}; {did_you_mean(method, METHODS)}")
    if not factor > 0:
        raise InputError(f"scaling: factor={factor!r}, expected a positive number")
    height, width = (max(round(side * factor), 1) for side in picture.shape[:2])
    code = {"area": cv2.INTER_AREA, "linear": cv2.INTER_LINEAR, "cubic": cv2.INTER_CUBIC}[method]
    return np.asarray(cv2.resize(picture, (width, height), interpolation=code), dtype=np.float32)
