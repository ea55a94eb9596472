"""Stage `psf_bank`: the blur kernels of Table I with their true MTF."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.config.entry import Run, stage

if TYPE_CHECKING:
    from pipeline.camera.psf.kernel import Kernel


@stage("psf_bank", reads=["seed", "camera", "psf"])
def run(run: Run) -> None:
    """Draw or load the kernels, sample their MTF, write both and a summary."""
    from pipeline import store
    from pipeline.camera.paper_kernels import load
    from pipeline.camera.psf import stored
    from pipeline.camera.psf.bank import bank

    psf = run.params.psf
    kernels: Sequence[Kernel]
    if psf.source == "paper":
        kernels = [k for k in load(Path(psf.folder)) if k.kind in psf.kinds and k.size_px in psf.sizes_px]
    else:
        camera = "physical" if run.params.camera.kind == "physical" else "authors"
        kernels = bank(psf.kinds, psf.sizes_px, psf.angles_deg, run.params.seed, match=psf.match, camera=camera)
    with store.replacing_folder(run.outputs / "data/psf") as folder:
        rows = stored.write(folder, kernels, psf.source)
    means = rows.groupby(["kind", "size_px"], as_index=False)[["mtf"]].mean().to_dict("records")
    store.write_json(
        run.outputs / "reports/metrics/psf.json",
        {"kernels": len(kernels), "mean_mtf": {f"{m['kind']}-{m['size_px']}": m["mtf"] for m in means}},
    )


if __name__ == "__main__":
    run()
