"""Table I of one estimator on one dataset: its answers for patches under every kernel, and their AMAE.

What `pipeline.blur.evaluation` does for a frame, done for all frames of a dataset, by any map; an estimator with
``camera_samples`` is first fitted to the camera, and each half of the frames judged with a fit to the other half
(`pipeline.blur.cross_fit`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from pipeline.blur import cross_fit, evaluation
from pipeline.blur.camera_fit import CameraMap, Fitted
from pipeline.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.camera.psf.kernel import Kernel
    from pipeline.config.schema import EstimatorSection
    from pipeline.datasets.corrupted import CameraSettings
    from pipeline.datasets.frame import Frame
    from pipeline.datasets.patches import Patch

    Work = tuple[Frame, Sequence[Patch]]

Map = Callable[..., list[Any]]


@dataclass(frozen=True)
class TableOne:
    """What one estimator makes of one dataset.

    Attributes:
        estimates: `pipeline.blur.evaluation.ESTIMATES`, sharp frames among them.
        summary: `pipeline.blur.evaluation.SUMMARY`: raw and calibrated; of a fitted estimator calibrated only, of one
            that takes off a typical lens raw only.
        fits: to the camera, that of each half of the frames; empty for an estimator that is not fitted.
    """

    estimates: pd.DataFrame
    summary: pd.DataFrame
    fits: list[CameraMap]


def paired(frames: Sequence[Frame], patches: Mapping[str, Sequence[Patch]], where: str) -> list[Work]:
    """Frames with their patches; those without any are left out.

    Args:
        frames: of one dataset, in order.
        patches: frame name -> patches (`pipeline.datasets.index.indexed_patches`).
        where: what the error names.

    Raises:
        InputError: no frame has a patch.
    """
    work = [(frame, patches[frame.name]) for frame in frames if frame.name in patches]
    if not work:
        raise InputError(f"{where}: no frame has a patch for blur; see its labels, or set blur.patch_px smaller")
    return work


def measure(
    name: str,
    section: EstimatorSection,
    judged: Sequence[Work],
    whole: Sequence[Work],
    kernels: Sequence[Kernel],
    camera: CameraSettings,
    *,
    seed: int,
    draws: int,
    run_map: Map,
    label: str = "",
) -> TableOne:
    """Estimate patches of every frame under every kernel and on sharp frames, and summarise.

    Args:
        name: of the estimator in the tables.
        section: what it is: kind, options, and ``camera_samples`` where it is fitted to the camera.
        judged: frames of one dataset with the patches to judge by (`paired`).
        whole: the same frames with all their patches, to fit on.
        kernels: the bank, sharp frames left out.
        camera: the camera that forms the image.
        seed: root of the random streams.
        draws: bootstrap resamples of the intervals.
        run_map: ``run_map(function, items, label)`` (`pipeline.executor.run_map`); changes no result.
        label: what its progress bar says.

    Raises:
        InputError: unknown estimator or option, too few frames to fit on, or no answer for sharp frames to divide by.
    """
    import pandas as pd

    options = dict(section.options)
    halves, fits = [0] * len(judged), []
    if section.camera_samples is not None:
        halves, samples = cross_fit.halves(len(judged)), section.camera_samples
        fits = cross_fit.fits(whole, section.kind, options, samples=samples, seed=seed, run_map=run_map)
    evaluate = partial(
        estimate_frame,
        kernels=[evaluation.sharp_kernel(), *kernels],
        kind=section.kind,
        options=options,
        camera=camera,
        seed=seed,
        fits=fits,
    )
    done = run_map(evaluate, list(zip(judged, halves, strict=True)), label)
    rows = [row for found in done for row in found]
    estimates = evaluation.ESTIMATES.conform(pd.DataFrame(rows).assign(estimator=name))
    # What tells the added blur already is not divided by its answer for sharp frames; fitted, it is calibrated.
    ways = {bool(fits): estimates}
    if not section.answers_added:
        ways[True] = evaluation.calibrated(estimates)
    parts = [evaluation.summarise(own, seed, draws, is_calibrated=way) for way, own in ways.items()]
    return TableOne(estimates, pd.concat(parts, ignore_index=True), fits)


def estimate_frame(
    work: tuple[Work, int],
    *,
    kernels: Sequence[Kernel],
    kind: str,
    options: dict[str, Any],
    camera: CameraSettings,
    seed: int,
    fits: Sequence[CameraMap],
) -> list[dict[str, Any]]:
    """What one worker does: all kernels on the patches of one frame, of which half of them.

    Args:
        work: a frame with its patches, and its half, 0 or 1.
        kernels: the sharp one among them.
        kind: of the estimator (`pipeline.blur.create`).
        options: its options.
        camera: the camera that forms the image.
        seed: root of the random streams.
        fits: of the halves; empty for an estimator that is not fitted.

    Returns:
        rows of `pipeline.blur.evaluation.ESTIMATES`, but for the estimator's name.
    """
    from pipeline import blur

    (frame, patches), half = work
    estimator = blur.create(kind, **options)
    if fits:
        estimator = Fitted(estimator, fits[half])
    return evaluation.evaluate_frame(frame, patches, kernels, estimator, camera, seed)
