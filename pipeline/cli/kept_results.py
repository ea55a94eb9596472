"""A parallel map that keeps every finished item on disk, so that an interrupted measurement continues."""

from __future__ import annotations

import hashlib
import os
import pickle
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from pipeline.executor import run_map


def keeping(folder: Path | None, workers: int = 1) -> Callable[..., list[Any]]:
    """`pipeline.executor.run_map` whose results are kept.

    Args:
        folder: of finished items, one file each, by a hash of function and item; None keeps none. It does not know of
            changed code or weights: begin with an empty one.
        workers: processes.
    """
    if folder is None:
        return partial(run_map, workers=workers)
    folder.mkdir(parents=True, exist_ok=True)

    def mapped(function: Callable[[Any], Any], items: Sequence[Any], label: str = "") -> list[Any]:
        return run_map(partial(_load_or_compute, function, folder), list(items), workers=workers, label=label)

    return mapped


def _load_or_compute(function: Callable[[Any], Any], folder: Path, item: Any) -> Any:
    path = folder / f"{hashlib.sha256(pickle.dumps((function, item))).hexdigest()}.pickle"
    if path.exists():
        return pickle.loads(path.read_bytes())
    result = function(item)
    partial_file = path.with_suffix(f".{os.getpid()}")
    partial_file.write_bytes(pickle.dumps(result))
    partial_file.replace(path)  # complete or absent, whenever the process ends
    return result
