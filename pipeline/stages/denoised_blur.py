"""Stage `denoised_blur`: noisy patches smoothed before their blur is estimated (the supplement's table)."""

from __future__ import annotations

from pipeline.config.entry import Run, stage

READS = ["seed", "camera", "datasets.{dataset}", "blur.estimators", "denoised_blur"]
USES = {"pipeline.blur": ["denoised_blur.blur_estimators"], "pipeline.noise": []}


@stage("denoised_blur", reads=READS, job=["dataset"], uses=USES)
def run(run: Run) -> None:
    """Evaluate blur d1 x noise x disc d2 beside the same without a disc; write errors, those expected, and metrics."""
    import pandas as pd

    from pipeline import store
    from pipeline.camera.psf import stored
    from pipeline.condition import combined_tables
    from pipeline.condition.combined_blur_cells import blur_cells, with_expected
    from pipeline.condition.combined_metrics import metrics
    from pipeline.condition.combined_plan import denoised_plan
    from pipeline.datasets.corrupted import CameraSettings
    from pipeline.datasets.index import indexed_frames, indexed_patches
    from pipeline.errors import InputError

    dataset, params = run.job["dataset"], run.params
    section, camera = params.denoised_blur, CameraSettings.from_section(params.camera)
    folder = run.inputs / "data/index" / dataset
    bank = stored.read(run.inputs / "data/psf")
    plan = denoised_plan(section, params.blur.estimators, bank, camera, params.seed)
    frames = indexed_frames(folder, dataset, params.datasets[dataset])
    work = plan.work(frames, indexed_patches(folder, "blur", section.patches_per_frame), {}, section.frames)
    if not work:
        raise InputError(f"{folder}: no frame has a patch for blur; see its labels, or set blur.patch_px smaller")
    found = run.map(plan.evaluate, work, f"denoised blur of {dataset}")
    read = combined_tables.BLUR_READ.conform(pd.DataFrame([row for rows, _ in found for row in rows]))
    cells = with_expected(blur_cells(read, params.seed, section.bootstrap_draws))
    with store.replacing_folder(run.outputs / "data/denoised_blur" / dataset) as out:
        store.write_table(out / "blur_read.parquet", read, combined_tables.BLUR_READ)
        store.write_table(out / "blur.parquet", cells, combined_tables.BLUR_CELLS)
    store.write_json(run.outputs / f"reports/metrics/denoised_blur/{dataset}.json", metrics(cells))


if __name__ == "__main__":
    run()
