"""Stage `order_study`: photon noise before or behind the optics, in encoded or linear light."""

from __future__ import annotations

from pipeline.config.entry import Run, stage
from pipeline.stages import CONTROL_USES

READS = ["seed", "camera", "control", "datasets.sim", "detection.evaluation", "detection.detectors"]


@stage("order_study", reads=READS, uses=CONTROL_USES)
def run(run: Run) -> None:
    """Corrupt, estimate and detect under both orders and in both lights; write the table."""
    import json
    from functools import partial

    from pipeline import store
    from pipeline.datasets.index import indexed_frames
    from pipeline.datasets.sim import NOTHING_IGNORED
    from pipeline.experiments import order_study
    from pipeline.experiments.class_maps import class_map

    params, section = run.params, run.params.control
    detector, source = params.detection.detectors[section.detector], params.datasets["sim"]
    every_object = source.model_copy(update={"options": source.options | NOTHING_IGNORED})
    frames = indexed_frames(run.inputs / "data/index/sim", "sim", every_object)
    chosen = order_study.conditions(section.order_study.sizes_px, section.order_study.target_sigmas_dn)
    options = json.dumps(detector.arguments(), sort_keys=True)
    measure = partial(
        order_study.measure,
        chosen=chosen,
        camera=params.camera,
        kind=detector.kind,
        options=options,
        seed=params.seed,
    )
    result = run.map(measure, frames, "order study")
    words = class_map(source.kind)
    scores = order_study.precisions(frames, result, chosen, words, params.detection.evaluation, params.seed)
    study = order_study.Study(result, chosen, scores, params.seed)
    with store.replacing_folder(run.outputs / "data/order_study") as out:
        store.write_table(out / "study.parquet", study.table(), order_study.STUDY)
        store.write_table(out / "effects.parquet", study.effects(), order_study.EFFECTS)


if __name__ == "__main__":
    run()
