"""Blocks of a frame: a chain of array operations runs at the speed of the processor's cache.

Arrays of a block fit the cache, arrays of a frame do not.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

BLOCK = 1 << 16
"""Pixels worked on at a time: half a dozen arrays of this many float32 stay in the cache. The order of random draws
depends on it, so changing it changes every frame."""


def blocks(array: NDArray[np.float32]) -> list[NDArray[np.float32]]:
    """Flat views of a contiguous array, `BLOCK` elements each but the last.

    Args:
        array: C-contiguous, any shape.

    Returns:
        views that cover it in order.
    """
    flat = array.reshape(-1)
    return [flat[start : start + BLOCK] for start in range(0, flat.size, BLOCK)]
