"""Table I: the MTF of patches under every kernel of the bank, and its AMAE, for any estimator on any frames.

Wischow et al. 2023, Sec. V: frames are blurred by kernels of several kinds, sizes and rotations; patches on objects are
estimated; the robust median over all patches is compared with the kernel's MTF. Estimates relative to the camera are
divided by those for its sharp frames, so the sharp frame is measured as one more kernel, whose MTF is 1.

>>> from pipeline import datasets
>>> from pipeline.experiments import frames, table_one
>>> photographs = frames.of_dataset(datasets.open_dataset("photos", "photos"))
>>> table_one.measure({"mine": MyEstimator()}, photographs).summary
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from pipeline import blur
from pipeline.blur.camera_calibration import CameraMap
from pipeline.camera.mtf import CAMERA, SYSTEM
from pipeline.camera.psf.kernel import Kernel
from pipeline.camera.settings import CameraSettings
from pipeline.errors import InputError
from pipeline.experiments.arguments import check_estimators, check_measured
from pipeline.experiments.calibrate import Calibrated, cross_fit, divided_by_sharp, in_folds
from pipeline.experiments.condition import grid, sharp_kernel
from pipeline.experiments.frames import TestFrame
from pipeline.experiments.run import Executor, Method, Registered, in_process, run
from pipeline.experiments.summarise import MTF_CELL, mtf_cells
from pipeline.experiments.tables import BLUR_ESTIMATES, BLUR_SUMMARY, rounded, written

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.experiments.settings import BlurEstimatorSettings


@dataclass(frozen=True)
class Candidate:
    """An estimator that enters Table I.

    Attributes:
        estimator: see `pipeline.experiments.run.Method`.
        calibration_samples: synthetically blurred sharp patches that it is calibrated to the camera on; None leaves it
            as it is.
    """

    estimator: Any
    calibration_samples: int | None = None

    @classmethod
    def configured(cls, section: BlurEstimatorSettings) -> Candidate:
        """From a section of ``blur.estimators``."""
        return cls(Registered(blur.create, section.kind, section.options), section.calibration_samples)


@dataclass(frozen=True)
class TableOne:
    """Table I of some estimators.

    Attributes:
        estimates: `pipeline.experiments.tables.BLUR_ESTIMATES`, sharp frames among them.
        summary: `pipeline.experiments.tables.BLUR_SUMMARY`, raw and calibrated by division; of an estimator calibrated
            to the camera calibrated only, of one whose MTF is relative to a generic lens raw only.
        calibrations: estimator -> its calibration of each half of the frames, where it has one.
    """

    estimates: pd.DataFrame
    summary: pd.DataFrame
    calibrations: Mapping[str, Sequence[CameraMap]]


def measure(
    estimators: Mapping[str, Any],
    frames: Sequence[TestFrame],
    kernels: Sequence[Kernel] | None = None,
    *,
    calibration_frames: Sequence[TestFrame] | None = None,
    camera: CameraSettings | None = None,
    seed: int = 1,
    draws: int = 200,
    executor: Executor = in_process,
    label: Callable[[str], str] = "blur by {}".format,
) -> TableOne:
    """Estimates patches of every frame under every kernel and on sharp frames, and summarises them.

    Args:
        estimators: name -> an estimator with ``estimate(patches)``, or a `Candidate`.
        frames: frames with their patches, as quantity ``"mtf"``.
        kernels: the bank, without the sharp one; that of the paper's Table I if None.
        calibration_frames: these frames and possibly more, with all their patches, to calibrate on; ``frames`` if None.
            A frame is judged with the calibration to the half of them that it is not in.
        camera: that forms the image; the paper's if None.
        seed: root of the random streams.
        draws: bootstrap resamples of the intervals.
        executor: changes no result.
        label: name -> that of the progress bar.

    Raises:
        InputError: no estimator, no frame with a patch, no kernel, or an estimator that answers something else than a
            `pipeline.blur.base.BlurEstimate` of all patches; an unknown estimator or option, too few frames to
            calibrate on, a frame that is not among them, or no estimate for sharp frames to divide by.
    """
    import pandas as pd

    check_estimators(estimators)
    if not frames:
        raise InputError("frames: expected at least one frame to estimate on")
    if kernels is None:
        from pipeline.camera.psf.bank import bank

        kernels = bank(seed=seed)
    for kernel in kernels:
        if not isinstance(kernel, Kernel):
            expected = "pipeline.camera.psf.kernel.Kernel, as pipeline.camera.psf.bank.bank(...) makes them"
            raise InputError(f"kernels: expected {expected}, not {type(kernel).__name__}")
    conditions = grid([sharp_kernel(), *kernels])
    estimates, parts, calibrations = [], [], dict[str, Sequence[CameraMap]]()
    for name, given in estimators.items():
        candidate = given if isinstance(given, Candidate) else Candidate(given)
        method, chosen = Method(name, "mtf", candidate.estimator), list(frames)
        if candidate.calibration_samples is not None:
            calibrating = calibration_frames or frames
            chosen = in_folds(frames, calibrating)
            calibrations[name] = cross_fit(
                calibrating,
                candidate.estimator,
                samples=candidate.calibration_samples,
                seed=seed,
                executor=executor,
            )
            method = replace(method, of_folds=tuple(Calibrated(candidate.estimator, c) for c in calibrations[name]))
        exact = run(chosen, conditions, [method], camera=camera, seed=seed, executor=executor, label=label(name))
        check_measured(exact, "mtf")
        measurements = rounded(exact)
        estimates.append(written(measurements, "mtf", BLUR_ESTIMATES))
        parts.append(raw_and_divided(measurements, seed, draws))
    return TableOne(pd.concat(estimates, ignore_index=True), pd.concat(parts, ignore_index=True), calibrations)


def raw_and_divided(measurements: pd.DataFrame, seed: int, draws: int) -> pd.DataFrame:
    """Cells of Table I of one estimator: as it estimates, and calibrated by division.

    Args:
        measurements: of the MTF (`pipeline.experiments.tables.MEASUREMENTS`), those of sharp frames among them.
        seed: root of the bootstrap's streams.
        draws: bootstrap resamples; 0 for none.

    Returns:
        `pipeline.experiments.tables.BLUR_SUMMARY`; see `TableOne.summary` for which of both an estimator has.

    Raises:
        InputError: no estimate for sharp frames to divide by.
    """
    import pandas as pd

    variants = {bool((measurements["relative_to"] == CAMERA).all()): measurements}
    if (measurements["relative_to"] == SYSTEM).all():  # a relative MTF is not divided again
        variants[True] = divided_by_sharp(measurements)
    parts = [summarise(table, seed, draws, calibrated=calibrated) for calibrated, table in variants.items()]
    return pd.concat(parts, ignore_index=True)


def summarise(measurements: pd.DataFrame, seed: int, draws: int, *, calibrated: bool = False) -> pd.DataFrame:
    """AMAE of every dataset, estimator, kind and size: one row for each cell of Table I.

    Args:
        measurements: of the MTF (`pipeline.experiments.tables.MEASUREMENTS`).
        seed: root of the bootstrap's streams.
        draws: bootstrap resamples; 0 for none.
        calibrated: written into that column.

    Returns:
        `pipeline.experiments.tables.BLUR_SUMMARY`.
    """
    cells = mtf_cells(measurements, MTF_CELL, "blur", seed, draws, calibrated=calibrated)
    return BLUR_SUMMARY.conform(cells[list(BLUR_SUMMARY.columns)])
