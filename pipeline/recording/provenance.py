"""Where the numbers of a record come from: pictures, kernels and weights by their SHA-256, and the settings.

No path of the machine that measured is kept: of a file its name, of a folder nothing.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline import blur, noise, store
from pipeline.camera.psf.paper_kernels import PaperKernel
from pipeline.errors import InputError
from pipeline.store import file_sha256
from pipeline.weight_files import active

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    from numpy.typing import NDArray

    from pipeline.camera.psf.kernel import Kernel
    from pipeline.condition import ConditionMonitor
    from pipeline.config.schema import Config
    from pipeline.datasets.frame import Frame
    from pipeline.experiments.settings import EstimatorSettings
    from pipeline.registry import Registry

Weights = dict[str, str]
"""File name -> SHA-256."""


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
        weights: file name -> SHA-256 of the weights used, by estimator.
        kernels: behind which frames were measured.
    """
    listed = list(frames)
    return {
        "source": source,
        "dataset": dataset,
        "kind": config.datasets[dataset].kind,
        **inputs_of(listed, {kernel.name: kernel_sha256(kernel) for kernel in kernels}),
        "weights": dict(weights),
        "settings": without_folders(settings),
        "camera": config.camera.described(),
        "seed": config.seed,
    }


def inputs_of(frames: Sequence[Frame], kernels: Mapping[str, str] | None = None) -> dict[str, Any]:
    """Pictures, labels and kernels that were measured, by their content: the revision of a source that has none.

    Args:
        frames: measured.
        kernels: name -> SHA-256.

    Returns:
        name -> SHA-256 as ``frames``, ``previous``, ``labels`` (boxes as they are read) and ``kernels``, and
        ``inputs_sha256``, one hash of all of these (`content_sha256`).
    """
    files: dict[str, Mapping[str, str]] = {
        "frames": {frame.name: file_sha256(frame.path) for frame in frames},
        "previous": sha256_of(path for frame in frames for path in frame.previous),
        "labels": {frame.name: _labels_sha256(frame) for frame in frames if frame.boxes},
        "kernels": dict(kernels or {}),
    }
    return {**files, "inputs_sha256": content_sha256(files)}


INPUTS = ("frames", "previous", "labels", "kernels", "datasets", "files")
"""Keys of a provenance that `content_sha256` is of; the last two are of records of real noise."""


def content_sha256(about: Mapping[str, Any]) -> str:
    """One hash of all pictures, labels and kernels of a record: of the JSON of their hashes, keys sorted.

    Args:
        about: a provenance, or `inputs_of`; of `INPUTS`, those that it lacks are left out.
    """
    files = {name: about[name] for name in INPUTS if about.get(name)}
    return hashlib.sha256(json.dumps(files, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def _labels_sha256(frame: Frame) -> str:
    rows = [[box.label, *(repr(float(v)) for v in (box.x1, box.y1, box.x2, box.y2)), box.ignore] for box in frame.boxes]
    return hashlib.sha256(json.dumps(rows).encode()).hexdigest()


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


def write_record(
    out: Path,
    tables: Mapping[str, pd.DataFrame],
    about: Mapping[str, Any],
    about_file: str,
    pictures: Mapping[str, NDArray[np.uint8]] | None = None,
) -> None:
    """Write tables and where they come from.

    Args:
        out: folder; replaced.
        tables: file name -> table.
        about: the provenance; `content_sha256` of it is added.
        about_file: its file name.
        pictures: file name -> (h, w) picture to look at.
    """
    with store.replacing_folder(out) as folder:
        for name, table in tables.items():
            write_csv(folder / name, table)
        for name, picture in (pictures or {}).items():
            store.write_image(folder / name, picture)
        store.write_json(folder / about_file, {**about, "inputs_sha256": content_sha256(about)})


def write_csv(path: Path, table: pd.DataFrame) -> None:
    """A table as CSV with six digits: enough to compare, and the same on every machine but for rounding."""
    store.write_text(path, csv_text(table))


def csv_text(table: pd.DataFrame) -> str:
    """The text that `write_csv` writes."""
    return str(table.to_csv(index=False, float_format="%.6g", lineterminator="\n"))


def blur_weights(kind: str, options: Mapping[str, Any] | None = None) -> Weights:
    """Files that a blur estimator has learned from training: its networks, and its map to a generic lens if it uses it.

    Args:
        kind: registered name.
        options: of the estimator.

    Raises:
        InputError: there is no such estimator, or a file is absent.
    """
    from pipeline.blur.spectral import TYPICAL

    chosen = dict(options or {})
    files = _files(blur.REGISTRY, kind, chosen)
    if chosen.get("processed") is False:
        files.pop("processed_weights", None)
    if chosen.get("output") == "relative":
        network = files["weights"]
        files["typical"] = network.with_name(network.stem + TYPICAL)
    return _sha256(files.values(), f"blur estimator '{kind}'")


def noise_weights(kind: str, options: Mapping[str, Any] | None = None) -> Weights:
    """Files of the networks of a noise estimator.

    Args:
        kind: registered name.
        options: of the estimator.

    Raises:
        InputError: there is no such estimator, or a file is absent.
    """
    return _sha256(_files(noise.REGISTRY, kind, dict(options or {})).values(), f"noise estimator '{kind}'")


def weights_of_kinds(kinds: Mapping[str, tuple[str, Mapping[str, Any]]]) -> dict[str, Weights]:
    """Weights of noise estimators by their name in a table; those without any are left out.

    Args:
        kinds: name in the table -> registered name and options.

    Raises:
        InputError: there is no such estimator, or a file is absent.
    """
    by_name = {name: noise_weights(kind, options) for name, (kind, options) in kinds.items()}
    return {name: files for name, files in by_name.items() if files}


def sha256_of(paths: Iterable[Path]) -> Weights:
    """File name -> SHA-256."""
    return {path.name: file_sha256(path) for path in paths}


def monitor_weights(monitor: ConditionMonitor) -> Weights:
    """Weights of the blur and the noise estimator of a monitor, calibrated or not.

    Raises:
        InputError: a file is absent.
    """
    of_blur = blur_weights(monitor.blur_name, monitor.blur_options)
    return dict(sorted({**of_blur, **noise_weights(monitor.noise_name, monitor.noise_options)}.items()))


def configured_weights(
    blur_estimators: Mapping[str, EstimatorSettings], noise_estimators: Mapping[str, EstimatorSettings]
) -> dict[str, dict[str, Weights]]:
    """Weights of the estimators of an experiment.

    Args:
        blur_estimators: name in the configuration -> kind and options.
        noise_estimators: likewise.

    Returns:
        ``blur`` and ``noise`` -> name -> weights; estimators without any are left out.

    Raises:
        InputError: a file is absent.
    """
    by_quantity = {
        "blur": {name: blur_weights(one.kind, one.options) for name, one in blur_estimators.items()},
        "noise": {name: noise_weights(one.kind, one.options) for name, one in noise_estimators.items()},
    }
    known = {
        quantity: {name: files for name, files in by_name.items() if files}
        for quantity, by_name in by_quantity.items()
    }  # fmt: skip
    return {quantity: by_name for quantity, by_name in known.items() if by_name}


def _files(registry: Registry, kind: str, options: Mapping[str, Any]) -> dict[str, Path]:
    """Option -> weight file: the one given, else that which is active in place of the released one.

    A module states its released files in ``RELEASED``, for the option ``weights``, and in ``RELEASED_BESIDE``, by
    option. Of other estimators those count that the options name.
    """
    module = sys.modules[registry.get(kind).__module__]
    released = {"weights": module.RELEASED} if hasattr(module, "RELEASED") else {}
    released |= getattr(module, "RELEASED_BESIDE", {})
    files = {option: Path(options.get(option) or active(file)) for option, file in released.items()}
    given = {option: Path(file) for option, file in options.items() if option.endswith("weights") and file}
    return files | given


def _sha256(paths: Iterable[Path], of: str) -> Weights:
    files = sorted(set(paths))
    for path in files:
        if not path.is_file():
            raise InputError(f"weights of {of}: no file {path}; restore data/weights")
    return sha256_of(files)
