"""Saturated pixels and patches: grey levels that the 8-bit range has clipped.

A pixel x in [0, 1] is saturated within half a DN of black or white, ``x <= 1/2 / 255`` or ``x >= 1 - 1/2 / 255``: it
rounds to 0 or 255. A patch is saturated where at least a given fraction of its pixels is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.constants import FULL_SCALE_DN

SATURATED = "saturated"
"""Reason of an abstention: the patch is saturated."""

SATURATED_FRACTION = 0.5
"""Default fraction of saturated pixels, in (0, 1], from which a patch is saturated: clipping half of the pixels takes
about 30 % from a standard deviation of noise (half-normal), and edges are clipped rather than blurred."""

BLACK_BELOW_DN, WHITE_ABOVE_DN = 0.5, FULL_SCALE_DN - 0.5
"""Grey levels, DN, up to which and from which a pixel is saturated."""

_HALF_DN = 0.5 / FULL_SCALE_DN


def saturated_pixels(image: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Which pixels are saturated.

    Args:
        image: any shape, grey levels in [0, 1].

    Returns:
        bool, same shape.
    """
    return (image <= _HALF_DN) | (image >= 1.0 - _HALF_DN)


def saturated_fraction(patches: NDArray[np.floating]) -> NDArray[np.float64]:
    """Fraction of saturated pixels of each patch.

    Args:
        patches: (N, ...) grey levels in [0, 1].

    Returns:
        (N,) in [0, 1].
    """
    fraction = np.zeros(len(patches))
    if len(patches) == 0:
        return fraction
    axes = tuple(range(1, patches.ndim))
    lowest, highest = patches.min(axis=axes), patches.max(axis=axes)
    for index in np.flatnonzero((lowest <= _HALF_DN) | (highest >= 1.0 - _HALF_DN)):  # most patches touch neither end
        patch = patches[index]
        fraction[index] = np.count_nonzero(saturated_pixels(patch)) / patch.size
    return fraction


def is_saturated(patches: NDArray[np.floating], fraction: float = SATURATED_FRACTION) -> NDArray[np.bool_]:
    """Which patches are saturated.

    Args:
        patches: (N, ...) grey levels in [0, 1].
        fraction: of saturated pixels from which a patch is, (0, 1].

    Returns:
        (N,) bool.
    """
    return saturated_fraction(patches) >= fraction
