"""Stage `noise`: one estimator's answers on one dataset, over noise sources and levels."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from pipeline.config.entry import Run, stage

if TYPE_CHECKING:
    from pipeline.datasets.corrupted import CameraSettings
    from pipeline.datasets.frame import Frame
    from pipeline.datasets.patches import Patch

READS = [
    "seed",
    "camera",
    "corruption.effects",
    "corruption.levels_dn",
    "datasets.{dataset}",
    "noise.tile_px",
    "noise.tiles_per_frame",
    "noise.bootstrap_draws",
    "noise.map_level_dn",
    "noise.estimators.{estimator}",
]
USES = {"pipeline.noise": ["noise.estimators.{estimator}"]}


@stage("noise", reads=READS, job=["dataset", "estimator"], uses=USES)
def run(run: Run) -> None:
    """Estimate on every indexed frame; write estimates, their summary, a frame's local noise, and the metrics."""
    import pandas as pd

    from pipeline import store, tables
    from pipeline.datasets.corrupted import CameraSettings
    from pipeline.datasets.index import indexed_frames, indexed_patches
    from pipeline.noise.evaluation import metrics, summarise

    dataset, name, params = run.job["dataset"], run.job["estimator"], run.params
    section = params.noise.estimators[name]
    folder = run.inputs / "data/index" / dataset
    frames = indexed_frames(folder, dataset, params.datasets[dataset])
    tiles = indexed_patches(folder, "noise", section.per_frame or params.noise.tiles_per_frame)
    settings: dict[str, Any] = {
        "kind": section.kind,
        "options": dict(section.options),
        "effects": params.corruption.effects,
        "camera": CameraSettings.from_section(params.camera),
        "seed": params.seed,
    }
    evaluate = partial(estimate_frame, **settings, levels_dn=params.corruption.levels_dn)
    work = [(frame, tiles[frame.name]) for frame in frames if frame.name in tiles]
    rows = [row for found in run.map(evaluate, work, f"noise of {dataset} by {name}") for row in found]
    estimates = tables.NOISE_ESTIMATES.conform(pd.DataFrame(rows).assign(estimator=name))
    summary = tables.NOISE_SUMMARY.conform(summarise(estimates, params.seed, params.noise.bootstrap_draws))
    show = partial(map_frame, **settings, level_dn=params.noise.map_level_dn)
    maps = next(iter(run.map(show, [frame for frame, _ in work[:1]], "")), None)
    with store.replacing_folder(run.outputs / f"data/noise/{dataset}-{name}") as out:
        store.write_table(out / "estimates.parquet", estimates, tables.NOISE_ESTIMATES)
        store.write_table(out / "summary.parquet", summary, tables.NOISE_SUMMARY)
        if maps is not None:  # an estimator that answers by the patch has none to show
            store.write_arrays(out / "maps.npz", **maps[0])
            store.write_json(out / "maps.json", {**maps[1], "estimator": name})
    store.write_json(run.outputs / f"reports/metrics/noise/{dataset}-{name}.json", metrics(summary))


def estimate_frame(
    work: tuple[Frame, Sequence[Patch]],
    *,
    kind: str,
    options: dict[str, Any],
    effects: Sequence[str],
    levels_dn: Sequence[float],
    camera: CameraSettings,
    seed: int,
) -> list[dict[str, Any]]:
    """What one worker does: all effects and levels of one frame."""
    from pipeline import noise
    from pipeline.noise.evaluation import evaluate_frame

    frame, tiles = work
    return evaluate_frame(frame, tiles, noise.create(kind, **options), effects, levels_dn, camera, seed)


def map_frame(
    frame: Frame,
    *,
    kind: str,
    options: dict[str, Any],
    effects: Sequence[str],
    camera: CameraSettings,
    seed: int,
    level_dn: float,
) -> tuple[dict[str, Any], dict[str, Any]] | None:
    """The local noise of one frame, where the estimator has a map."""
    from pipeline import noise
    from pipeline.noise.maps import shown_maps

    return shown_maps(frame, noise.create(kind, **options), effects, level_dn, camera, seed)


if __name__ == "__main__":
    run()
