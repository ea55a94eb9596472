"""What is drawn once and kept in a cache: a bank of pictures or kernels, one array in one file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


def kept(folder: Path | None, purpose: str, seed: int, count: int, draw: Callable[[], NDArray[Any]]) -> NDArray[Any]:
    """A bank from its file, or drawn and written to it.

    Args:
        folder: of the cache; None keeps nothing.
        purpose: of the streams it is drawn from; like seed and count, part of the file's name.
        seed: root of the streams.
        count: how many things it holds.
        draw: makes the array.

    Returns:
        the array; read-only and mapped from the file where there is a cache.
    """
    from pipeline.store import replacing

    if folder is None:
        return draw()
    path = Path(folder) / f"{purpose.replace(' ', '-')}-{seed}-{count}.npy"
    if not path.is_file():
        drawn = draw()
        with replacing(path) as temporary:
            np.save(temporary, drawn, allow_pickle=False)
    mapped: NDArray[Any] = np.load(path, mmap_mode="r", allow_pickle=False)
    return mapped
