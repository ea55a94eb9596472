"""Stage `worked_examples`: the paper's Examples 1 and 2 of control, simulated."""

from __future__ import annotations

from pipeline.config.entry import Run, stage
from pipeline.stages import CONTROL_USES

READS = ["seed", "control", "detection.evaluation", "detection.detectors"]


@stage("worked_examples", reads=READS, uses=CONTROL_USES)
def run(run: Run) -> None:
    """See the views at every setting of the examples; write steps, response, average precision and pictures."""
    from functools import partial

    from pipeline import store
    from pipeline.control import setup
    from pipeline.control.simulation import example_pictures, tables, worked_examples
    from pipeline.control.simulation.views import folds, views

    params, section = run.params, run.params.control
    detector = params.detection.detectors[section.detector]
    options = setup.as_json(detector.arguments())
    (every,) = folds(views(run.inputs / "data/sim"), section.viewpoints, 1)
    work = [view for view in every if view.moment == 3]
    camera = setup.camera(section.camera)
    chosen = worked_examples.shots(camera, worked_examples.noisy_full_well(camera, work[0].radiance()))
    window = example_pictures.window(work, worked_examples.LABEL)
    measure = partial(
        worked_examples.measure,
        camera=camera,
        chosen=chosen,
        kind=detector.kind,
        options=options,
        seed=params.seed,
        window=window,
    )
    seen = list(zip(work, run.map(measure, work, "worked examples"), strict=True))
    steps, response, precision = worked_examples.tables(seen, chosen, params.detection.evaluation, params.seed)
    arrays, description = worked_examples.pictures(seen, chosen, window)
    with store.replacing_folder(run.outputs / "data/worked_examples") as out:
        store.write_arrays(out / "pictures.npz", **arrays)
        store.write_json(out / "pictures.json", description)
        store.write_table(out / "steps.parquet", steps, tables.EXAMPLE_STEPS)
        store.write_table(out / "response.parquet", response, tables.RESPONSE)
        store.write_table(out / "precision.parquet", precision, tables.CONTROLLER_AP)


if __name__ == "__main__":
    run()
