"""Where the numbers of a record come from: pictures and kernels by their SHA-256, and the settings.

No path of the machine that measured is kept: of a file its name, of a folder nothing.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline import store
from pipeline.camera.paper_kernels import PaperKernel
from pipeline.detection.weights import file_sha256
from pipeline.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.camera.psf.kernel import Kernel
    from pipeline.config.schema import Config
    from pipeline.datasets.frame import Frame


def provenance(
    config: Config,
    dataset: str,
    source: str,
    frames: Iterable[Frame],
    settings: Mapping[str, Any],
    weights: Mapping[str, Any],
    kernels: Sequence[Kernel] = (),
) -> dict[str, Any]:
    """What a record keeps beside its numbers.

    Args:
        config: with the dataset in it.
        dataset: its name there.
        source: where pictures and kernels come from, their revision and licence, in words.
        frames: measured.
        settings: of the experiment and its estimators.
        weights: file name -> SHA-256 of the weights used; of several estimators, by their names.
        kernels: behind which frames were measured.
    """
    listed = list(frames)
    return {
        "source": source,
        "dataset": dataset,
        "kind": config.datasets[dataset].kind,
        "frames": {frame.name: file_sha256(frame.path) for frame in listed},
        "previous": {path.name: file_sha256(path) for frame in listed for path in frame.previous},
        "kernels": {kernel.name: kernel_sha256(kernel) for kernel in kernels},
        "weights": dict(weights),
        "settings": without_folders(settings),
        "camera": config.camera.described(),
        "seed": config.seed,
    }


def kernel_sha256(kernel: Kernel) -> str:
    """Of the picture it was read from, or of its numbers as float32."""
    if isinstance(kernel, PaperKernel):
        return file_sha256(kernel.path)
    return hashlib.sha256(kernel.psf.astype("<f4").tobytes()).hexdigest()


def without_folders(content: Any) -> Any:
    """The same settings with absolute paths cut down to the names of files."""
    if isinstance(content, Mapping):
        return {name: without_folders(value) for name, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [without_folders(value) for value in content]
    return Path(content).name if isinstance(content, (str, Path)) and Path(content).is_absolute() else content


def write_csv(path: Path, table: pd.DataFrame) -> None:
    """A table as CSV with six digits: enough to compare, and the same on every machine but for rounding."""
    store.write_text(path, table.to_csv(index=False, float_format="%.6g", lineterminator="\n"))


def released_sha256(paths: Iterable[str | Path], of: str) -> dict[str, str]:
    """File name -> SHA-256 of weights, by name.

    Args:
        paths: of the files.
        of: estimator that uses them, for the message.

    Raises:
        InputError: a file is absent.
    """
    files = sorted({Path(path) for path in paths})
    for path in files:
        if not path.is_file():
            raise InputError(f"weights of {of}: no file {path}; restore data/weights")
    return {path.name: file_sha256(path) for path in files}
