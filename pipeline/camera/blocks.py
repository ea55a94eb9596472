"""Blocks and memory: what lets a chain of array operations run at the speed of the processor's cache.

Two facts decide the time of a frame. Arrays of a block fit the cache, arrays of a frame do not. And every fresh array
of a frame costs hundreds of page faults if the allocator has given the memory of the previous one back to the
operating system, which takes longer than filling it with random numbers.
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


def keep_freed_memory() -> None:
    """Let the process keep memory of freed frames for the next ones.

    The GNU allocator maps large arrays separately and unmaps them when freed, until a mapped array of that size has
    been freed once; its threshold follows the largest so far, up to 32 MiB. Freeing one such array, never touched and
    so free of cost, teaches it at once. Other allocators are not affected.
    """
    np.empty((1 << 25) - (1 << 16), np.uint8)
