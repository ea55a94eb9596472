"""Experiments with blur and noise at once."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from pipeline.config.schema_base import Count, Level, Name, NonNegative, Positive, Section


class ExperimentSection(Section):
    """Blur and noise that come together; each enters at its own place in the camera."""

    kind: Literal["defocus", "linear_motion", "nonlinear_motion"]
    effect: Literal["photon", "dcsn", "readout", "combined", "sensor"]


class SubsetSection(Section):
    """The part of the experiments that one blur estimator is run on; what is left out is not restricted."""

    frames: Count | None = None
    sizes_px: list[Positive] | None = None
    angles_deg: list[NonNegative] | None = None
    levels_dn: list[Level] | None = None
    experiments: list[Name] | None = None


class DenoiseSection(Section):
    """Denoise, then estimate; see `pipeline.blur.denoise`. Without a filter it is left out."""

    filter_px: Annotated[float, Field(gt=1, le=31)] | None
    from_sigma_dn: NonNegative
    sigma_by: Name


class CombinedSection(Section):
    """Blur and noise at once; see `pipeline.experiments.combined`."""

    experiments: dict[Name, ExperimentSection] = Field(min_length=1)
    sizes_px: list[Positive] = Field(min_length=1)
    levels_dn: list[Level] = Field(min_length=1)
    frames: Count | None
    patches_per_frame: Count | None
    tiles_per_frame: Count | None
    noise_estimators: list[Name]
    blur_estimators: dict[Name, SubsetSection]
    denoise: DenoiseSection
    example_px: Positive
    bootstrap_draws: Annotated[int, Field(ge=1, le=100_000)]


SECTION = CombinedSection
