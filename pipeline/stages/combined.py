"""Stage `combined`: blur and noise at once on one dataset, for blur and noise estimators."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

READS = ["seed", "camera", "datasets.{dataset}", "blur.estimators", "noise.estimators", "combined"]
USES = {
    "pipeline.blur": ["combined.blur_estimators"],
    "pipeline.noise": ["combined.noise_estimators", "combined.denoise.sigma_by"],
}


@stage("combined", reads=READS, job=["dataset"], uses=USES)
def run(run: Run) -> None:
    """Run every experiment; write estimates, their statistics, the example's curves and images, and the metrics."""
    from pipeline import store
    from pipeline.camera.psf import stored
    from pipeline.experiments import combined, tables
    from pipeline.experiments.condition import Quantity
    from pipeline.experiments.frames import of_index
    from pipeline.experiments.metrics import combined_metrics
    from pipeline.experiments.pictures.combined_example import example, example_curves, highest_contrast_patch

    dataset, params = run.job["dataset"], run.params
    section, camera, seed = params.combined, params.camera, params.seed
    bank = stored.read(run.inputs / "data/psf")
    experiment = combined.configured(section, params.blur.estimators, params.noise.estimators, bank)
    per_frame: dict[Quantity, int | None] = {"mtf": section.patches_per_frame, "sigma_dn": section.tiles_per_frame}
    folder = run.inputs / "data/index" / dataset
    frames = combined.frames_of(section, of_index(folder, dataset, params.datasets[dataset], per_frame))
    measurements = experiment.run(frames, camera, seed, run.map, f"blur and noise of {dataset}")
    blur = combined.blur_cells(measurements, seed, section.bootstrap_draws)
    noise = combined.sigma_cells(measurements, seed, section.bootstrap_draws)
    frame, patch = highest_contrast_patch(frames)
    size_px, target_sigmas_dn = section.example_px, section.target_sigmas_dn
    arrays, description = example(
        frame, patch, experiment.pairs, experiment.kernels, size_px, target_sigmas_dn, camera, seed
    )
    with store.replacing_folder(run.outputs / "data/combined" / dataset) as out:
        for name, quantity, schema in (
            ("blur_read", "mtf", tables.BLUR_READ),
            ("noise_read", "sigma_dn", tables.NOISE_READ),
        ):
            store.write_table(out / f"{name}.parquet", tables.written(measurements, quantity, schema), schema)
        store.write_table(out / "blur.parquet", blur, tables.BLUR_CELLS)
        store.write_table(out / "noise.parquet", noise, tables.NOISE_CELLS)
        store.write_table(out / "curves.parquet", example_curves(measurements, size_px), tables.CURVES)
        store.write_arrays(out / "example.npz", **arrays)
        store.write_json(out / "example.json", description)
    store.write_json(run.outputs / f"reports/metrics/combined/{dataset}.json", combined_metrics(blur, noise))


if __name__ == "__main__":
    run()
