"""Tone curve: from linear light to grey levels, a power law and an S-curve.

    y = x^(1 / gamma),    z = y - s / (2 pi) sin(2 pi y)

The slope decides how visible noise is: steep in shadows and, with an S-curve, in the middle; flat in highlights.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float32]


def encode(linear: Float, gamma: float = 2.2, s_curve: float = 0.0) -> Float:
    """Grey levels of linear light.

    Args:
        linear: any shape, fraction of white; clipped to [0, 1].
        gamma: exponent of the power law, 1 for none.
        s_curve: strength s of the S-curve, 0 (none) to 1.

    Returns:
        float32 in [0, 1], same shape.
    """
    import cv2

    encoded: NDArray[Any] = cv2.pow(np.clip(linear, 0, 1).astype(np.float32, copy=False), 1 / gamma)
    if s_curve:
        encoded = encoded - np.float32(s_curve / (2 * np.pi)) * np.sin(np.float32(2 * np.pi) * encoded)
    return np.asarray(encoded, dtype=np.float32)


def decode(encoded: Float, gamma: float = 2.2) -> Float:
    """Linear light of encoded grey levels in [0, 1], power law only."""
    import cv2

    return np.asarray(cv2.pow(np.clip(encoded, 0, 1).astype(np.float32, copy=False), gamma), dtype=np.float32)
