"""Memory that a stage frees stays with its process, to be used again.

glibc returns large blocks to the system as soon as they are free, and the next array of that size is given to the
process page by page again, each zeroed by the system: 4 to 13 % of the processor time of stages whose arrays have some
megabytes (a network on a frame), under a hypervisor more. Here blocks of up to `BLOCK_BYTES` come from the heap, which
shrinks only where `KEPT_BYTES` at its end are free. No result changes.
"""

from __future__ import annotations

import ctypes
import platform
from collections.abc import MutableMapping

BLOCK_BYTES = 32 << 20
"""Larger blocks are mapped one by one; the most that every version of glibc accepts."""
KEPT_BYTES = 1 << 30

_OPTIONS = {
    "MALLOC_MMAP_THRESHOLD_": (-3, BLOCK_BYTES),
    "MALLOC_TRIM_THRESHOLD_": (-1, KEPT_BYTES),
}  # environment variable that glibc reads when a program starts -> number of the option (malloc.h), value


def keep(environment: MutableMapping[str, str]) -> bool:
    """Keep what is freed, in this process and in programs started with an environment.

    Args:
        environment: gets the variables that glibc reads; one that is set already keeps its value.

    Returns:
        whether this process keeps it: False where the C library is not glibc.
    """
    options = {name: option for name, option in _OPTIONS.items() if name not in environment}
    environment.update({name: str(value) for name, (_, value) in options.items()})
    if platform.libc_ver()[0] != "glibc":
        return False
    library = ctypes.CDLL(None)
    accepted = [library.mallopt(number, value) for number, value in options.values()]
    return all(accepted)
