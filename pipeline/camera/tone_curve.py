"""The tone curve between linear light and encoded grey levels: a power law, and an S-curve where a camera has one.

    encoded = linear ** (1 / gamma),    S-curve: z = y - s / (2 pi) sin(2 pi y)

Negative numbers, as noise around black leaves them, have no grey level behind a curve: they count as black. `render`
and `linearise` are those of whole pictures, clipped to [0, 1] and several times as fast (OpenCV; last digits differ).
*Sim* frames are encoded with gamma 2.2, close to the curve of sRGB (IEC 61966-2-1). The slope decides how visible
noise is: steep in shadows and, with an S-curve, in the middle; flat in highlights.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float32]

GAMMA = 2.2
_NORMAL = np.linspace(-4.4, 4.4, 45)
_DENSITY = np.exp(-(_NORMAL**2) / 2) / np.exp(-(_NORMAL**2) / 2).sum()
_ROUNDS, _LEAST_NOISE = 8, 1e-6
_DARKEST = 1e-4  # level at which the slope is taken for darker ones; it is infinite at 0


def encode(linear: NDArray[np.floating], gamma: float = GAMMA) -> NDArray[np.floating]:
    """Encoded grey levels of linear ones, full scale 1; any shape, the same type. With gamma 1 they are the same."""
    if gamma == 1.0:
        return linear
    return np.maximum(linear, 0) ** linear.dtype.type(1.0 / gamma)


def decode(encoded: NDArray[np.floating], gamma: float = GAMMA) -> NDArray[np.floating]:
    """Linear levels of encoded ones, full scale 1; any shape, the same type. With gamma 1 they are the same."""
    if gamma == 1.0:
        return encoded
    return np.maximum(encoded, 0) ** encoded.dtype.type(gamma)


def slope(linear: NDArray[np.floating], gamma: float = GAMMA) -> NDArray[np.floating]:
    """Derivative of `encode`, ``linear ** (1 / gamma - 1) / gamma``.

    Noise after the curve is the noise before it times this. Levels below 1e-4 count as 1e-4.
    """
    if gamma == 1.0:
        return np.ones_like(linear)
    return np.maximum(linear, _DARKEST) ** (1.0 / gamma - 1.0) / gamma


def noise_after_curve(
    linear: NDArray[np.floating], sigma: NDArray[np.floating], gamma: float = GAMMA, *, clip_white: bool = True
) -> NDArray[np.float64]:
    """Standard deviation of encoded grey levels under normal noise, full scale 1: of ``encode(clip(x + s z, 0, 1))``.

    Of weak noise it is `slope` times the noise. Of strong noise in dark frames it is more, for the curve bends, and at
    black and white less, for noise is clipped there.

    Args:
        linear: (...) levels x.
        sigma: (...) standard deviations s before the curve; shapes broadcast.
        gamma: of the curve.
        clip_white: as in a picture; False: beyond white the curve goes on. Black always clips: a negative number has no
            grey level behind a curve.

    Returns:
        (...) by quadrature, exact to a few thousandths.
    """
    levels = np.asarray(linear, np.float64)[..., None] + np.asarray(sigma, np.float64)[..., None] * _NORMAL
    encoded = np.clip(levels, 0.0, 1.0 if clip_white else None) ** (1.0 / gamma)
    mean = encoded @ _DENSITY
    return np.asarray(np.sqrt(np.maximum(encoded**2 @ _DENSITY - mean**2, 0.0)))


def noise_before_curve(
    linear: NDArray[np.floating], sigma: NDArray[np.floating], gamma: float = GAMMA
) -> NDArray[np.float64]:
    """The inverse of `noise_after_curve`: standard deviation before the curve that has a given one after it.

    Args:
        linear: (...) levels.
        sigma: (...) standard deviations of encoded grey levels, above 0; shapes broadcast.
        gamma: of the curve.

    Returns:
        (...) above 0, at most 1: no noise of normal distribution is stronger after the curve than what that gives.
    """
    levels, wanted = np.broadcast_arrays(np.asarray(linear, np.float64), np.asarray(sigma, np.float64))
    before = np.clip(wanted / slope(np.maximum(levels, 1e-3), gamma), _LEAST_NOISE, 1.0)
    for _ in range(_ROUNDS):  # noise after the curve grows less than twice as fast as before it
        after = np.maximum(noise_after_curve(levels, before, gamma), _LEAST_NOISE)
        before = np.clip(before * wanted / after, _LEAST_NOISE, 1.0)
    return before


def render(linear: Float, gamma: float = GAMMA, s_curve: float = 0.0) -> Float:
    """Grey levels of a picture in linear light.

    Args:
        linear: any shape, fraction of white; clipped to [0, 1].
        gamma: exponent of the power law, 1 for none.
        s_curve: strength s of the S-curve, 0 (none) to 1.

    Returns:
        float32 in [0, 1], same shape.
    """
    encoded = _power(linear, 1 / gamma)
    if s_curve:
        encoded = encoded - np.float32(s_curve / (2 * np.pi)) * np.sin(np.float32(2 * np.pi) * encoded)
    return np.asarray(encoded, dtype=np.float32)


def linearise(encoded: Float, gamma: float = GAMMA) -> Float:
    """Linear light of a picture's grey levels, clipped to [0, 1]; the power law only."""
    return np.asarray(_power(encoded, gamma), dtype=np.float32)


def _power(values: Float, exponent: float) -> NDArray[Any]:
    import cv2

    return cv2.pow(np.clip(values, 0, 1).astype(np.float32, copy=False), exponent)
