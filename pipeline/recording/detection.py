"""Detection measured on recorded pictures that the project may not keep: numbers, figures and where they come from.

The default run uses nothing that has to be downloaded. Measurements on other people's pictures are made by hand, with
``camera-monitor curves record``, and kept as small files: tables, figures, and a provenance that names every picture
and the weights by their SHA-256, so that anyone who has them can repeat the numbers. No picture is kept.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline import store
from pipeline.curves import directions, precision
from pipeline.datasets.selection import scenes_of
from pipeline.detection.words import warn_of_words
from pipeline.errors import InputError
from pipeline.executor import run_map
from pipeline.experiments import detect, iopc
from pipeline.experiments.class_maps import class_map, refuse_mistaken_words
from pipeline.experiments.condition import sweep_kernels
from pipeline.experiments.summarise import condition_medians
from pipeline.experiments.sweep_frames import sweep_frames
from pipeline.recording.kept_results import Map, keyed
from pipeline.recording.provenance import blur_weights, inputs_of, noise_weights, write_csv
from pipeline.report import style
from pipeline.report.detection_results import DIRECTION, SPREAD
from pipeline.report.sections import detection_figures
from pipeline.store import file_sha256

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.config.schema import Config
    from pipeline.datasets.frame import Frame

RESULTS = (
    "provenance.json", "metrics.json", "precision.csv", "conditions.csv", f"{DIRECTION}.csv", f"{SPREAD}.csv",
    "iopc.csv", "iopc.png", "iopc.svg", "iopc_heat.csv", "iopc_heat.png", "iopc_heat.svg", "refused.json",
    "surface-*.npz",
)  # fmt: skip
"""Files of a record, its provenance first; a pattern for the surfaces of the classes."""


def record(config: Config, dataset: str, detector: str, out: Path, source: str, run_map: Map) -> dict[str, Any]:
    """Measure one detector on one dataset and write everything into a folder.

    Args:
        config: with the dataset and the detector in it.
        dataset: its name there.
        detector: its name there.
        out: folder; replaced.
        source: where the pictures come from, their revision and licence, in words.
        run_map: see `pipeline.executor.run_map`; changes no result.

    Returns:
        the metrics: see `pipeline.curves.precision.metrics`.

    Raises:
        InputError: the dataset or the weights are absent, or there is no object to find.
    """
    settings, section, kind = config.detection, config.detection.detectors[detector], config.datasets[dataset].kind
    identifying = detect.identifying_file(detector, section)
    weights = {
        "blur": {settings.measure.mtf: blur_weights(settings.measure.mtf)},
        "noise": {settings.measure.sigma: noise_weights(settings.measure.sigma)},
    }
    detector_sha256 = file_sha256(identifying)
    run_map = keyed(run_map, __name__, {**weights, "detector": detector_sha256})
    frames = labelled_frames(config, dataset, run_map)
    table, draws, conditions = _measure(config, dataset, detector, frames, run_map)
    labels = [label for label in draws if (table.loc[table["label"] == label, "objects"] > 0).any()]
    if not labels:
        raise InputError(f"dataset '{dataset}': no object of a class that detectors know; see its labels")
    table, draws = table[table["label"].isin(labels)], {label: draws[label] for label in labels}
    through = precision.label_curves(table, draws, settings.curves, config.seed)
    numbers = precision.metrics(table, through.surfaces)
    turned = _directions(table, draws, settings.curves.tolerance_percent)
    with store.replacing_folder(out) as folder:
        for name, part in turned.items():
            write_csv(folder / f"{name}.csv", part)
        write_csv(folder / "precision.csv", table)
        write_csv(folder / "conditions.csv", conditions)
        drawings = {"iopc": detection_figures.iopc(through.isolated.assign(detector=detector))}
        if through.surfaces:
            drawings["iopc_heat"] = detection_figures.heat(through.heat.assign(detector=detector))
        for name, drawing in drawings.items():
            style.save(drawing.figure, folder / name, drawing.values)
        through.save_surfaces(folder)
        store.write_json(folder / "refused.json", through.refused)
        store.write_json(folder / "metrics.json", numbers)
        store.write_json(
            folder / "provenance.json",
            {
                "source": source,
                "dataset": dataset,
                "kind": kind,
                **inputs_of(frames),
                "detector": {"kind": section.kind, "file": identifying.name, "options": section.options}
                | {"sha256": detector_sha256},
                "sweep": settings.sweep.model_dump(),
                "evaluation": settings.evaluation.model_dump(),
                "measure": settings.measure.model_dump(),
                "weights": weights,
                "curves": settings.curves.model_dump(),
                "camera": config.camera.described(),
                "seed": config.seed,
            },
        )
    return numbers


def _directions(table: pd.DataFrame, draws: dict[str, Any], tolerance: float) -> dict[str, pd.DataFrame]:
    """The blur-direction table and the spread over directions, as the stage `direction`; empty with one direction."""
    if table.loc[table["kernel_size_px"] > 0, "angle_deg"].nunique() < 2:
        return {}
    return dict(zip((DIRECTION, SPREAD), directions.of_labels(table, draws, tolerance), strict=True))


def labelled_frames(config: Config, dataset: str, run_map: Map = run_map) -> list[Frame]:
    """The frames of a dataset whose pictures can be decoded and whose labels can be read; the others are named.

    Every picture is decoded before anything is measured: a damaged one late in the list would end hours of work.

    Args:
        config: with the dataset in it.
        dataset: its name there.
        run_map: see `pipeline.executor.run_map`; by default in this process.

    Returns:
        at most ``detection.sweep.frames``, evenly spread.

    Raises:
        InputError: more of them are broken than the dataset's ``max_rejected_fraction`` allows.
    """
    sweep = config.detection.sweep
    return sweep_frames(dataset, config.datasets[dataset], sweep.options.get(dataset, {}), sweep.frames, None, run_map)


def _measure(
    config: Config, dataset: str, detector: str, frames: list[Frame], run_map: Map
) -> tuple[pd.DataFrame, dict[str, Any], pd.DataFrame]:
    """Average precisions, their draws, and the estimated conditions."""
    settings, section = config.detection, config.detection.detectors[detector]
    words = class_map(config.datasets[dataset].kind)
    refuse_mistaken_words(frames, dataset, config.datasets[dataset].kind)
    camera, levels = config.camera, tuple(settings.sweep.target_sigmas_dn)
    shape = settings.sweep
    blurs = sweep_kernels(shape.blur, shape.sizes_px, shape.angles_deg, shape.match, config.seed)
    work = [(frame, kernel) for frame in frames for kernel in blurs]
    criteria = settings.evaluation
    estimates = iopc.measure(
        iopc.on_objects(frames, words, settings.measure, criteria),
        blurs,
        shape.noise_source,
        levels,
        settings.measure,
        camera=camera,
        seed=config.seed,
        executor=lambda function, items, label: run_map(function, items, label=label),
        label=f"condition of {dataset}",
    )
    scenes = scenes_of(frames)
    conditions = condition_medians(estimates, config.seed, criteria.bootstrap_draws, scenes.__getitem__)
    classes, options = tuple(words.classes), detect.options_of(section)
    one = detect.Sweep(section.kind, options, classes, shape.noise_source, levels, camera, config.seed)
    result = run_map(partial(_look, one), work, label=f"{detector} on {dataset}")
    warn_of_words(section.kind, options, classes, detect.words_of(result), dataset)
    detections, looked = detect.tables(work, result, one, scenes)
    table, draws = precision.average_precision(
        detections, looked, detect.objects(frames, words), conditions, classes, criteria, config.seed
    )
    return table, draws, conditions


def _look(one: detect.Sweep, work: tuple[Any, Any]) -> dict[str, Any]:
    return one.detect(*work)
