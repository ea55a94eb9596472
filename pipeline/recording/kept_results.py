"""A parallel map that keeps measured frames on disk, so that an interrupted recording continues.

A result is kept under a hash of the function, its item, the code that the recording module can execute and the weights
in use (`keyed`): an edit of the code or other weights compute it anew. The hash is the same in every process, for any
number of workers (`pipeline.recording.stable_digest`). Contents of pictures do not enter: frames are known by their
names, so that a folder serves one copy of a dataset.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.dependencies.closure import fingerprint
from pipeline.errors import InputError
from pipeline.executor import run_map
from pipeline.recording.stable_digest import stable_digest

if TYPE_CHECKING:
    from numpy.typing import NDArray

Map = Callable[..., list[Any]]
REMEDY = "delete it and repeat the command"
"""For a kept file that is broken."""


@dataclass(frozen=True)
class KeptMap:
    """`pipeline.executor.run_map` that keeps results which are tables of columns, as measured frames are.

    Attributes:
        folder: of the kept results, one file each.
        workers: processes.
        key: of code and weights, see `keyed`; nothing is kept without one.
    """

    folder: Path
    workers: int = 1
    key: str = ""

    def __call__(self, function: Callable[[Any], Any], items: Sequence[Any], label: str = "") -> list[Any]:
        """See `pipeline.executor.run_map`.

        Args:
            function: as there.
            items: as there.
            label: as there.

        Raises:
            InputError: a kept file is broken.
            TypeError: the function or an item holds a value that `pipeline.recording.stable_digest` has no digest of.
            Exception: whatever `pipeline.executor.run_map` raises.
        """
        if self.key:
            function = partial(_load_or_compute, function, self.folder, stable_digest((self.key, function)))
        return run_map(function, list(items), workers=self.workers, label=label)


def keeping(folder: Path | None, workers: int = 1) -> Map:
    """The map of a recording.

    Args:
        folder: of kept results; None keeps none.
        workers: processes.
    """
    if folder is None:
        return partial(run_map, workers=workers)
    folder.mkdir(parents=True, exist_ok=True)
    return KeptMap(folder, workers)


def keyed(mapped: Map, module: str, weights: Mapping[str, Any]) -> Map:
    """The same map, whose kept results are those of this code and these weights.

    Args:
        mapped: from `keeping`; any other map is returned as it is.
        module: that records, ``__name__``: all code that it can execute counts.
        weights: SHA-256 of the weight files in use, nested in any way.
    """
    return replace(mapped, key=fingerprint(module, weights)) if isinstance(mapped, KeptMap) else mapped


def kept_tables(folder: Path) -> list[dict[str, NDArray[Any]]]:
    """Every kept result, of whatever code and weights, by file name: columns by name.

    Args:
        folder: of a `KeptMap`.

    Raises:
        InputError: there is no such folder, or a file is broken.
    """
    from pipeline import store

    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; give the one that --keep wrote")
    return [store.read_arrays(path, REMEDY) for path in sorted(folder.glob("[!.]*.npz"))]


def _load_or_compute(function: Callable[[Any], Any], folder: Path, key: str, item: Any) -> Any:
    import numpy as np

    from pipeline import store

    path = folder / f"{stable_digest((key, item))}.npz"
    if path.exists():
        return store.read_arrays(path, REMEDY)
    result = function(item)
    if isinstance(result, dict) and result and all(isinstance(column, np.ndarray) for column in result.values()):
        text = {name: column.astype(np.str_) for name, column in result.items() if column.dtype == object}
        store.write_arrays(path, **{**result, **text})
    return result
