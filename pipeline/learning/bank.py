"""What is drawn once and kept in a cache: a bank of pictures or kernels, one array in one file."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.dependencies import closure


def bank_file(folder: Path, purpose: str, seed: int, count: int, code: str) -> Path:
    """The file of a bank; its name changes with all that the bank depends on.

    Args:
        folder: of the cache.
        purpose: of the streams it is drawn from.
        seed: root of the streams.
        count: how many items it holds.
        code: dotted name of the module that draws it; the source of its import closure is part of the name.
    """
    return Path(folder) / f"{purpose.replace(' ', '-')}-{seed}-{count}-{closure.fingerprint(code)}.npy"


def kept(
    folder: Path | None, purpose: str, seed: int, count: int, code: str, draw: Callable[[], NDArray[Any]]
) -> NDArray[Any]:
    """A bank from its file, or drawn and written to it; files of the same bank by older code are removed then.

    A damaged file is named on standard error and replaced.

    Args:
        folder: of the cache; None keeps nothing.
        purpose: see `bank_file`, as for seed, count and code.
        seed: root of the streams.
        count: how many items it holds.
        code: dotted name of the module that draws it.
        draw: makes the array.

    Returns:
        the array; read-only and mapped from the file where there is a cache.
    """
    from pipeline.store import replacing

    if folder is None:
        return draw()
    path = bank_file(folder, purpose, seed, count, code)
    if path.is_file():
        try:
            return _mapped(path)
        except (OSError, EOFError, ValueError) as error:  # truncated, as by a full disk
            print(f"warning: {path}: damaged ({' '.join(str(error).split())}); drawn anew", file=sys.stderr)
    drawn = np.ascontiguousarray(draw())
    with replacing(path) as temporary, temporary.open("wb") as file:
        # as `np.save`, whose error of a full disk has neither a number nor a name
        np.lib.format.write_array_header_1_0(file, np.lib.format.header_data_from_array_1_0(drawn))
        file.write(drawn.data)
    _remove_superseded(path)
    return _mapped(path)


def _mapped(path: Path) -> NDArray[Any]:
    mapped: NDArray[Any] = np.load(path, mmap_mode="r", allow_pickle=False)
    return mapped


def _remove_superseded(path: Path) -> None:
    """Remove files of the same bank by other code, or without a fingerprint."""
    bank = path.stem.rpartition("-")[0]
    for other in (*path.parent.glob(f"{bank}-*.npy"), path.with_stem(bank)):
        if other != path:
            other.unlink(missing_ok=True)
