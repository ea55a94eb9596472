"""Which effects frames are corrupted by, and the gallery of image formation."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from pipeline.config.schema_base import Level, Section


class GallerySection(Section):
    """The picture of the image-formation chain."""

    sigma_dn: Level
    kernel_size_px: Annotated[int, Field(ge=1, le=55)]
    crop_px: Annotated[int, Field(ge=32, le=1024)]


class CorruptionSection(Section):
    """Which effects at which levels."""

    effects: list[Literal["photon", "dcsn", "readout", "combined"]] = Field(min_length=1)
    levels_dn: list[Level] = Field(min_length=1)
    gallery: GallerySection


SECTION = CorruptionSection
