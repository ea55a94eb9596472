"""From a path in the image plane to pixels."""

from __future__ import annotations

import math

import numpy as np

from pipeline.errors import InputError


def quarter_turns(angle_deg: float) -> tuple[int, float]:
    """An angle as whole quarter turns and a rest in [0, 90), so that turns by 90 degrees can be exact.

    Raises:
        InputError: the angle is not finite.
    """
    if not math.isfinite(angle_deg):
        raise InputError(f"angle_deg is {angle_deg!r}; expected a finite number of degrees")
    rest_deg = angle_deg % 90.0
    return round((angle_deg - rest_deg) / 90.0) % 4, rest_deg


def splat(x: np.ndarray, y: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Points of light spread bilinearly over their four nearest pixels, summed.

    Bilinear weights are what a square spot of one pixel leaves on square pixels; they keep the centroid exactly.

    Args:
        x: (n,) abscissae relative to the centre pixel, pixels, to the right.
        y: (n,) ordinates, pixels, upwards.
        weights: (n,) light of each point, >= 0.

    Returns:
        (m, m) float64, m odd, just large enough.
    """
    half = math.ceil(max(np.abs(x).max(), np.abs(y).max()) - 1e-9) + 1
    side = 2 * half + 1
    column, row = np.floor(x).astype(int), np.floor(-y).astype(int)
    right, down = x - column, -y - row
    image = np.zeros(side * side)
    for step_x, share_x in ((0, 1 - right), (1, right)):
        for step_y, share_y in ((0, 1 - down), (1, down)):
            cell = (row + step_y + half) * side + column + step_x + half
            image += np.bincount(cell, weights * share_x * share_y, minlength=side * side)
    return image.reshape(side, side)
