"""Stage `closed_loop`: every policy through one scenario; goes on where it was killed."""

from __future__ import annotations

from pipeline.config.entry import Run, stage
from pipeline.stages import CONTROL_USES

READS = ["seed", "control", "detection.evaluation", "detection.detectors"]


@stage("closed_loop", reads=READS, job=["scenario"], uses=CONTROL_USES)
def run(run: Run) -> None:
    """Drive; write steps, the policies' scores, paired differences, film strips and metrics."""
    from functools import partial

    import pandas as pd

    from pipeline import store
    from pipeline.config.detector_identity import detector_identity
    from pipeline.config.hydra_plugins.plug_in_sources import digest
    from pipeline.control import setup
    from pipeline.control.cache import fingerprint
    from pipeline.control.simulation import evaluation, tables
    from pipeline.control.simulation.loop import Rig
    from pipeline.control.simulation.views import folds, views

    params, section, name = run.params, run.params.control, run.job["scenario"]
    scenario = setup.scenario(name, evaluation.named_scenario(section.scenarios, name))
    detector = params.detection.detectors[section.detector]
    options = detector.arguments()
    sha256 = detector_identity(section.detector, detector)["sha256"]
    every = folds(views(run.inputs / "data/sim", moments=section.moments), section.viewpoints, section.folds)
    camera = setup.camera(section.camera)
    pixels = [[view.name, view.path.read_bytes()] for fold in every for view in fold]
    key = fingerprint(
        "pipeline.control.simulation.loop",
        {
            "camera": camera,
            "seed": params.seed,
            "frames": pixels,
            "detector": [detector.kind, options, sha256, digest("pipeline.detection", detector.kind)],
        },
    )
    rig = Rig(
        camera=camera,
        controlled=setup.controlled(section.camera),
        detector=detector.kind,
        detector_options=setup.as_json(options),
        seed=params.seed,
        cache=run.inputs / ".cache/closed_loop" / key,
    )
    chosen = setup.policies(section, name)
    surfaces = run.inputs / "data/control_surface"
    work = setup.drives(chosen, every, surfaces)
    pictures = setup.film_steps(scenario.steps, section.film_steps)
    driven = run.map(partial(setup.drive, rig=rig, scenario=scenario, pictures=pictures), work, f"scenario {name}")
    criteria, reference = params.detection.evaluation, setup.reference(surfaces / "all.npz")
    parts: dict[str, list[pd.DataFrame]] = {policy: [] for policy in chosen}
    records: dict[str, list] = {policy: [] for policy in chosen}
    for item, result in zip(work, driven, strict=True):
        records[item.policy] += result
        parts[item.policy].append(
            evaluation.steps_table(scenario, item.policy, item.fold, result, criteria, reference, params.seed)
        )
    steps = {policy: pd.concat(rows, ignore_index=True) for policy, rows in parts.items()}
    summary, pairs = evaluation.summary(scenario, steps, records, criteria, params.seed)
    with store.replacing_folder(run.outputs / "data/closed_loop" / name) as out:
        store.write_table(out / "steps.parquet", pd.concat(steps.values()), tables.STEPS)
        store.write_table(out / "summary.parquet", summary, tables.SUMMARY)
        store.write_table(out / "pairs.parquet", pairs, tables.PAIRS)
        for item, result in zip(work, driven, strict=True):
            if item.fold == 0 and item.policy in section.film_policies:
                store.write_arrays(out / f"film-{item.policy}.npz", **setup.film(result))
    store.write_json(run.outputs / f"reports/metrics/closed_loop/{name}.json", evaluation.metrics(summary))


if __name__ == "__main__":
    run()
