"""Stage `blur`: one estimator's MTF on one dataset under every kernel of the bank and on sharp frames (Table I)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from pipeline.config.entry import Run, stage

if TYPE_CHECKING:
    from pipeline.camera.psf.kernel import Kernel
    from pipeline.datasets.corrupted import CameraSettings
    from pipeline.datasets.frame import Frame
    from pipeline.datasets.patches import Patch

READS = [
    "seed",
    "camera",
    "datasets.{dataset}",
    "blur.patches_per_frame",
    "blur.bootstrap_draws",
    "blur.estimators.{estimator}",
]


@stage("blur", reads=READS, job=["dataset", "estimator"])
def run(run: Run) -> None:
    """Estimate patches under every kernel; write estimates, AMAE raw and calibrated, kernels found, and the metrics."""
    import pandas as pd

    from pipeline import blur, store
    from pipeline.blur import evaluation
    from pipeline.blur.gallery import gallery
    from pipeline.camera.psf import stored
    from pipeline.datasets.corrupted import CameraSettings
    from pipeline.datasets.index import indexed_frames, indexed_patches
    from pipeline.errors import InputError

    dataset, name, params = run.job["dataset"], run.job["estimator"], run.params
    section = params.blur.estimators[name]
    folder = run.inputs / "data/index" / dataset
    frames = indexed_frames(folder, dataset, params.datasets[dataset])
    patches = indexed_patches(folder, "blur", params.blur.patches_per_frame)
    work = [(frame, patches[frame.name]) for frame in frames if frame.name in patches]
    if not work:
        raise InputError(f"{folder}: no frame has a patch for blur; see its labels, or set blur.patch_px smaller")
    kernels = stored.read(run.inputs / "data/psf")
    camera, options = CameraSettings.from_section(params.camera), dict(section.options)
    evaluate = partial(
        estimate_frame,
        kernels=[evaluation.sharp_kernel(), *kernels],
        kind=section.kind,
        options=options,
        camera=camera,
        seed=params.seed,
    )
    rows = [row for found in run.map(evaluate, work, f"blur of {dataset} by {name}") for row in found]
    estimates = evaluation.ESTIMATES.conform(pd.DataFrame(rows).assign(estimator=name))
    raw = evaluation.summarise(estimates, params.seed, params.blur.bootstrap_draws)
    own = evaluation.calibrated(estimates)
    divided = evaluation.summarise(own, params.seed, params.blur.bootstrap_draws, is_calibrated=True)
    summary = pd.concat([raw, divided], ignore_index=True)
    shown = gallery(*work[0], kernels, blur.create(section.kind, **options), camera, params.seed, run.map)
    with store.replacing_folder(run.outputs / f"data/blur/{dataset}-{name}") as out:
        store.write_table(out / "estimates.parquet", estimates, evaluation.ESTIMATES)
        store.write_table(out / "summary.parquet", summary, evaluation.SUMMARY)
        if shown is not None:  # an estimator that answers without kernels has none to show
            store.write_arrays(out / "gallery.npz", **shown[0])
            store.write_json(out / "gallery.json", {**shown[1], "estimator": name})
    store.write_json(run.outputs / f"reports/metrics/blur/{dataset}-{name}.json", evaluation.metrics(summary))


def estimate_frame(
    work: tuple[Frame, Sequence[Patch]],
    *,
    kernels: Sequence[Kernel],
    kind: str,
    options: dict[str, Any],
    camera: CameraSettings,
    seed: int,
) -> list[dict[str, Any]]:
    """What one worker does: all kernels on the patches of one frame."""
    from pipeline import blur
    from pipeline.blur.evaluation import evaluate_frame

    frame, patches = work
    return evaluate_frame(frame, patches, kernels, blur.create(kind, **options), camera, seed)


if __name__ == "__main__":
    run()
