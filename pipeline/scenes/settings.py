"""Settings of the *Sim* dataset: how much is rendered, and how finely."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from pipeline.settings import UNIQUE, Count, Frequency, Settings


class ScenesSettings(Settings):
    """How much of the *Sim* dataset is rendered, and how finely."""

    viewpoints: Count
    samples: Annotated[int, Field(ge=1, le=8)]
    width_px: Annotated[int, Field(ge=64, le=4096)]
    height_px: Annotated[int, Field(ge=64, le=4096)]
    radiance: bool
    star_periods: Annotated[int, Field(ge=8, le=360)]
    star_frequencies: Annotated[list[Frequency], UNIQUE] = Field(min_length=1)
