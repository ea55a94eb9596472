"""Blur estimated on denoised patches."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from pipeline.config.schema_base import Count, Name, Positive, Section


class DenoisedBlurSection(Section):
    """The supplement's table of improved blur estimation under noise."""

    kind: Literal["defocus", "linear_motion", "nonlinear_motion"]
    effect: Literal["photon", "dcsn", "readout", "combined", "sensor"]
    sizes_px: list[Positive] = Field(min_length=1)
    levels_dn: list[Annotated[float, Field(gt=0, le=100)]] = Field(min_length=1)
    filters_px: list[Annotated[float, Field(gt=1, le=31)]] = Field(min_length=1)
    frames: Count | None
    patches_per_frame: Count | None
    blur_estimators: list[Name] = Field(min_length=1)
    bootstrap_draws: Annotated[int, Field(ge=1, le=100_000)]


SECTION = DenoisedBlurSection
