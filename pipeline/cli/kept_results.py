"""A parallel map that keeps every measured frame on disk, so that an interrupted recording continues."""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from pipeline.executor import run_map


def keeping(folder: Path | None, workers: int = 1) -> Callable[..., list[Any]]:
    """`pipeline.executor.run_map` that keeps results which are tables of columns, as measured frames are.

    Args:
        folder: of the kept results, one file each, named by a hash of function and item; None keeps none. The hash does
            not know of changed code or weights: begin with an empty folder.
        workers: processes.
    """
    if folder is None:
        return partial(run_map, workers=workers)
    folder.mkdir(parents=True, exist_ok=True)

    def mapped(function: Callable[[Any], Any], items: Sequence[Any], label: str = "") -> list[Any]:
        return run_map(partial(_load_or_compute, function, folder), list(items), workers=workers, label=label)

    return mapped


def _load_or_compute(function: Callable[[Any], Any], folder: Path, item: Any) -> Any:
    import numpy as np

    from pipeline import store

    path = folder / f"{hashlib.sha256(pickle.dumps((function, item))).hexdigest()}.npz"
    if path.exists():
        return store.read_arrays(path)
    result = function(item)
    if isinstance(result, dict) and result and all(isinstance(column, np.ndarray) for column in result.values()):
        text = {name: column.astype(np.str_) for name, column in result.items() if column.dtype == object}
        store.write_arrays(path, **{**result, **text})
    return result
