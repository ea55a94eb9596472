"""Settings of noise estimators on recordings of real cameras."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from pipeline.experiments.settings import EstimatorSettings
from pipeline.settings import Draws, Name, Positive, Settings


class RecordingSettings(Settings):
    """Pictures of real cameras with measured noise; a recording without a folder is not run."""

    kind: Literal["pairs", "raw"]
    folder: str | None
    """Of pairs ``NAME_real.*`` and ``NAME_mean.*``, or one that holds the two folders of raw frames."""
    light: str | None = None
    """Folder of raw frames of lit scenes, relative to ``folder``."""
    dark: str | None = None
    """Folder of dark frames, relative to ``folder``."""
    white_dn: Positive = 255.0
    """Grey value of saturation of raw frames."""
    dvc_dependency: str
    source: str

    @model_validator(mode="after")
    def _raw_has_both_folders(self) -> RecordingSettings:
        if {self.light is not None, self.dark is not None} != {self.kind == "raw"}:
            raise ValueError(f"kind is '{self.kind}': light and dark are set for raw frames, and for those only")
        return self


class RealNoiseSettings(Settings):
    """Noise estimators on recordings of real cameras."""

    bootstrap_draws: Draws
    estimators: dict[Name, EstimatorSettings] = Field(min_length=1)
    recordings: dict[Name, RecordingSettings]
