"""The bank of point spread functions (PSF)."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from pipeline.config.schema_base import Section


class PsfSection(Section):
    """The bank of point spread functions (PSF)."""

    source: Literal["generated", "paper"]
    folder: str | None
    match: Literal["nominal", "paper"]
    kinds: list[Literal["defocus", "linear_motion", "nonlinear_motion"]] = Field(min_length=1)
    sizes_px: list[Annotated[int, Field(ge=1, le=55)]] = Field(min_length=1)
    angles_deg: list[Annotated[float, Field(ge=0, lt=360)]] = Field(min_length=1)

    @model_validator(mode="after")
    def _folder_with_paper(self) -> PsfSection:
        if self.source == "paper" and not self.folder:
            raise ValueError("psf.folder must name the folder of the paper's kernels when psf.source is 'paper'")
        return self


SECTION = PsfSection
