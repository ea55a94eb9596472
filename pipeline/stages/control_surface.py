"""Stage `control_surface`: average precision over noise and motion of the controlled camera, by fold of viewpoints."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.config.entry import Run, stage
from pipeline.stages import CONTROL_USES

if TYPE_CHECKING:
    from pipeline.control.simulation.measured_surface import Exposures, SurfaceDesign
    from pipeline.control.simulation.views import View

READS = ["seed", "control", "detection.evaluation", "detection.detectors"]
ARRAYS = frozenset({"condition", "boxes", "score", "label", "true_sigma", "sigma", "mtf"})


@stage("control_surface", reads=READS, uses=CONTROL_USES)
def run(run: Run) -> None:
    """Detect and estimate in every view under every condition; write surfaces of each fold, of the others, of all."""
    import json
    from functools import partial

    import pandas as pd

    from pipeline import store
    from pipeline.config.detector_identity import detector_identity
    from pipeline.config.hydra_plugins.plug_in_sources import digest
    from pipeline.control import setup
    from pipeline.control.cache import fingerprint
    from pipeline.control.simulation import measured_surface, tables
    from pipeline.control.simulation.views import folds, views
    from pipeline.detection.checkpoint import clear
    from pipeline.detection.classes import CLASS_MAPS
    from pipeline.detection.words import warn_of_words

    params, section = run.params, run.params.control
    detector = params.detection.detectors[section.detector]
    options = detector.arguments()
    every = folds(views(run.inputs / "data/sim"), section.viewpoints, section.folds)
    every_view = [view for fold in every for view in fold if view.moment in section.surface.moments]
    designs, camera = setup.designs(section.surface), setup.camera(section.camera)
    conditions = [(design, measured_surface.exposures(every_view, camera, design)) for design in designs]
    work = [(view, number) for number in range(len(designs)) for view in every_view]
    shared: dict[str, Any] = {"camera": camera, "seed": params.seed}
    sha256 = detector_identity(section.detector, detector)["sha256"]
    sources = [sha256, digest("pipeline.detection", detector.kind)]
    by = {"detector": [detector.kind, options, *sources], "outputs": str(run.outputs)}
    key = fingerprint("pipeline.control.simulation.measured_surface", {**shared, **by, "conditions": conditions})
    folder = run.inputs / ".cache/control_surface" / key
    measure = partial(
        measure_view, folder=folder, kind=detector.kind, options=options, shared=shared, conditions=conditions
    )
    measured = dict(zip(work, run.map(measure, work, "surface for control"), strict=True))
    criteria = params.detection.evaluation
    words = {str(label) for part in measured.values() for label in part["label"]}
    classes = CLASS_MAPS["sim"].classes
    warn_of_words(detector.kind, json.dumps(options, sort_keys=True), classes, words, "sim")
    rows = []
    with store.replacing_folder(run.outputs / "data/control_surface") as out:
        for name, chosen in measured_surface.fold_sets(len(every)).items():
            seen = [view for view in every_view if any(view in every[number] for number in chosen)]
            by_design = [[(view, measured[view, number]) for view in seen] for number in range(len(designs))]
            fold = chosen[0] if len(chosen) == 1 else -1
            surface, table = measured_surface.of_all_brightnesses(by_design, designs, criteria, fold, params.seed)
            surface.save(out / f"{name}.npz")
            if name == "all" or name.startswith("fold"):
                rows.append(table.assign(fold=-1 if name == "all" else fold))
        store.write_table(out / "knots.parquet", pd.concat(rows), tables.KNOTS)
    clear(folder)


def measure_view(
    item: tuple[View, int],
    *,
    folder: Path,
    kind: str,
    options: dict[str, Any],
    shared: dict[str, Any],
    conditions: Sequence[tuple[SurfaceDesign, Exposures]],
) -> Any:
    """What one worker does: one view under every condition of one design, kept as soon as it is done."""
    import json

    from pipeline.control.simulation import measured_surface
    from pipeline.detection.checkpoint import load_or_compute

    view, number = item
    design, settings = conditions[number]

    def make() -> Any:
        return measured_surface.measure(
            view,
            kind=kind,
            options=json.dumps(options, sort_keys=True),
            estimate=True,
            design=design,
            shared=settings,
            **shared,
        )

    return load_or_compute(folder, f"{view.name}-{number}", view.path.read_bytes(), ARRAYS, make)


if __name__ == "__main__":
    run()
