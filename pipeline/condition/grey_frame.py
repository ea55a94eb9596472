"""A frame as callers hand it in, checked: grey levels in [0, 1] as the camera encoded them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import as_array
from pipeline.camera.constants import RANGE_SLACK
from pipeline.errors import InputError


def grey_frame(image: Any) -> NDArray[np.float32]:
    """A frame as float32; every pixel is checked, also those that no patch covers.

    Args:
        image: (H, W) float in [0, 1], NumPy or torch; values beyond by rounding (`RANGE_SLACK`) are clipped.

    Returns:
        (H, W) in [0, 1], C-contiguous.

    Raises:
        InputError: not such a frame, with masked pixels, or with NaN.
    """
    picture = as_array(image)
    if np.ma.is_masked(picture):
        raise InputError("frame: masked pixels are not estimated; cut the frame to a rectangle without them")
    is_grey = isinstance(picture, np.ndarray) and picture.ndim == 2 and picture.size > 0
    if not is_grey or not np.issubdtype(picture.dtype, np.floating):
        given = f"{getattr(picture, 'dtype', type(picture).__name__)} {getattr(picture, 'shape', '')}".strip()
        raise InputError(f"frame: got {given}; expected (H, W) floats in [0, 1], grey (divide 8-bit frames by 255)")
    picture = np.ascontiguousarray(picture, dtype=np.float32)
    least, greatest = picture.min(), picture.max()
    if not (least >= -RANGE_SLACK and greatest <= 1.0 + RANGE_SLACK):  # NaN is neither
        raise InputError(
            f"frame: spans {least:.9g} .. {greatest:.9g}; expected numbers in [0, 1], none of them NaN "
            "(divide 8-bit frames by 255; clip after filtering)"
        )
    return picture if least >= 0.0 and greatest <= 1.0 else np.clip(picture, 0.0, 1.0)
