"""Things strewn over a torus: blades of grass as lines, fallen leaves as shaded ellipses."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]
# Sub-texel bits of OpenCV's fixed-point drawing coordinates.
_SHIFT = 4


def _copies(start: Array, size_px: int, margin_px: int) -> tuple[NDArray[np.intp], Array]:
    """Which item to draw where: every item, and again across each border it is near to; in order of items."""
    order, places = [], []
    for across in (-size_px, 0, size_px):
        for along in (-size_px, 0, size_px):
            moved = start + np.array([across, along], np.float32)
            near = ((moved > -margin_px) & (moved < size_px + margin_px)).all(axis=1)
            order.append(np.flatnonzero(near))
            places.append(moved[near])
    which = np.concatenate(order)
    sequence = np.argsort(which, kind="stable")
    return which[sequence], np.concatenate(places)[sequence]


def blades(
    generator: np.random.Generator,
    size_px: int,
    count: int,
    length_px: tuple[float, float],
    mean: float,
    spread: float,
) -> Array:
    """Straight strokes at any angle, the later over the earlier.

    Args:
        generator: random numbers.
        size_px: side of the field.
        count: number of strokes.
        length_px: shortest and longest.
        mean: mean value of a stroke, and the ground.
        spread: standard deviation of a stroke's value.

    Returns:
        (size_px, size_px) field.
    """
    start = generator.uniform(0, size_px, (count, 2)).astype(np.float32)
    angle = generator.uniform(0, 2 * np.pi, count)
    reach = generator.uniform(*length_px, count)
    value = mean + spread * generator.standard_normal(count)
    width = generator.integers(1, 3, count)
    margin = int(np.ceil(length_px[1])) + 2
    canvas = np.full((size_px + 2 * margin,) * 2, mean, np.float32)
    which, places = _copies(start, size_px, margin)
    step = np.stack([np.cos(angle), np.sin(angle)], axis=1) * reach[:, None]
    ends = np.round(np.concatenate([places, places + step[which]], axis=1) * 2**_SHIFT).astype(int)
    ends += margin << _SHIFT
    for (x0, y0, x1, y1), tone, thick in zip(ends.tolist(), value[which].tolist(), width[which].tolist(), strict=True):
        cv2.line(canvas, (x0, y0), (x1, y1), tone, thick, cv2.LINE_8, _SHIFT)
    return canvas[margin:-margin, margin:-margin].copy()


def leaves(
    generator: np.random.Generator,
    size_px: int,
    count: int,
    radius_px: tuple[float, float],
    mean: float,
    spread: float,
) -> Array:
    """Filled ellipses with a darker rim on one side, the later over the earlier; arguments as `blades`."""
    start = generator.uniform(0, size_px, (count, 2)).astype(np.float32)
    radius = generator.uniform(*radius_px, count)
    aspect = generator.uniform(0.3, 0.8, count)
    angle = generator.uniform(0, 360, count)
    value = mean + spread * generator.standard_normal(count)
    margin = int(np.ceil(radius_px[1])) + 2
    canvas = np.full((size_px + 2 * margin,) * 2, mean, np.float32)
    which, places = _copies(start, size_px, margin)
    for item, (x, y) in zip(which.tolist(), places.tolist(), strict=True):
        axes = (max(1, int(radius[item])), max(1, int(radius[item] * aspect[item])))
        centre = (int(x + margin), int(y + margin))
        tone = float(value[item])
        cv2.ellipse(canvas, centre, axes, float(angle[item]), 0, 360, tone, -1)
        cv2.ellipse(canvas, centre, axes, float(angle[item]), 200, 340, tone * 0.6, 1)
    return canvas[margin:-margin, margin:-margin].copy()
