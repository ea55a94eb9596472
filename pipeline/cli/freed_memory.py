"""Memory of arrays that are freed stays with the process, for those of the next frame.

The C library returns large blocks to the system as soon as they are freed, and the system clears every page it hands
out anew: some 4,000 pages a full-HD frame, about 5 % of the processor time of ``camera-monitor health``. Frames are of
one size, so what one has freed is what the next one takes, and memory does not grow with their number.
"""

from __future__ import annotations

import ctypes

TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3  # of mallopt(3), glibc
KEPT_BYTES = 256 << 20
"""Free memory at the end of the heap from which it is returned."""

LARGEST_BLOCK_BYTES = 32 << 20
"""Larger blocks are taken from the system one by one; the largest value that glibc allows."""


def keep_freed_memory() -> bool:
    """Have the C library keep memory that is freed; does nothing where it is not glibc.

    Returns:
        whether it does.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):  # macOS, musl, Windows
        return False
    return bool(mallopt(TRIM_THRESHOLD, KEPT_BYTES)) and bool(mallopt(MMAP_THRESHOLD, LARGEST_BLOCK_BYTES))
