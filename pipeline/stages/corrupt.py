"""Stage `corrupt`: corruption levels with their truth on every frame, and the gallery of the image-formation chain."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from pipeline.config.entry import Run, stage

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pipeline.camera.settings import CameraSettings
    from pipeline.datasets.frame import Frame


@stage("corrupt", reads=["seed", "camera", "corruption", "datasets.{dataset}"], job=["dataset"])
def run(run: Run) -> None:
    """Corrupt every frame by every noise source and level; keep the truth, and pictures of one frame."""
    import pandas as pd

    from pipeline import store, tables
    from pipeline.datasets.index import indexed_frames
    from pipeline.experiments.pictures.formation_gallery import gallery

    name, params = run.job["dataset"], run.params
    camera = params.camera
    frames = indexed_frames(run.inputs / "data/index" / name, name, params.datasets[name])
    effects, levels = params.corruption.noise_sources, params.corruption.target_sigmas_dn
    work = partial(truth_of_frame, effects=effects, target_sigmas_dn=levels, camera=camera, seed=params.seed)
    rows = [row for result in run.map(work, frames, f"corruption of {name}") for row in result]
    truth = tables.CORRUPTION.conform(pd.DataFrame(rows))
    section = params.corruption.gallery
    arrays, description = gallery(
        frames[0], effects, levels, camera, params.seed, section.sigma_dn, section.kernel_size_px, section.crop_px
    )
    with store.replacing_folder(run.outputs / "data/corrupt" / name) as folder:
        store.write_table(folder / "corruption.parquet", truth, tables.CORRUPTION)
        store.write_arrays(folder / "gallery.npz", **arrays)
        store.write_json(folder / "gallery.json", description)
    columns = ["noise_scale", "unclipped_sigma_dn", "clipped_sigma_dn", "clipped_fraction"]
    cells = truth.groupby(["noise_source", "target_sigma_dn"], as_index=False)[columns].mean().to_dict("records")
    metrics = {
        f"{cell['noise_source']}-{cell['target_sigma_dn']:g}": {name: cell[name] for name in columns} for cell in cells
    }
    store.write_json(run.outputs / f"reports/metrics/corrupt/{name}.json", metrics)


def truth_of_frame(
    frame: Frame, *, effects: Sequence[str], target_sigmas_dn: Sequence[float], camera: CameraSettings, seed: int
) -> list[dict[str, Any]]:
    """What one worker does: the truth of all effects and levels of one frame."""
    from pipeline.experiments.condition import grid, sharp_kernel
    from pipeline.experiments.corrupt import SharpFrame

    sharp = SharpFrame(frame, camera, seed, paired=False)
    names = {"dataset": frame.dataset, "frame": frame.name}
    return [
        {**names, **sharp.formation(condition).row()} for condition in grid([sharp_kernel()], effects, target_sigmas_dn)
    ]


if __name__ == "__main__":
    run()
