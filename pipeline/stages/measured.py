"""Stage `measured`: noise and MTF as estimated on the objects of one dataset, under every condition of the sweep."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

READS = [
    "seed",
    "camera",
    "datasets.{dataset}",
    "detection.sweep",
    "detection.measure",
    "detection.judge.lowest_px",
    "detection.judge.least_visible",
    "detection.judge.bootstrap_draws",
]
USES = {
    "pipeline.blur": ["detection.measure.mtf"],
    "pipeline.noise": ["detection.measure.sigma"],
    "pipeline.detection": [],
}


@stage("measured", reads=READS, job=["dataset"], uses=USES)
def run(run: Run) -> None:
    """Estimate in every frame behind every kernel at every level; write the estimates and their medians."""
    from functools import partial

    import pandas as pd

    from pipeline import store
    from pipeline.curves import measured
    from pipeline.datasets.conditions import evaluation_frames, kernels
    from pipeline.datasets.corrupted import CameraSettings
    from pipeline.detection.sweep import class_map
    from pipeline.errors import InputError

    name, params = run.job["dataset"], run.params
    source, settings, judge = params.datasets[name], params.detection.sweep, params.detection.judge
    options = settings.options.get(name, {})
    frames = evaluation_frames(run.inputs / "data/index" / name, name, source, options, settings.frames)
    blurs = kernels(settings.blur, settings.sizes_px, settings.angles_deg, settings.match, params.seed)
    look = partial(
        measured.Measurement(
            **params.detection.measure.model_dump(), lowest_px=judge.lowest_px, least_visible=judge.least_visible
        ).look,
        words=class_map(source.kind),
        effect=settings.effect,
        levels_dn=tuple(settings.levels_dn),
        camera=CameraSettings.from_section(params.camera),
        seed=params.seed,
    )
    work = [(frame, kernel) for frame in frames for kernel in blurs]
    rows = [row for found in run.map(look, work, f"condition of {name}") for row in found]
    if not rows:
        raise InputError(f"dataset '{name}': no frame has an object to measure noise and blur on; see its labels")
    estimates = measured.MEASURED.conform(pd.DataFrame(rows))
    summary = measured.summarise(estimates, params.seed, judge.bootstrap_draws)
    with store.replacing_folder(run.outputs / "data/measured" / name) as out:
        store.write_table(out / "estimates.parquet", estimates, measured.MEASURED)
        store.write_table(out / "conditions.parquet", summary, measured.CONDITIONS)


if __name__ == "__main__":
    run()
