"""Calibration of blur estimates to a camera, and the division that removes a pre-filter.

Two calibrations give the MTF relative to the camera's sharp frames. *Division* divides every estimate by the robust
median of the same camera's sharp patches (MTFs of serial stages multiply),

    MTF_relative = clip(MTF / max(MTF_sharp, 0.05), 0, 1).

An estimator *calibrated to the camera* is corrected by a map that was fitted on synthetically blurred sharp patches
(`pipeline.blur.camera_calibration`); it is cross-fitted: each half of the frames is evaluated with the calibration from
the other half, so that no frame is evaluated with a calibration to itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.blur.base import SHARP_FLOOR
from pipeline.blur.camera_calibration import CalibratedEstimator, CameraMap, calibrate
from pipeline.blur.denoise import EPSILON, divided, divided_end
from pipeline.camera import mtf
from pipeline.camera.mtf import CAMERA
from pipeline.camera.psf.defocus import create as disc
from pipeline.errors import InputError
from pipeline.experiments.condition import SHARP
from pipeline.experiments.frames import TestFrame
from pipeline.experiments.run import Executor, in_process, opened
from pipeline.experiments.summarise import robust_median

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Calibrated:
    """An estimator calibrated to a camera, opened where it is needed.

    Attributes:
        estimator: see `pipeline.experiments.run.Method`.
        calibration: of the estimator to the camera.
    """

    estimator: Any
    calibration: CameraMap

    def open(self) -> CalibratedEstimator:
        """The calibrated estimator."""
        return CalibratedEstimator(opened(self.estimator), self.calibration)


def divided_by_sharp(measurements: pd.DataFrame) -> pd.DataFrame:
    """Estimates of the MTF divided by the robust median of the same camera's sharp patches, clipped to [0, 1].

    Per dataset, estimator, direction and frequency, as `pipeline.blur.base.Estimator.divided` does; the rows of the
    sharp frames stay among them.

    Args:
        measurements: of the MTF (`pipeline.experiments.tables.MEASUREMENTS`), with the sharp frames without noise.

    Raises:
        InputError: a dataset and estimator have no estimate for sharp frames.
    """
    keys = ["dataset", "estimator", "axis", "frequency"]
    sharp = measurements[(measurements["kernel"] == SHARP) & (measurements["target_sigma_dn"] == 0)]
    known = {key: float(robust_median(group["estimate"].to_numpy(float))) for key, group in sharp.groupby(keys)}
    divisor = np.array([known.get(key, np.nan) for key in measurements[keys].itertuples(index=False, name=None)])
    if np.isnan(divisor).any():
        raise InputError(
            "blur estimates cannot be calibrated: a dataset has no estimate for its sharp frames; "
            f"measure with the kernel '{SHARP}' as well"
        )
    changed = measurements.assign(relative_to=CAMERA)
    for name in ("estimate", "low", "high"):
        values = measurements[name].to_numpy(float)
        changed[name] = np.clip(values / np.maximum(divisor, SHARP_FLOOR), 0.0, 1.0)
    return changed


def divide_out_filter(measurements: pd.DataFrame, epsilon: float = EPSILON) -> pd.DataFrame:
    """MTFs of the blur alone: rows of filtered patches divided by the MTF of their disc (`pipeline.blur.denoise`).

    Args:
        measurements: of the MTF, calibrated or not.
        epsilon: an MTF below it is noise.

    Returns:
        the same rows; frequencies that fail a condition are NaN, and a patch of which none is left abstains, "noise".
    """
    changed = measurements.copy()
    known = np.ones(len(measurements))
    for filter_px in measurements.loc[measurements["smoothed"], "filter_px"].unique():
        exact = mtf.sample(disc(float(filter_px)))
        for axis, point in np.ndindex(2, len(mtf.FREQUENCIES)):
            rows = (measurements["filter_px"] == filter_px) & (measurements["axis"] == "HV"[axis])
            rows &= np.isclose(measurements["frequency"], mtf.FREQUENCIES[point])
            known[rows.to_numpy()] = exact[axis, point]
    smoothed = measurements["smoothed"].to_numpy(bool)
    estimates = measurements["estimate"].to_numpy(float)
    quotient = np.where(smoothed, divided(estimates, known, epsilon), estimates)
    changed["estimate"] = quotient
    for name in ("low", "high"):
        end = measurements[name].to_numpy(float)
        end = np.where(smoothed, divided_end(end, known, epsilon), end)
        changed[name] = np.where(np.isnan(quotient), np.nan, end)
    patch = ["dataset", "estimator", "experiment", "kernel", "target_sigma_dn", "frame", "patch", "filter_px"]
    nothing = changed["estimate"].isna().groupby([changed[key] for key in patch]).transform("all").to_numpy(bool)
    lost = nothing & ~measurements["abstained"].to_numpy(bool)
    changed["abstained"] = measurements["abstained"].to_numpy(bool) | lost
    changed["reason"] = np.where(lost, "noise", measurements["reason"].astype(str))
    return changed


def raw_and_calibrated(measurements: pd.DataFrame) -> list[tuple[bool, pd.DataFrame]]:
    """MTFs of the blur alone, raw and divided by those of the sharp frames.

    Args:
        measurements: of the MTF, with the sharp frames.

    Returns:
        (False, raw) and (True, calibrated); an estimator without an estimate for sharp frames is not in the latter, and
        neither holds the sharp frames.
    """
    sharp = measurements[measurements["kernel"] == SHARP]
    keys = ["estimator", "axis", "frequency"]
    known = sharp["estimate"].notna().groupby([sharp[key] for key in keys]).any().groupby(level=0).all()
    able = measurements[measurements["estimator"].isin(known.index[known])]
    tables = [(False, divide_out_filter(measurements))]
    if len(able):
        tables.append((True, divide_out_filter(divided_by_sharp(able))))
    return [(calibrated, table[table["kernel"] != SHARP]) for calibrated, table in tables]


def folds(count: int) -> list[int]:
    """The half that each of a dataset's frames, in order, belongs to: 0 for the first, 1 for the others.

    Halves are not mixed: frames that follow each other may show the same scene.

    Args:
        count: of frames.

    Raises:
        InputError: fewer than two frames.
    """
    if count < 2:
        raise InputError(
            f"{count} frame to calibrate to a camera and to evaluate on; give at least two, or leave "
            f"calibration_samples out"
        )
    return [int(2 * number >= count) for number in range(count)]


def in_folds(frames: Sequence[TestFrame], calibrating: Sequence[TestFrame]) -> list[TestFrame]:
    """Frames with the half that each belongs to of those that are calibrated on.

    Args:
        frames: to be evaluated, with one calibration for each half.
        calibrating: frames of the same dataset that both calibrations are made from (`cross_fit`).

    Raises:
        InputError: fewer than two to calibrate on, or a frame that is not among them.
    """
    halves = {item.frame.name: half for item, half in zip(calibrating, folds(len(calibrating)), strict=True)}
    if strange := [item.frame.name for item in frames if item.frame.name not in halves]:
        raise InputError(
            f"frame {strange[0]} is not among those to calibrate on, so that the half whose calibration it is to be "
            "evaluated with is unknown; give calibration_frames that hold every frame"
        )
    return [replace(item, fold=halves[item.frame.name]) for item in frames]


def cross_fit(
    frames: Sequence[TestFrame], estimator: Any, *, samples: int, seed: int, executor: Executor = in_process
) -> tuple[CameraMap, CameraMap]:
    """The calibration that each half of the frames is evaluated with: that to the other half.

    Args:
        frames: sharp frames with their patches.
        estimator: see `pipeline.experiments.run.Method`.
        samples: see `pipeline.blur.camera_calibration.calibrate`.
        seed: see there.
        executor: changes no result.

    Raises:
        InputError: fewer than two frames, or see `pipeline.blur.camera_calibration.calibrate`.
    """
    halves = folds(len(frames))
    others = [[item for item, half in zip(frames, halves, strict=True) if half != fold] for fold in (0, 1)]
    make = partial(fit_frames, estimator=estimator, samples=samples, seed=seed)
    first, second = executor(make, others, "calibration to the camera")
    return first, second


def fit_frames(frames: Sequence[TestFrame], *, estimator: Any, samples: int, seed: int) -> CameraMap:
    """Calibrates an estimator to the patches of sharp frames; see `pipeline.blur.camera_calibration.calibrate`."""
    from pipeline.datasets.patches import cut

    sharp = np.concatenate([cut(np.asarray(item.frame.image()), item.patches["mtf"]) for item in frames])
    return calibrate(opened(estimator), sharp, samples=samples, seed=seed)
