"""What the report lists beside results."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from pipeline.config.schema_base import Section


class ReportSection(Section):
    """What the report says of datasets and detectors that were not run: name -> the line that would run it."""

    not_run: dict[str, str]
    not_run_detectors: dict[str, str]
    example_frames: Annotated[int, Field(ge=1, le=8)]


SECTION = ReportSection
