"""Stage `psf_bank`: the blur kernels of Table I with their true MTF."""

from __future__ import annotations

from pipeline.config.entry import Run, stage


@stage("psf_bank", reads=["seed", "camera", "psf"])
def run(run: Run) -> None:
    """Draw or load the kernels, sample their MTF, write both and a summary."""
    from pipeline import store
    from pipeline.camera.psf import stored
    from pipeline.camera.psf.configured_bank import configured
    from pipeline.linked_folders import refuse_linked_folders

    psf = run.params.psf
    refuse_linked_folders(psf.folder, "psf.folder")
    kernels = configured(psf, run.params.camera.kind, run.params.seed)
    with store.replacing_folder(run.outputs / "data/psf") as folder:
        rows = stored.write(folder, kernels, psf.source)
    means = rows.groupby(["blur_kind", "kernel_size_px"], as_index=False)[["mtf"]].mean().to_dict("records")
    store.write_json(
        run.outputs / "reports/metrics/psf.json",
        {"kernels": len(kernels), "mean_mtf": {f"{m['blur_kind']}-{m['kernel_size_px']}": m["mtf"] for m in means}},
    )


if __name__ == "__main__":
    run()
