"""Which gradients may teach a kernel: strong ones, equally many of every orientation.

S. Cho and S. Lee, "Fast motion deblurring", SIGGRAPH Asia 2009, Sec. 4: weak gradients are noise and texture
finer than the blur, and teach a delta kernel.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

GRID = 6e-5  # resolution of the threshold, squared gradient
CEILING = 2.0  # largest squared gradient of an image in [0, 1]
RELAX_EACH_USE = 1.1
RELAX_EMPTY = 0.81


def gradients(image: NDArray) -> NDArray:
    """(2, h - 1, w - 1): horizontal and vertical forward differences, negated, where both exist."""
    anchor = image[1:, 1:]
    return np.stack([image[1:, :-1] - anchor, image[:-1, 1:] - anchor])


def first_threshold(image: NDArray, kernel_size: int) -> float:
    """The largest threshold that leaves every orientation enough pixels.

    Orientations are the four classes [0, 45), [45, 90), [-45, 0), [-90, -45) degrees of atan(py / px); enough is
    max(20 n, 10) pixels. The answer is a multiple of 6e-5; 0 where a class is too small.

    Args:
        image: (h, w) in [0, 1], the coarsest level.
        kernel_size: n at that level.

    Returns:
        threshold on px^2 + py^2.
    """
    px, py = gradients(image.astype(np.float64))
    power = px * px + py * py
    with np.errstate(divide="ignore", invalid="ignore"):
        angle = np.arctan(py / px)
    needed = max(20 * kernel_size, 10)
    grid = np.arange(round(CEILING / GRID) + 1) * GRID
    lowest = np.inf
    quarter = np.pi / 4
    for low in (0.0, quarter, -quarter, -2 * quarter):
        members = power[(angle >= low) & (angle < low + quarter)]
        if len(members) < needed:
            return 0.0
        nth = np.partition(members, len(members) - needed)[len(members) - needed]
        lowest = min(lowest, grid[max(np.searchsorted(grid, nth, side="right") - 1, 0)])
    return float(lowest)


def select(image: NDArray, threshold: float) -> tuple[NDArray, float]:
    """Gradients with everything below the threshold set to zero, and the threshold for the next use.

    The threshold is lowered by 0.81 while no pixel survives, and by 1.1 after use.

    Args:
        image: (h, w).
        threshold: on the squared gradient.

    Returns:
        (2, h - 1, w - 1) gradients and the next threshold.
    """
    both = gradients(image)
    power = both[0] * both[0]
    power += both[1] * both[1]
    top = float(power.max())
    while threshold > top > 0.0:
        threshold *= RELAX_EMPTY
    both *= power >= threshold
    return both, threshold / RELAX_EACH_USE
