"""The evaluation of noise estimators."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from pipeline.config.schema_base import Count, Level, Name, Section
from pipeline.config.schema_estimator import EstimatorSection


class NoiseSection(Section):
    """The evaluation of noise estimators."""

    tile_px: Annotated[int, Field(ge=16, le=1024)]
    tiles_per_frame: Count | None
    bootstrap_draws: Annotated[int, Field(ge=1, le=100_000)]
    map_level_dn: Level
    estimators: dict[Name, EstimatorSection] = Field(min_length=1)


SECTION = NoiseSection
