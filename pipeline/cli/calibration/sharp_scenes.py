"""The calibration of a camera from pictures of ordinary scenes that are known to be sharp."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import click
import numpy as np

from pipeline import blur
from pipeline.answers import asked
from pipeline.blur import camera_calibration
from pipeline.blur.base import Estimator
from pipeline.blur.camera_calibration import Calibration, CameraFittable
from pipeline.cli.calibration.camera_store import StoredCamera, files_sha256
from pipeline.cli.calibration.charts import LEAST_MTF
from pipeline.cli.calibration.contrast import MOST_EMPTY_FRACTION, MOST_EMPTY_FRACTION_FIT, refuse_without_contrast
from pipeline.cli.package_version import version
from pipeline.condition.estimate import readable_patches
from pipeline.condition.summary import unsharp
from pipeline.errors import InputError, printable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


class _Measured(NamedTuple):
    """Pictures of which patches can be measured: their names, all their patches, and the MTFs (N, 2, 8) of each."""

    names: list[str]
    patches: NDArray[np.float32]
    mtfs: list[NDArray[Any]]


def from_scenes(
    camera: str, frames: Sequence[tuple[str, NDArray[np.float32]]], blur_name: str, calibrate_estimator: bool
) -> StoredCamera:
    """The MTF that the estimator reports of sharp frames, or its calibration; warns of frames that give no estimate.

    Args:
        camera: its name.
        frames: name and picture (H, W) in [0, 1] of each, all of one size.
        blur_name: of the estimator.
        calibrate_estimator: whether the estimator is calibrated, by blurring the frames; else the camera's MTF is kept.

    Raises:
        InputError: the calibration of the estimator cannot be stored, no patch can be measured, or the frames have too
            little contrast.
    """
    estimator = blur.create(blur_name)
    if not calibrate_estimator and (not isinstance(estimator, Estimator) or isinstance(estimator, CameraFittable)):
        raise InputError(f"--blur {blur_name}: its calibration cannot be stored; choose spectral, pmp or gbb")
    hashes = files_sha256(blur_name)
    measured = _measured(frames, estimator, blur_name)
    doubtful = _check_sharpness(
        measured.names, measured.mtfs, MOST_EMPTY_FRACTION_FIT if calibrate_estimator else MOST_EMPTY_FRACTION
    )
    fit = sharp_mtf = None
    if calibrate_estimator:
        fitted = camera_calibration.calibrate(estimator, measured.patches)
        if not isinstance(fitted, Calibration):
            raise InputError(
                f"--calibrate-estimator: the calibration of {blur_name} cannot be stored; leave the option out"
            )
        fit = fitted.content()
    else:
        assert isinstance(estimator, Estimator)
        divisor = estimator.divided(measured.patches).sharp_mtf
        assert divisor is not None
        sharp_mtf = np.maximum(divisor, LEAST_MTF).tolist()
    height_px, width_px = frames[0][1].shape
    return StoredCamera(
        name=camera, kind="fit" if fit else "sharp frames", blur_estimator=blur_name, weights_sha256=hashes,
        size_px=(height_px, width_px), frames=len(measured.names), sharp_mtf=sharp_mtf, fit=fit, version=version(),
        unsharp=doubtful,
    )  # fmt: skip


def _measured(
    frames: Sequence[tuple[str, NDArray[np.float32]]], estimator: blur.BlurEstimator, blur_name: str
) -> _Measured:
    """Patches of the frames and their MTFs; warns of frames without a patch that can be measured, and leaves them out.

    Raises:
        InputError: no frame is left.
    """
    names, patches, mtfs = [], [], []
    for (name, _), part in zip(frames, readable_patches([image for _, image in frames]), strict=True):
        mtf = asked(f"blur estimator '{blur_name}'", estimator.estimate, part, "mtf").mtf
        answered = mtf[np.isfinite(mtf).all(axis=(1, 2))]
        if not len(answered):
            click.echo(
                f"warning: {printable(name)}: no patch can be measured (only shading and noise, saturated or covered); "
                "left out",
                err=True,
            )
            continue
        names.append(name)
        patches.append(part)
        mtfs.append(answered)
    if not names:
        raise InputError("sharp pictures: no patch can be measured; give sharp pictures with structure")
    return _Measured(names, np.concatenate(patches), mtfs)


def _check_sharpness(names: list[str], mtfs: list[NDArray[Any]], most_empty_fraction: float) -> int:
    """Warn of pictures whose contrast falls to half too early; refuse them where too little contrast is left.

    Args:
        names: of the pictures.
        mtfs: (N, 2, 8) of the patches of each that the estimator answered, at least one.
        most_empty_fraction: see `refuse_without_contrast`.

    Returns:
        how many pictures it warned of.

    Raises:
        InputError: see `refuse_without_contrast`.
    """
    advice = "give pictures known to be sharp" + (
        ", or leave --calibrate-estimator out" if most_empty_fraction < MOST_EMPTY_FRACTION else ""
    )
    refuse_without_contrast(np.median(np.concatenate(mtfs), axis=0), "the sharp pictures", advice, most_empty_fraction)
    doubts = [unsharp(np.median(mtf, axis=0)) for mtf in mtfs]
    for name, doubt in zip(names, doubts, strict=True):
        if doubt:
            click.echo(f"warning: {name} {doubt}; leave it out, or take it anew", err=True)
    return sum(map(bool, doubts))
