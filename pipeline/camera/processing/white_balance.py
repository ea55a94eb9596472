"""White balance: gains on the red and blue pixels of the mosaic that make grey grey.

It amplifies the noise of those pixels, and clips at the white of the least amplified colour.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.processing.mosaic import per_pixel

Float = NDArray[np.float32]


def balance(raw: Float, red: float, blue: float) -> Float:
    """Amplify red and blue pixels and clip at white.

    Args:
        raw: (H, W) RGGB mosaic, fraction of white.
        red: gain of the red pixels, usually 1 to 3.
        blue: gain of the blue pixels, likewise.

    Returns:
        (H, W) float32, at most 1.
    """
    return np.minimum(raw * per_pixel((raw.shape[0], raw.shape[1]), red, blue), np.float32(1))
