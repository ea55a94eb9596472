"""Making an image periodic without edges, so that it can be deconvolved with the fast Fourier transform.

R. Liu and J. Jia, "Reducing boundary artifacts in image deconvolution", ICIP 2008: the image is extended by
strips that solve the Laplace equation between opposite borders.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import count

import numpy as np
from numpy.typing import NDArray
from scipy import fft

_LAST_PRIMES = (11, 13)


@lru_cache(maxsize=256)
def fast_length(least: int) -> int:
    """The smallest length >= ``least`` of the form 2^a 3^b 5^c 7^d, or that times 11 or 13."""
    for length in count(max(least, 1)):
        rest = length
        for prime in (2, 3, 5, 7):
            while rest % prime == 0:
                rest //= prime
        if rest == 1 or rest in _LAST_PRIMES:
            return length
    raise AssertionError("unreachable")


def laplace(border: NDArray) -> NDArray:
    """Solve the Laplace equation on a rectangle with given border values.

    The five-point Laplacian is diagonal under the sine transform (DST-I) of the inner points, with
    eigenvalues 2 cos(pi i / (h - 1)) - 2 + 2 cos(pi j / (w - 1)) - 2.

    Args:
        border: (h, w); only the outermost rows and columns are read.

    Returns:
        (h, w) with the same border.
    """
    height, width = border.shape
    if height <= 2 or width <= 2:
        return border.copy()
    frame = border.copy()
    frame[1:-1, 1:-1] = 0
    source = -(frame[1:-1, 2:] + frame[1:-1, :-2] + frame[:-2, 1:-1] + frame[2:, 1:-1])
    down = 2 * np.cos(np.pi * np.arange(1, height - 1) / (height - 1)) - 2
    across = 2 * np.cos(np.pi * np.arange(1, width - 1) / (width - 1)) - 2
    spectrum = fft.dstn(source, type=1)
    spectrum /= (down[:, None] + across).astype(source.dtype)
    frame[1:-1, 1:-1] = fft.idstn(spectrum, type=1)
    return frame


def _ramp(first: NDArray, last: NDArray, steps: int) -> NDArray:
    part = (np.arange(steps) / max(steps - 1, 1)).astype(first.dtype)
    return (1 - part) * first + part * last


def smooth_wrap(image: NDArray, shape: tuple[int, int]) -> NDArray:
    """Extend an image to a periodic one.

    The bottom strip is taken one row late with respect to the right and corner strips (it repeats the image's
    last row and lacks the strip's last); so does the program whose results are reproduced, and kernels depend
    on it in the third digit.

    Args:
        image: (h, w).
        shape: (rows, columns) wanted, each at least 2 more than the image has.
    """
    height, width = image.shape
    rows, columns = shape[0] - height, shape[1] - width
    bottom = np.zeros((rows + 2, width), image.dtype)
    bottom[0], bottom[-1] = image[-1], image[0]
    for side in (0, -1):
        bottom[1:-1, side] = _ramp(bottom[0, side], bottom[-1, side], rows)
    bottom = laplace(bottom)
    right = np.zeros((height, columns + 2), image.dtype)
    right[:, 0], right[:, -1] = image[:, -1], image[:, 0]
    for side in (0, -1):
        right[side, 1:-1] = _ramp(right[side, 0], right[side, -1], columns)
    right = laplace(right)
    corner = np.zeros((rows + 2, columns + 2), image.dtype)
    corner[0], corner[-1] = right[-1], right[0]
    corner[:, 0], corner[:, -1] = bottom[:, -1], bottom[:, 0]
    corner = laplace(corner)
    return np.block([[image, right[:, 1:-1]], [bottom[:-2], corner[1:-1, 1:-1]]])
