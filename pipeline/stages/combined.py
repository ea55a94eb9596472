"""Stage `combined`: blur and noise at once on one dataset, read by blur and noise estimators."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

READS = ["seed", "camera", "datasets.{dataset}", "blur.estimators", "noise.estimators", "combined"]
USES = {
    "pipeline.blur": ["combined.blur_estimators"],
    "pipeline.noise": ["combined.noise_estimators", "combined.denoise.sigma_by"],
}


@stage("combined", reads=READS, job=["dataset"], uses=USES)
def run(run: Run) -> None:
    """Evaluate every experiment; write what was read, its statistics, the example's curves and pictures, metrics."""
    import pandas as pd

    from pipeline import store
    from pipeline.camera.psf import stored
    from pipeline.condition import combined_tables
    from pipeline.condition.combined_blur_cells import blur_cells
    from pipeline.condition.combined_curves import example_curves
    from pipeline.condition.combined_example import example, liveliest
    from pipeline.condition.combined_metrics import metrics
    from pipeline.condition.combined_noise_cells import noise_cells
    from pipeline.condition.combined_plan import combined_plan
    from pipeline.datasets.corrupted import CameraSettings
    from pipeline.datasets.index import indexed_frames, indexed_patches
    from pipeline.errors import InputError

    dataset, params = run.job["dataset"], run.params
    section, camera = params.combined, CameraSettings.from_section(params.camera)
    folder = run.inputs / "data/index" / dataset
    bank = stored.read(run.inputs / "data/psf")
    plan = combined_plan(section, params.blur.estimators, params.noise.estimators, bank, camera, params.seed)
    frames = indexed_frames(folder, dataset, params.datasets[dataset])
    patches = indexed_patches(folder, "blur", section.patches_per_frame)
    work = plan.work(frames, patches, indexed_patches(folder, "noise", section.tiles_per_frame), section.frames)
    if not work:
        raise InputError(f"{folder}: no frame has a patch for blur; see its labels, or set blur.patch_px smaller")
    found = run.map(plan.evaluate, work, f"blur and noise of {dataset}")
    read = combined_tables.BLUR_READ.conform(pd.DataFrame([row for rows, _ in found for row in rows]))
    heard = pd.DataFrame([row for _, rows in found for row in rows], columns=list(combined_tables.NOISE_READ.columns))
    heard = combined_tables.NOISE_READ.conform(heard)
    blur = blur_cells(read, params.seed, section.bootstrap_draws)
    noise = noise_cells(heard, params.seed, section.bootstrap_draws)
    arrays, said = example(
        *liveliest((frame, places) for frame, places, *_ in work),
        plan.experiments,
        plan.kernels,
        section.example_px,
        section.levels_dn,
        camera,
        params.seed,
    )
    with store.replacing_folder(run.outputs / "data/combined" / dataset) as out:
        store.write_table(out / "blur_read.parquet", read, combined_tables.BLUR_READ)
        store.write_table(out / "noise_read.parquet", heard, combined_tables.NOISE_READ)
        store.write_table(out / "blur.parquet", blur, combined_tables.BLUR_CELLS)
        store.write_table(out / "noise.parquet", noise, combined_tables.NOISE_CELLS)
        curves = example_curves(read, section.example_px)
        store.write_table(out / "curves.parquet", curves, combined_tables.CURVES)
        store.write_arrays(out / "example.npz", **arrays)
        store.write_json(out / "example.json", said)
    store.write_json(run.outputs / f"reports/metrics/combined/{dataset}.json", metrics(blur, noise))


if __name__ == "__main__":
    run()
