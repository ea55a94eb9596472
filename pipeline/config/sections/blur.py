"""The evaluation of blur estimators."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from pipeline.config.schema_base import Count, Name, Section
from pipeline.config.schema_estimator import EstimatorSection


class BlurSection(Section):
    """The evaluation of blur estimators."""

    patch_px: Annotated[int, Field(ge=32, le=1024)]
    patches_per_frame: Count | None
    bootstrap_draws: Annotated[int, Field(ge=1, le=100_000)]
    estimators: dict[Name, EstimatorSection] = Field(min_length=1)


SECTION = BlurSection
