"""Stage `render_sim`: the evaluation frames of the dataset Sim, four moments per viewpoint."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from pipeline.config.entry import Run, stage
from pipeline.errors import InputError


@stage("render_sim", reads=["seed", "scenes"])
def run(run: Run) -> None:
    """Render all frames, one viewpoint per piece of work, and write them with their boxes."""
    from pipeline import store

    scenes = run.params.scenes
    with store.replacing_folder(run.outputs / "data/sim") as folder:
        work = partial(
            render_viewpoint,
            folder=folder / "evaluation",
            seed=run.params.seed,
            samples=scenes.samples,
            width_px=scenes.width_px,
            height_px=scenes.height_px,
            radiance=scenes.radiance,
        )
        work_items = [(number, moment) for number in range(scenes.viewpoints) for moment in range(4)]
        pictures = run.map(work, work_items, "render Sim")
        for picture in pictures:
            if not picture.is_file():
                raise InputError(
                    f"executor.address={run.executor.address}: a worker has written {picture.name} elsewhere; start "
                    f"Dask workers in {Path.cwd()}, on a disk that all share"
                )


def render_viewpoint(
    item: tuple[int, int], *, folder: Path, seed: int, samples: int, width_px: int, height_px: int, radiance: bool
) -> Path:
    """What one worker does: one moment of one viewpoint; returns the path of its picture."""
    from pipeline.scenes.dataset import Viewpoint, render
    from pipeline.scenes.files import write

    number, moment = item
    frame = render(
        Viewpoint("evaluation", number), moment, seed, samples=samples, width_px=width_px, height_px=height_px
    )
    return write(frame, folder, radiance=radiance)


if __name__ == "__main__":
    run()
