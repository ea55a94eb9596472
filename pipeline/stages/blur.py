"""Stage `blur`: one estimator's MTF on one dataset under every kernel of the bank and on sharp frames (Table I)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from pipeline.config.entry import Run, stage

if TYPE_CHECKING:
    from pipeline.blur.camera_fit import Fit
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
    from pipeline.blur import cross_fit, evaluation
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
    is_fitted = section.camera_samples is not None
    halves, fits = [0] * len(work), []
    if is_fitted:
        every = indexed_patches(folder, "blur")
        whole, size = [(frame, every[frame.name]) for frame, _ in work], section.camera_samples
        halves = cross_fit.halves(len(work))
        fits = cross_fit.fits(whole, section.kind, options, samples=size, seed=params.seed, run_map=run.map)
    evaluate = partial(
        estimate_frame,
        kernels=[evaluation.sharp_kernel(), *kernels],
        kind=section.kind,
        options=options,
        camera=camera,
        seed=params.seed,
        fits=fits,
    )
    done = run.map(evaluate, list(zip(work, halves, strict=True)), f"blur of {dataset} by {name}")
    rows = [row for found in done for row in found]
    estimates = evaluation.ESTIMATES.conform(pd.DataFrame(rows).assign(estimator=name))
    # A fitted estimator answers relative to the camera's sharp frames: calibrated as it is.
    ways = {True: estimates} if is_fitted else {False: estimates, True: evaluation.calibrated(estimates)}
    draws = params.blur.bootstrap_draws
    parts = [evaluation.summarise(own, params.seed, draws, is_calibrated=way) for way, own in ways.items()]
    summary = pd.concat(parts, ignore_index=True)
    shown = gallery(*work[0], kernels, blur.create(section.kind, **options), camera, params.seed, run.map)
    with store.replacing_folder(run.outputs / f"data/blur/{dataset}-{name}") as out:
        store.write_table(out / "estimates.parquet", estimates, evaluation.ESTIMATES)
        store.write_table(out / "summary.parquet", summary, evaluation.SUMMARY)
        for half, found in enumerate(fits):
            found.save(out / f"camera-{half}.json")
        if shown is not None:  # an estimator that answers without kernels has none to show
            store.write_arrays(out / "gallery.npz", **shown[0])
            store.write_json(out / "gallery.json", {**shown[1], "estimator": name})
    store.write_json(run.outputs / f"reports/metrics/blur/{dataset}-{name}.json", evaluation.metrics(summary))


def estimate_frame(
    work: tuple[tuple[Frame, Sequence[Patch]], int],
    *,
    kernels: Sequence[Kernel],
    kind: str,
    options: dict[str, Any],
    camera: CameraSettings,
    seed: int,
    fits: Sequence[Fit],
) -> list[dict[str, Any]]:
    """What one worker does: all kernels on the patches of one frame, of which half of them."""
    from pipeline import blur
    from pipeline.blur.camera_fit import Fitted
    from pipeline.blur.evaluation import evaluate_frame

    (frame, patches), half = work
    estimator = blur.create(kind, **options)
    if fits:
        estimator = Fitted(estimator, fits[half])
    return evaluate_frame(frame, patches, kernels, estimator, camera, seed)


if __name__ == "__main__":
    run()
