"""A perfect Siemens star on a pixel grid."""

from __future__ import annotations

import math

import numpy as np


def synthesise(
    height_px: int,
    width_px: int,
    periods: int,
    *,
    centre_px: tuple[float, float] | None = None,
    mean: float = 0.5,
    amplitude: float = 0.35,
    supersample: int = 1,
) -> np.ndarray:
    """A perfect star on a pixel grid.

    Args:
        height_px: height of the picture.
        width_px: width of the picture.
        periods: n, bright rays in a full turn.
        centre_px: (x, y), by default the middle of the picture.
        mean: m, brightness about which the rays swing, [0, 1].
        amplitude: a, of the rays, [0, 1].
        supersample: points per pixel and axis, averaged; 1 takes the value at the pixel's middle, many give the MTF
            sinc(fx) sinc(fy) of a square pixel.

    Returns:
        (H, W) float32. Inside the radius where rays are finer than half a cycle per point it is plain `mean`.
    """
    if centre_px is None:
        centre_px = ((width_px - 1) / 2, (height_px - 1) / 2)
    step = (np.arange(supersample) + 0.5) / supersample - 0.5
    x = (np.arange(width_px)[:, None] + step).reshape(1, -1) - centre_px[0]
    finest_px = periods / math.pi / supersample
    image = np.empty((height_px, width_px), np.float32)
    for row in range(height_px):
        y = centre_px[1] - (row + step[:, None])
        value = np.where(np.hypot(x, y) < finest_px, 0.0, np.sin(periods * np.arctan2(y, x)))
        image[row] = mean + amplitude * value.reshape(supersample, width_px, supersample).mean(axis=(0, 2))
    return image
