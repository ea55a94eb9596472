"""Stage `measured`: noise and MTF as estimated on the objects of one dataset, under every condition of the sweep."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

READS = [
    "seed",
    "camera",
    "datasets.{dataset}",
    "detection.sweep",
    "detection.measure",
    "detection.evaluation.min_height_px",
    "detection.evaluation.min_visible_fraction",
    "detection.evaluation.bootstrap_draws",
]
USES = {
    "pipeline.blur": ["detection.measure.mtf"],
    "pipeline.noise": ["detection.measure.sigma"],
    "pipeline.detection": [],
}


@stage("measured", reads=READS, job=["dataset"], uses=USES)
def run(run: Run) -> None:
    """Estimate in every frame behind every kernel at every level; write the estimates and their medians."""
    from pipeline import store
    from pipeline.datasets.selection import scenes_of
    from pipeline.experiments import iopc, tables
    from pipeline.experiments.class_maps import class_map, refuse_mistaken_words
    from pipeline.experiments.condition import sweep_kernels
    from pipeline.experiments.summarise import condition_medians
    from pipeline.experiments.sweep_frames import sweep_frames

    name, params = run.job["dataset"], run.params
    source, settings, criteria = params.datasets[name], params.detection.sweep, params.detection.evaluation
    options = settings.options.get(name, {})
    frames = sweep_frames(name, source, options, settings.frames, run.inputs / "data/index" / name, run.map)
    refuse_mistaken_words(frames, name, source.kind)
    estimates = iopc.measure(
        iopc.on_objects(frames, class_map(source.kind), params.detection.measure, criteria),
        sweep_kernels(settings.blur, settings.sizes_px, settings.angles_deg, settings.match, params.seed),
        settings.noise_source,
        settings.target_sigmas_dn,
        params.detection.measure,
        camera=params.camera,
        seed=params.seed,
        executor=run.map,
        label=f"condition of {name}",
    )
    summary = condition_medians(estimates, params.seed, criteria.bootstrap_draws, scenes_of(frames).__getitem__)
    with store.replacing_folder(run.outputs / "data/measured" / name) as out:
        store.write_table(out / "estimates.parquet", estimates, tables.MEASURED)
        store.write_table(out / "conditions.parquet", summary, tables.CONDITIONS)


if __name__ == "__main__":
    run()
