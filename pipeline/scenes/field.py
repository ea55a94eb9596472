"""Smooth random fields over surfaces and the sky: one cheap lookup where a full texture would be waste."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.scenes.textures import library

Array = NDArray[np.float32]

_ROW = 2048  # cv2.remap takes maps of up to 32766 a side, so points are folded into rows


@lru_cache(maxsize=8)
def _periodic(name: str, level: int) -> Array:
    """One level of a texture's first channel, at unit deviation, with a border that continues it."""
    values = library()[name].levels[level][..., 0]
    values = (values - values.mean()) / values.std()
    return np.ascontiguousarray(np.pad(values, 1, mode="wrap"))


def field(
    uv: Array, footprint_m: Array, size_m: float, shift: float = 0.0, *, name: str = "fbm", level: int = 3
) -> Array:
    """Zero-mean, unit-deviation 1/f noise whose tile is `size_m` wide.

    It is looked up bilinearly at one fixed level and fades where a sample covers more than a few texels, so a
    value depends on its own point only.

    Args:
        uv: (K, 2) metres (or any unit, the same as `size_m`).
        footprint_m: (K,) size of a sample on the surface.
        size_m: side of the tile.
        shift: of the tile, as a part of it; gives independent fields.
        name: texture of the library that holds the noise.
        level: of its pyramid; 3 keeps an eighth of its detail.

    Returns:
        (K,) float32.
    """
    values = _periodic(name, level)
    side = len(values) - 2
    where = uv * np.float32(1.0 / size_m)
    where += np.float32(shift)
    where -= np.floor(where)
    count = len(uv)
    if count == 0:
        return np.zeros(0, np.float32)
    rows = -(-count // _ROW)
    folded = np.zeros((rows * _ROW, 2), np.float32)
    # texel centres lie at half integers, and the border adds one
    np.multiply(where, np.float32(side), out=folded[:count])
    folded[:count] += np.float32(0.5)
    across, down = cv2.split(folded.reshape(rows, _ROW, 2))
    selected = np.asarray(cv2.remap(values, across, down, cv2.INTER_LINEAR)).reshape(-1)[:count]
    coarse = footprint_m * np.float32(side / (6.0 * size_m))
    return np.asarray(selected / (1.0 + coarse * coarse), np.float32)
