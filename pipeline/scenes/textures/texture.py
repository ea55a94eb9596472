"""One tileable texture: albedo and slope in a pyramid of resolutions, looked up trilinearly (Williams 1983)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.errors import InputError

Array = NDArray[np.float32]
# cv2.remap wants maps below 32767 a side, so the points of a lookup are folded into rows of this length.
_ROW = 2048
_SMALLEST_PX = 4


class Texture:
    """A square, periodic texture with its relief.

    Attributes:
        size_m: side of the tile, metres.
        texel_m: side of a texel of the finest level, metres.
        mean_albedo: mean over the tile.
        levels: arrays (S, S, 3) of albedo, dh/du, dh/dv; S halves from level to level.
    """

    def __init__(self, albedo: ArrayLike, height: ArrayLike, size_m: float, relief_m: float = 0.0) -> None:
        """Slopes are central differences of the periodic height field.

        Args:
            albedo: (S, S) diffuse albedo, row = v, column = u; S a power of two.
            height: (S, S) height field in any unit, usually of unit deviation.
            size_m: side of the tile, metres.
            relief_m: metres per unit of `height`; 0 is flat.

        Raises:
            InputError: the arrays are not equal squares whose side is a power of two of at least 4.
        """
        albedo = np.asarray(albedo, np.float32)
        height = np.asarray(height, np.float32)
        side = len(albedo)
        if albedo.shape != (side, side) or height.shape != albedo.shape or side < _SMALLEST_PX or side & (side - 1):
            raise InputError(
                f"texture: albedo {albedo.shape} and height {height.shape} must be equal squares "
                "with a side of 4, 8, 16 ... texels"
            )
        self.size_m = float(size_m)
        self.texel_m = self.size_m / side
        self.mean_albedo = float(albedo.mean(dtype=np.float64))
        slope = np.float32(0.5 * relief_m / self.texel_m)
        level = np.dstack(
            [
                albedo,
                (np.roll(height, -1, 1) - np.roll(height, 1, 1)) * slope,
                (np.roll(height, -1, 0) - np.roll(height, 1, 0)) * slope,
            ]
        )
        self.levels: list[Array] = [np.ascontiguousarray(level, np.float32)]
        while side > 1:
            side //= 2
            smaller = cv2.resize(self.levels[-1], (side, side), interpolation=cv2.INTER_AREA)
            self.levels.append(np.asarray(smaller, np.float32))

    def sample(self, uv: ArrayLike, footprint_m: ArrayLike) -> tuple[Array, Array]:
        """Albedo and slope at K points, averaged over about the footprint.

        Args:
            uv: (K, 2) metres along the surface; any range, the tile repeats.
            footprint_m: (K,) or a number: side of the area seen by a sample, metres.

        Returns:
            albedo (K,) and slope (K, 2) = (dh/du, dh/dv).
        """
        uv = np.asarray(uv, np.float32).reshape(-1, 2)
        footprint = np.broadcast_to(np.asarray(footprint_m, np.float32), (len(uv),))
        depth = np.log2(np.maximum(footprint, 1e-9) / np.float32(self.texel_m))
        depth = np.clip(depth, 0.0, len(self.levels) - 1.001)
        whole = depth.astype(np.int32)
        part = (depth - whole).astype(np.float32)[:, None]
        result = np.empty((len(uv), 3), np.float32)
        for level in np.unique(whole):
            chosen = np.flatnonzero(whole == level)
            fine = self._bilinear(int(level), uv[chosen])
            coarse = self._bilinear(int(level) + 1, uv[chosen])
            result[chosen] = fine + (coarse - fine) * part[chosen]
        return result[:, 0], result[:, 1:]

    def _bilinear(self, level: int, uv: Array) -> Array:
        """(K, 3) values of one level; texel centres lie at half integers."""
        pixels = self.levels[level]
        where = np.mod(uv / np.float32(self.size_m), np.float32(1.0)) * np.float32(len(pixels)) - np.float32(0.5)
        count = len(where)
        rows = -(-count // _ROW)
        folded = np.zeros((2, rows * _ROW), np.float32)
        folded[:, :count] = where.T
        across, along = folded.reshape(2, rows, _ROW)
        looked_up = cv2.remap(pixels, across, along, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
        return np.asarray(looked_up.reshape(-1, 3)[:count], np.float32)
