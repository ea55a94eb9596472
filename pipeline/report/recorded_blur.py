"""Blur estimators measured on recorded pictures that the project may not keep: Table I and where it comes from.

As `pipeline.report.recorded` for detection: measured by hand, with ``camera-monitor blur record``, and kept as small
files from which the report draws. Pictures, kernels and weights are named by their SHA-256; no picture is kept.

    summary.csv      AMAE of every kind and size of blur, raw and calibrated (`BLUR_SUMMARY`)
    sharp.csv        what is read from sharp frames (`pipeline.experiments.sharp_curves.sharp_curves`)
    patches.csv      where the patches lie
    metrics.json     estimator -> `pipeline.experiments.metrics.table_one_metrics`
    provenance.json  source, dataset, frames, kernels, weights, settings
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline import blur, store
from pipeline.blur.spectral import TYPICAL
from pipeline.camera import kernel_bank
from pipeline.camera.mtf import SYSTEM
from pipeline.camera.paper_kernels import PaperKernel
from pipeline.camera.psf import stored
from pipeline.datasets.index import index
from pipeline.datasets.open import open_section
from pipeline.datasets.selection import evenly_spread
from pipeline.detection.weights import file_sha256
from pipeline.errors import InputError, did_you_mean
from pipeline.experiments import table_one
from pipeline.experiments.frames import TestFrame, with_patches
from pipeline.experiments.metrics import table_one_metrics
from pipeline.experiments.sharp_curves import sharp_curves
from pipeline.report import blur_records
from pipeline.report.blur_records import METRICS_FILE, PATCHES_FILE, PROVENANCE_FILE, SHARP_FILE, SUMMARY_FILE
from pipeline.report.record_files import write_csv

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.camera.psf.kernel import Kernel
    from pipeline.config.schema import Config
    from pipeline.experiments.settings import EstimatorSettings

Map = Callable[..., list[Any]]


def record(
    config: Config,
    dataset: str,
    estimators: Sequence[str],
    out: Path,
    source: str,
    run_map: Map,
    *,
    join: bool = False,
    frame_count: int | None = None,
    patches_per_frame: int | None = None,
) -> dict[str, Any]:
    """Measure blur estimators on one dataset and write everything into a folder.

    Args:
        config: with the dataset and the estimators in it.
        dataset: its name there.
        estimators: their names there.
        out: folder; replaced.
        source: where pictures and kernels come from, their revision and licence, in words.
        run_map: see `pipeline.executor.run_map`; changes no result.
        join: keep what the folder has of other estimators.
        frame_count: of the frames with patches, how many these estimators are run on, evenly spread; None for all.
        patches_per_frame: how many of the patches of such a frame; None for all.

    Returns:
        estimator -> metrics of those measured: see `pipeline.experiments.metrics.table_one_metrics`.

    Raises:
        InputError: the dataset, its labels, the kernels or weights are absent, there is no such estimator, or the
            folder to join was measured on other pictures, kernels or settings.
    """
    import pandas as pd

    section = config.blur
    for name in estimators:
        if name not in section.estimators:
            known = did_you_mean(name, section.estimators)
            raise InputError(f"blur.estimators.{name}: not in the configuration; {known}")
    bank = kernel_bank.configured(config.psf, config.camera.kind, config.seed)
    weights = {name: _weights(section.estimators[name]) for name in estimators}
    frames, all_patches = _frames(config, dataset, run_map)
    metadata = _provenance(config, dataset, source, frames, bank, weights)
    chosen = [
        replace(item, patches={"mtf": evenly_spread(item.patches["mtf"], patches_per_frame)})
        for item in evenly_spread(frames, frame_count)
    ]
    metadata[blur_records.SUBSETS] = {
        name: {"frames": len(chosen), "patches": sum(len(item.patches["mtf"]) for item in chosen)}
        for name in estimators
    }
    earlier = blur_records.others(out, metadata) if join else None

    def labelled(function: Callable[[Any], Any], items: Sequence[Any], label: str = "") -> list[Any]:
        return list(run_map(function, items, label=label))

    measured = [
        table_one.measure(
            {name: table_one.Candidate.configured(section.estimators[name])},
            chosen,
            stored.as_stored(bank),
            calibration_frames=all_patches,
            camera=config.camera,
            seed=config.seed,
            draws=section.bootstrap_draws,
            executor=labelled,
            label=f"blur of {dataset} by {{}}".format,
        )
        for name in estimators
    ]
    metrics = {name: table_one_metrics(one.summary) for name, one in zip(estimators, measured, strict=True)}
    # A relative MTF of sharp frames is no curve of theirs: with no other estimator there are no rows.
    parts = [one.estimates[one.estimates["relative_to"] == SYSTEM] for one in measured]
    summary = pd.concat([one.summary for one in measured], ignore_index=True)
    sharp = sharp_curves(pd.concat(parts, ignore_index=True), config.seed)
    kept: dict[str, Any] = {}
    if earlier is not None:
        summary = pd.concat([earlier.summary, summary], ignore_index=True)
        sharp = pd.concat([earlier.sharp, sharp], ignore_index=True)
        kept = earlier.metrics
        metadata["weights"] |= earlier.said["weights"]
        metadata[blur_records.SUBSETS] |= earlier.said.get(blur_records.SUBSETS, {})
        metadata["blur"]["estimators"] |= earlier.said["blur"]["estimators"]
    with store.replacing_folder(out) as folder:
        write_csv(folder / SUMMARY_FILE, summary)
        write_csv(folder / SHARP_FILE, sharp)
        write_csv(folder / PATCHES_FILE, _patches(frames))
        store.write_json(folder / METRICS_FILE, kept | metrics)
        store.write_json(folder / PROVENANCE_FILE, metadata)
    return metrics


def _provenance(
    config: Config,
    dataset: str,
    source: str,
    frames: Sequence[TestFrame],
    bank: Sequence[Kernel],
    weights: Mapping[str, Mapping[str, str]],
) -> dict[str, Any]:
    """Where numbers come from: every picture, kernel and weight file, and the settings; no place on this machine."""
    section = config.blur
    return {
        "source": source,
        "dataset": dataset,
        "kind": config.datasets[dataset].kind,
        "frames": {item.frame.name: file_sha256(item.frame.path) for item in frames},
        # Earlier moments, at which an estimator from several frames looks.
        "previous": {path.name: file_sha256(path) for item in frames for path in item.frame.previous},
        "kernels": {kernel.name: _kernel_sha256(kernel) for kernel in bank},
        "weights": {name: files for name, files in weights.items() if files},
        "blur": {
            **section.model_dump(exclude={"estimators"}),
            "estimators": {name: _placeless(section.estimators[name].model_dump()) for name in weights},
        },
        "psf": config.psf.model_dump(exclude={"folder"}),
        "camera": config.camera.described(),
        "seed": config.seed,
    }


def _frames(config: Config, dataset: str, run_map: Map) -> tuple[list[TestFrame], list[TestFrame]]:
    """Usable frames with the patches to evaluate on, and with all of them, as the stages take them."""
    section = config.datasets[dataset]
    result = index(
        open_section(dataset, section),
        tile_px=config.noise.tile_px,
        patch_px=config.blur.patch_px,
        max_rejected_fraction=section.max_rejected_fraction,
        run_map=run_map,
    )
    some, every = (result.patches_for("blur", count) for count in (config.blur.patches_per_frame, None))
    where = f"dataset '{dataset}'"
    return with_patches(result.usable, {"mtf": some}, where), with_patches(result.usable, {"mtf": every}, where)


def _patches(frames: Sequence[TestFrame]) -> pd.DataFrame:
    import pandas as pd

    rows = [
        {"frame": item.frame.name, "patch": number, **asdict(patch)}
        for item in frames
        for number, patch in enumerate(item.patches["mtf"])
    ]
    return pd.DataFrame(rows)


def _kernel_sha256(kernel: Kernel) -> str:
    """Of the picture it was read from, or of its numbers as float32."""
    if isinstance(kernel, PaperKernel):
        return file_sha256(kernel.path)
    return hashlib.sha256(kernel.psf.astype("<f4").tobytes()).hexdigest()


def _weights(section: EstimatorSettings) -> dict[str, str]:
    """File name -> SHA-256 of what an estimator has learned: weights of its options or released, and what is beside."""
    made = blur.REGISTRY.get(section.kind)
    given = section.options.get("weights") or getattr(sys.modules[made.__module__], "RELEASED", None)
    if given is None:
        return {}
    path = Path(given)
    paths = [path, path.with_name(path.stem + TYPICAL)] if section.options.get("output") == "relative" else [path]
    beside = getattr(sys.modules[made.__module__], "RELEASED_BESIDE", {})  # of an estimator that has further networks
    paths += [Path(section.options.get(option) or released) for option, released in beside.items()]
    for one in paths:
        if not one.is_file():
            raise InputError(f"weights of blur estimator '{section.kind}': no file {one}; restore data/weights")
    return {one.name: file_sha256(one) for one in paths}


def _placeless(content: Any) -> Any:
    """The same settings with places on this machine cut down to the names of files."""
    if isinstance(content, Mapping):
        return {name: _placeless(value) for name, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [_placeless(value) for value in content]
    return Path(content).name if isinstance(content, str) and Path(content).is_absolute() else content
