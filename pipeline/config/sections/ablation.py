"""Short trainings of the spectral network that differ in one setting each."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from pipeline.config.schema_base import Count, Name, NonNegative, Section, Share


class AblationVariantSection(Section):
    """What one short training changes; None changes nothing. See `pipeline.blur.ablation`."""

    seed: Annotated[int, Field(ge=0, lt=2**63)] | None = None
    images: Count | None = None
    kernels: Count | None = None
    uses: Count | None = None
    anisotropy: Share | None = None
    intrinsic_px: tuple[NonNegative, NonNegative] | None = None
    clean_share: Share | None = None
    before_share: Share | None = None


class AblationSection(Section):
    """Short trainings of the spectral network that differ in one thing each."""

    steps: Annotated[int, Field(ge=2)]
    images: Count
    kernels: Count
    variants: dict[Name, AblationVariantSection] = Field(min_length=1)


SECTION = AblationSection
