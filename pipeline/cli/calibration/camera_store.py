"""Calibrations of the user's cameras, one JSON file each, and their use by ``--camera NAME``.

Files lie in ``$CAMERA_MONITOR_HOME/cameras``, else in ``$XDG_CONFIG_HOME/camera-monitor/cameras``, else in
``~/.config/camera-monitor/cameras``.
"""

from __future__ import annotations

import copy
import json
import os
import re
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.errors import InputError, did_you_mean, printable

if TYPE_CHECKING:
    from pipeline.condition import ConditionMonitor

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
KINDS = ("sharp frames", "fit", "edge chart", "star chart")
CHARTS = KINDS[2:]
CODE = "code"
"""In the place of a weight file's name: the Python files of a third party's estimator."""
GREATEST_MTF = 2.0  # sharpening raises it above 1, hardly beyond this; percent are not fractions


@dataclass(frozen=True)
class StoredCamera:
    """The calibration of one camera.

    Attributes:
        name: of the camera.
        kind: one of `KINDS`: how it was measured.
        blur_estimator: that it belongs to; a chart serves any.
        weights_sha256: of the estimator's weight files, by name, and of a third party's code (`CODE`), which files of
            earlier versions do not have.
        size_px: (height, width) of the pictures; None for a chart, whose MTF does not depend on where it was cropped.
        frames: pictures that it was made from.
        unsharp: those of scenes that do not look sharp (`pipeline.condition.summary.unsharp`); files of earlier
            versions have none.
        sharp_mtf: (2, 8) MTF of the camera that estimates are divided by; None for a fit.
        fit: content of `pipeline.blur.camera_calibration.Calibration`; None for the others.
        version: of the package.
    """

    name: str
    kind: str
    blur_estimator: str
    weights_sha256: dict[str, str]
    size_px: tuple[int, int] | None
    frames: int
    sharp_mtf: list[list[float]] | None
    fit: dict[str, Any] | None
    version: str
    unsharp: int = 0

    def doubt(self) -> str:
        """Why blur relative to it is too low, in words; empty where its pictures look sharp."""
        if not self.unsharp:
            return ""
        number = f"{self.unsharp} of the {self.frames} pictures"
        return (
            f"{number} that {self.name} was calibrated with do not look sharp; blur relative to them is underestimated"
        )


def folder() -> Path:
    """Where calibrations are stored.

    Raises:
        InputError: the user has no home folder, and no variable names another.
    """
    home = os.environ.get("CAMERA_MONITOR_HOME")
    if home:
        return Path(home) / "cameras"
    config = os.environ.get("XDG_CONFIG_HOME")
    try:
        return (Path(config) if config else Path.home() / ".config") / "camera-monitor" / "cameras"
    except RuntimeError:
        raise InputError(
            "cameras are stored below the home folder, and there is none; set CAMERA_MONITOR_HOME"
        ) from None


def names() -> list[str]:
    """Names of the stored cameras, sorted; none without a folder for them.

    Raises:
        InputError: the folder cannot be listed.
    """
    try:
        cameras = folder()
    except InputError:
        return []
    try:
        files = [path for path in cameras.iterdir() if path.suffix == ".json" and path.name[0] != "."]
    except FileNotFoundError:
        return []
    except OSError as error:
        raise InputError(f"{cameras}: cannot be listed ({error.strerror}); set CAMERA_MONITOR_HOME") from None
    return sorted(path.stem for path in files)


def path_of(name: str) -> Path:
    """File of a camera.

    Raises:
        InputError: not a name of letters, digits, dots, hyphens and underscores, or see `folder`.
    """
    if not _NAME.fullmatch(name):
        raise InputError(f"camera name '{name}': expected letters, digits, '.', '-' or '_', at most 64")
    return folder() / f"{name}.json"


def save(camera: StoredCamera) -> Path:
    """Store a calibration; that of the same name is replaced.

    Raises:
        InputError: the folder cannot be written.
    """
    from pipeline.store import write_json

    target = path_of(camera.name)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        write_json(target, asdict(camera))
    except OSError as error:
        raise InputError(f"{target}: cannot be written ({error.strerror}); set CAMERA_MONITOR_HOME") from None
    return target


def load(name: str) -> StoredCamera:
    """Read a calibration.

    Raises:
        InputError: no such camera, or a damaged file.
    """
    path = path_of(name)
    if not path.is_file():
        known = [other for other in names() if other != name]
        hint = did_you_mean(name, known) if known else "none is stored"
        raise InputError(f"--camera {name}: not calibrated ({hint}); camera-monitor calibrate {name} SHARP_PICTURES")
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        size_px = None
        if content["kind"] not in CHARTS:  # charts stored by earlier versions have the size of their crop
            height_px, width_px = (int(side) for side in content["size_px"])
            size_px = height_px, width_px
        camera = StoredCamera(**{**content, "size_px": size_px})
        if camera.kind not in KINDS or (camera.sharp_mtf is None) == (camera.fit is None):
            raise ValueError("neither an MTF nor a fit")
        if type(camera.unsharp) is not int or not 0 <= camera.unsharp <= camera.frames:
            raise ValueError(f"unsharp: {camera.unsharp} of {camera.frames} pictures")
        if not isinstance(camera.weights_sha256, dict):
            raise ValueError("weights_sha256: expected hashes by the name of a weight file")
        if camera.sharp_mtf is not None:
            _matrix(camera.sharp_mtf)
    except (OSError, ValueError, TypeError, KeyError, RecursionError) as error:
        raise _damaged(path, error) from None
    return camera


def _damaged(path: Path, error: Exception) -> InputError:
    return InputError(f"{path}: not the calibration of a camera ({printable(error)}); calibrate it anew")


def files_sha256(blur_name: str, options: Mapping[str, Any] | None = None) -> dict[str, str]:
    """SHA-256 of what decides an estimator's answers: its weight files, by name, and a third party's `CODE`.

    Args:
        blur_name: of the estimator.
        options: that it is made with.
    """
    from pipeline.config.hydra_plugins.plug_in_sources import digest
    from pipeline.recording.provenance import blur_weights

    code = digest("pipeline.blur", blur_name)
    return blur_weights(blur_name, options) | ({} if code is None else {CODE: code})


def apply(camera: StoredCamera, monitor: ConditionMonitor) -> None:
    """Make a monitor's blur relative to a calibrated camera.

    Args:
        camera: its calibration.
        monitor: not calibrated yet.

    Raises:
        InputError: it was calibrated with another estimator, other weights or code, or the estimator cannot be
            calibrated, as one whose answers are relative to something already.
    """
    from pipeline.blur.base import SHARP_FLOOR, Estimator, WithoutEmptyFrequencies
    from pipeline.blur.camera_calibration import CalibratedEstimator, Calibration, refuse_relative
    from pipeline.camera.mtf import CAMERA

    if camera.kind not in CHARTS:
        anew = f"run camera-monitor calibrate {camera.name} again"
        if camera.blur_estimator != monitor.blur_name:
            raise InputError(
                f"--camera {camera.name} was calibrated for the estimator {camera.blur_estimator}, not "
                f"{monitor.blur_name}; {anew} with --blur {monitor.blur_name}"
            )
        stored, known = dict(camera.weights_sha256), files_sha256(monitor.blur_name, monitor.blur_options)
        code = known.pop(CODE, None)
        if stored.pop(CODE, code) != code:
            raise InputError(f"--camera {camera.name} was calibrated with other code of {monitor.blur_name}; {anew}")
        if stored != known:
            raise InputError(f"--camera {camera.name} was calibrated with other weights; {anew}")
    refuse_relative(monitor.blur_estimator)
    if camera.fit is not None:
        try:
            monitor.blur_estimator = CalibratedEstimator(monitor.blur_estimator, Calibration.from_content(camera.fit))
        except (KeyError, TypeError, ValueError) as error:
            raise _damaged(path_of(camera.name), error) from None
        return
    if not isinstance(monitor.blur_estimator, Estimator):
        raise InputError(f"--camera {camera.name}: the estimator {monitor.blur_name} cannot be divided by an MTF")
    made = copy.copy(monitor.blur_estimator)
    made.sharp_mtf, made.relative_to = _matrix(camera.sharp_mtf), CAMERA
    empty = made.sharp_mtf <= SHARP_FLOOR
    monitor.blur_estimator = WithoutEmptyFrequencies(made) if empty.any() else made


def of_other_size(name: str, shape: tuple[int, ...], sharp: Collection[tuple[int, ...]]) -> str:
    """Why a frame of another size than the sharp pictures is to be judged with care, in words.

    Args:
        name: of the frame.
        shape: (height, width).
        sharp: those of the sharp pictures.
    """
    sizes = ", ".join(f"{width}x{height}" for height, width in sorted(sharp))
    return (
        f"{name} is {shape[1]}x{shape[0]} px, the sharp pictures are {sizes} px; "
        "another size means another camera, mode or scaling, whose sharpness differs"
    )


def _matrix(content: Any) -> Any:
    """(2, 8) numbers above 0 and at most `GREATEST_MTF`.

    Raises:
        ValueError: they are not.
    """
    import numpy as np

    matrix = np.array(content, dtype=np.float64)
    if matrix.shape != (2, 8) or not ((matrix > 0) & (matrix <= GREATEST_MTF)).all():
        values = f"{matrix.min():g}..{matrix.max():g}" if matrix.size else "none"
        raise ValueError(
            f"sharp_mtf: expected (2, 8) numbers above 0 and at most {GREATEST_MTF:g} (no percent), "
            f"got shape {matrix.shape}, {values}"
        )
    return matrix
