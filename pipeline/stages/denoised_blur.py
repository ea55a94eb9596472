"""Stage `denoised_blur`: noisy patches filtered before their blur is estimated (the supplement's table)."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

READS = ["seed", "camera", "datasets.{dataset}", "blur.estimators", "denoised_blur"]
USES = {"pipeline.blur": ["denoised_blur.blur_estimators"], "pipeline.noise": []}


@stage("denoised_blur", reads=READS, job=["dataset"], uses=USES)
def run(run: Run) -> None:
    """Evaluate blur d1 x noise x disc d2 beside the same without a disc; write errors, those expected, and metrics."""
    from pipeline import store
    from pipeline.camera.psf import stored
    from pipeline.experiments import combined, tables
    from pipeline.experiments.condition import Quantity
    from pipeline.experiments.frames import of_index
    from pipeline.experiments.metrics import combined_metrics

    dataset, params = run.job["dataset"], run.params
    section, camera, seed = params.denoised_blur, params.camera, params.seed
    experiment = combined.denoised(section, params.blur.estimators, stored.read(run.inputs / "data/psf"))
    folder = run.inputs / "data/index" / dataset
    per_frame: dict[Quantity, int | None] = {"mtf": section.patches_per_frame}
    frames = combined.frames_of(section, of_index(folder, dataset, params.datasets[dataset], per_frame))
    measurements = experiment.run(frames, camera, seed, run.map, f"denoised blur of {dataset}")
    cells = combined.with_expected(combined.blur_cells(measurements, seed, section.bootstrap_draws))
    with store.replacing_folder(run.outputs / "data/denoised_blur" / dataset) as out:
        read = tables.written(measurements, "mtf", tables.BLUR_READ)
        store.write_table(out / "blur_read.parquet", read, tables.BLUR_READ)
        store.write_table(out / "blur.parquet", cells, tables.BLUR_CELLS)
    store.write_json(run.outputs / f"reports/metrics/denoised_blur/{dataset}.json", combined_metrics(cells))


if __name__ == "__main__":
    run()
