"""Stage `blur`: one estimator's MTF on one dataset under every kernel of the bank and on sharp frames (Table I)."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

READS = [
    "seed",
    "camera",
    "datasets.{dataset}",
    "blur.patches_per_frame",
    "blur.bootstrap_draws",
    "blur.estimators.{estimator}",
]
USES = {"pipeline.blur": ["blur.estimators.{estimator}"]}


@stage("blur", reads=READS, job=["dataset", "estimator"], uses=USES)
def run(run: Run) -> None:
    """Estimate patches under every kernel; write estimates, AMAE raw and calibrated, kernels, and the metrics."""
    from pipeline import store
    from pipeline.blur.networks import wide_convolutions
    from pipeline.camera.psf import stored
    from pipeline.experiments import tables
    from pipeline.experiments.frames import of_index
    from pipeline.experiments.metrics import table_one_metrics
    from pipeline.experiments.pictures.kernel_gallery import gallery
    from pipeline.experiments.table_one import Candidate, measure

    dataset, name, params = run.job["dataset"], run.job["estimator"], run.params
    section = params.blur.estimators[name]
    if section.kind == "cnn":
        wide_convolutions.allow()
    candidate = Candidate.configured(section)
    folder, source = run.inputs / "data/index" / dataset, params.datasets[dataset]
    frames = of_index(folder, dataset, source, {"mtf": section.per_frame or params.blur.patches_per_frame})
    kernels, camera = stored.read(run.inputs / "data/psf"), params.camera
    result = measure(
        {name: candidate},
        frames,
        kernels,
        calibration_frames=of_index(folder, dataset, source, {"mtf": None}),
        camera=camera,
        seed=params.seed,
        draws=params.blur.bootstrap_draws,
        executor=run.map,
        label=f"blur of {dataset} by {{}}".format,
    )
    first = frames[0]
    shown = gallery(first.frame, first.patches["mtf"], kernels, candidate.estimator, camera, params.seed, run.map)
    with store.replacing_folder(run.outputs / f"data/blur/{dataset}-{name}") as out:
        store.write_table(out / "estimates.parquet", result.estimates, tables.BLUR_ESTIMATES)
        store.write_table(out / "summary.parquet", result.summary, tables.BLUR_SUMMARY)
        for fold, calibration in enumerate(result.calibrations.get(name, ())):
            calibration.save(out / f"camera-{fold}.json")
        if shown is not None:  # an estimator without kernels has none to show
            store.write_arrays(out / "gallery.npz", **shown[0])
            store.write_json(out / "gallery.json", {**shown[1], "estimator": name})
    store.write_json(run.outputs / f"reports/metrics/blur/{dataset}-{name}.json", table_one_metrics(result.summary))


if __name__ == "__main__":
    run()
