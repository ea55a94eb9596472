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
    """Estimate patches under every kernel; write estimates, AMAE raw and calibrated, kernels found, and the metrics."""
    from pipeline import blur, store
    from pipeline.blur import evaluation, table_one
    from pipeline.blur.gallery import gallery
    from pipeline.camera.psf import stored
    from pipeline.datasets.corrupted import CameraSettings
    from pipeline.datasets.index import indexed_frames, indexed_patches

    dataset, name, params = run.job["dataset"], run.job["estimator"], run.params
    section = params.blur.estimators[name]
    folder = run.inputs / "data/index" / dataset
    frames = indexed_frames(folder, dataset, params.datasets[dataset])
    judged = table_one.paired(frames, indexed_patches(folder, "blur", params.blur.patches_per_frame), str(folder))
    whole = table_one.paired(frames, indexed_patches(folder, "blur"), str(folder))
    kernels = stored.read(run.inputs / "data/psf")
    camera = CameraSettings.from_section(params.camera)
    found = table_one.measure(
        name,
        section,
        judged,
        whole,
        kernels,
        camera,
        seed=params.seed,
        draws=params.blur.bootstrap_draws,
        run_map=run.map,
        label=f"blur of {dataset} by {name}",
    )
    estimator = blur.create(section.kind, **section.options)
    shown = gallery(*judged[0], kernels, estimator, camera, params.seed, run.map)
    with store.replacing_folder(run.outputs / f"data/blur/{dataset}-{name}") as out:
        store.write_table(out / "estimates.parquet", found.estimates, evaluation.ESTIMATES)
        store.write_table(out / "summary.parquet", found.summary, evaluation.SUMMARY)
        for half, fit in enumerate(found.fits):
            fit.save(out / f"camera-{half}.json")
        if shown is not None:  # an estimator that answers without kernels has none to show
            store.write_arrays(out / "gallery.npz", **shown[0])
            store.write_json(out / "gallery.json", {**shown[1], "estimator": name})
    store.write_json(run.outputs / f"reports/metrics/blur/{dataset}-{name}.json", evaluation.metrics(found.summary))


if __name__ == "__main__":
    run()
