"""Settings of the report: what it lists beside results."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from pipeline.settings import Settings


class ReportSettings(Settings):
    """Datasets and detectors that were not run: name -> the command that would run it; and pictures shown."""

    not_run: dict[str, str]
    not_run_detectors: dict[str, str]
    example_frames: Annotated[int, Field(ge=1, le=8)]
