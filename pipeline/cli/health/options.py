"""What ``camera-monitor health`` is asked for, and which of its options exclude one another."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.errors import InputError, printable

if TYPE_CHECKING:
    from pipeline.cli.calibration.camera_store import StoredCamera


@dataclass(frozen=True, kw_only=True)
class HealthOptions:
    """The options of the command, by the names of its parameters; see its help.

    Raises:
        InputError: two of them exclude each other, or one lacks another.
    """

    paths: tuple[Path, ...]
    out: Path | None
    maps: bool
    blur_name: str
    quality: str
    noise_name: str
    most_tiles: int
    most_patches: int
    sharp: tuple[Path, ...]
    calibrate_estimator: bool
    generic_lens: bool
    camera_name: str | None
    codec: str | None
    as_json: bool
    as_lines: bool
    alarm_sigma_dn: float | None
    alarm_mtf50: float | None
    alarm_flags: bool
    every: int
    exposure: str | None
    iso: float | None
    surface: Path | None
    reference_frames: int
    no_trend: bool

    def __post_init__(self) -> None:
        if self.quality == "best" and self.blur_name != "spectral":
            raise InputError(f"--quality best chooses the blur estimator; leave --blur {self.blur_name} out")
        if self.calibrate_estimator and not self.sharp:
            raise InputError("--calibrate-estimator needs sharp pictures of the same camera; give them by --sharp")
        if self.generic_lens and self.sharp:
            raise InputError("--generic-lens is instead of --sharp, which is more exact: leave --generic-lens out")
        if self.generic_lens and self.estimator != "spectral":
            raise InputError(
                f"--generic-lens is for the blur estimator spectral, not {self.estimator}; leave one of them out"
            )
        if self.camera_name is not None and (self.sharp or self.generic_lens):
            raise InputError("--camera NAME is instead of --sharp and --generic-lens")
        if self.maps and self.out is None:
            raise InputError("--map needs --out FOLDER, where the pictures go")
        if self.as_json and self.as_lines:
            raise InputError("--json and --jsonl: choose one of the two")

    @property
    def estimator(self) -> str:
        """Name of the blur estimator."""
        return "fused" if self.quality == "best" else self.blur_name

    @cached_property
    def files(self) -> list[Path]:
        """Pictures and videos to measure."""
        from pipeline.cli.frames.given_files import expand

        return expand(self.paths)

    @cached_property
    def sharp_files(self) -> list[Path]:
        """Those known to be sharp."""
        from pipeline.cli.frames.given_files import expand

        return expand(self.sharp) if self.sharp else []

    @cached_property
    def camera(self) -> StoredCamera | None:
        """The calibrated camera that blur is relative to."""
        from pipeline.cli.calibration import camera_store

        return None if self.camera_name is None else camera_store.load(self.camera_name)

    @property
    def relative_to(self) -> str:
        """What blur is relative to, in words; empty for the MTF of the whole system. An unknown camera is refused."""
        if self.camera is not None:
            doubtful = ", whose pictures do not all look sharp" if self.camera.unsharp else ""
            return f"the calibration of the camera {self.camera_name}{doubtful}"
        return "the sharp frames" if self.sharp else "a generic lens" if self.generic_lens else ""

    def about(self) -> dict[str, Any]:
        """What the files of a run state about it; weights are added when the monitor is made, which may fail."""
        from pipeline.cli.package_version import version

        return {
            "version": version(), "blur_estimator": self.estimator, "noise_estimator": self.noise_name,
            "sharp": [printable(file) for file in self.sharp_files],
            "relative": bool(self.relative_to), "relative_to": self.relative_to, "camera": self.camera_name,
            "codec": self.codec or "",
            "thresholds": {"sigma_dn": self.alarm_sigma_dn, "mtf50": self.alarm_mtf50, "flags": self.alarm_flags},
            "weights_released": {}, "weights_sha256": {},
        }  # fmt: skip
