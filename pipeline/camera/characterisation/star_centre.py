"""The centre of a Siemens star with an even number of rays: the point about which the picture is symmetric.

A star of n rays, n even, equals itself turned by half a turn. The correlation of a picture with its copy turned about
the top left pixel peaks at the shift 2 c, c being the centre; a parabola through the peak gives fractions.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.quantise import check_finite
from pipeline.errors import InputError

LARGEST_OFFSET_FRACTION = 0.25  # of the centre from the middle of the picture, per axis
LEAST_POWER = 1e-9


def point_of_symmetry(image: NDArray[np.floating]) -> tuple[float, float]:
    """The point about which a picture is symmetric.

    Args:
        image: (H, W), the star's centre within a quarter of its size from the middle.

    Returns:
        (x, y) px, counted from the middle of the top left pixel.

    Raises:
        InputError: not a picture, one with values that are not finite, or one without structure.
    """
    picture = np.asarray(image, dtype=np.float64)
    check_finite(picture, "star")
    if picture.ndim != 2 or picture.std() < 1e-6:
        raise InputError(f"star: a picture of shape {picture.shape} without structure; expected (H, W) with a star")
    height, width = picture.shape
    window = np.outer(np.hanning(height), np.hanning(width))
    centred = (picture - picture.mean()) * window
    shape = (2 * height, 2 * width)
    spectrum = np.fft.rfft2(centred, shape)
    correlation = np.fft.irfft2(spectrum**2, shape)  # of the picture with its copy turned about (0, 0): peak at 2 c
    near, far = 1 - 2 * LARGEST_OFFSET_FRACTION, 1 + 2 * LARGEST_OFFSET_FRACTION
    rows, columns = (slice(round((size - 1) * near), round((size - 1) * far) + 1) for size in (height, width))
    inside = correlation[rows, columns]
    row, column = np.unravel_index(int(inside.argmax()), inside.shape)
    y, x = int(row) + rows.start, int(column) + columns.start
    return (x + _vertex(correlation[y, x - 1 : x + 2])) / 2, (y + _vertex(correlation[y - 1 : y + 2, x])) / 2


def _vertex(three: NDArray[np.float64]) -> float:
    """Position of the vertex of the parabola through three values, -0.5 to 0.5 from the middle one."""
    if len(three) != 3:
        return 0.0
    bend = three[0] - 2 * three[1] + three[2]
    return float(np.clip((three[0] - three[2]) / (2 * bend), -0.5, 0.5)) if bend < -LEAST_POWER else 0.0
