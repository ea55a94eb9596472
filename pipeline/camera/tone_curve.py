"""The tone curve between linear light and encoded grey levels: ``encoded = linear ** (1 / gamma)``.

Below 0 (noise around black) the curve is continued as an odd function, so that noise keeps its sign. *Sim* frames are
encoded with gamma 2.2, close to the curve of sRGB (IEC 61966-2-1).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

GAMMA = 2.2
_DARKEST = 1e-4  # level at which the slope is taken for darker ones; it is infinite at 0


def encode(linear: NDArray[np.floating], gamma: float = GAMMA) -> NDArray[np.floating]:
    """Encoded grey levels of linear ones, full scale 1; any shape, the same type."""
    if gamma == 1.0:
        return linear
    return np.sign(linear) * np.abs(linear) ** linear.dtype.type(1.0 / gamma)


def decode(encoded: NDArray[np.floating], gamma: float = GAMMA) -> NDArray[np.floating]:
    """Linear levels of encoded ones, full scale 1; any shape, the same type."""
    if gamma == 1.0:
        return encoded
    return np.sign(encoded) * np.abs(encoded) ** encoded.dtype.type(gamma)


def slope(linear: NDArray[np.floating], gamma: float = GAMMA) -> NDArray[np.floating]:
    """Derivative of `encode`, ``linear ** (1 / gamma - 1) / gamma``.

    Noise after the curve is the noise before it times this. Levels below 1e-4 count as 1e-4.
    """
    if gamma == 1.0:
        return np.ones_like(linear)
    return np.maximum(linear, _DARKEST) ** (1.0 / gamma - 1.0) / gamma
