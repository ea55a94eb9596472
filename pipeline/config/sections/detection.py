"""Detectors, their sweep over conditions, and how they are evaluated."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from pipeline.config.schema_base import Count, Level, Name, NonNegative, Positive, Section, Share

Bins = Annotated[list[NonNegative], Field(min_length=2)]


class DetectorSection(Section):
    """One detector by its registry name, where its weights lie, and what gets them."""

    kind: Name
    weights: str
    watch: str
    get: str
    options: dict[str, Any] = Field(default_factory=dict)


class SweepSection(Section):
    """The conditions a detector is put through; see `pipeline.experiments.condition`."""

    blur: Literal["defocus", "linear_motion", "nonlinear_motion"]
    match: Literal["nominal", "paper"]
    sizes_px: list[Annotated[float, Field(ge=0, le=55)]] = Field(min_length=1)
    angles_deg: list[Annotated[float, Field(ge=0, lt=360)]] = Field(min_length=1)
    effect: Literal["photon", "dcsn", "readout", "combined", "sensor"]
    levels_dn: list[Level] = Field(min_length=1)
    frames: Count | None
    options: dict[Name, dict[str, Any]]


class JudgeSection(Section):
    """What counts as found; see `pipeline.detection.average_precision`."""

    rule: Literal["paper", "coco"]
    overlap: Annotated[float, Field(gt=0, le=1)]
    lowest_px: NonNegative
    least_visible: Share
    bootstrap_draws: Annotated[int, Field(ge=1, le=100_000)]


class MeasureSection(Section):
    """How noise and MTF are estimated on objects; see `pipeline.experiments.iopc`."""

    mtf: Name
    sigma: Name
    patch_px: Annotated[int, Field(ge=32, le=1024)]
    tile_px: Annotated[int, Field(ge=16, le=1024)]
    per_frame: Count | None


class CurvesSection(Section):
    """Bins of the curves, and which rises are marked."""

    average_directions: bool
    sigma_bins_dn: Bins
    mtf_bins: Bins
    tolerance_percent: NonNegative

    @model_validator(mode="after")
    def _rising(self) -> CurvesSection:
        for name, bins in (("sigma_bins_dn", self.sigma_bins_dn), ("mtf_bins", self.mtf_bins)):
            if sorted(set(bins)) != list(bins):
                raise ValueError(f"{name}: expected rising bin centres")
        return self


class RegressionSection(Section):
    """Which settings stand for a condition; see `pipeline.curves.by_settings`."""

    sigma_per_iso: Positive
    px_per_ms: Positive
    terms: list[Literal["c1", "c2", "c3", "c4", "c5", "c6", "c7", "c8"]] = Field(min_length=1)
    least_error_percent: Positive


class DetectionSection(Section):
    """Detectors under blur and noise."""

    detectors: dict[Name, DetectorSection] = Field(min_length=1)
    datasets: list[Name]
    sweep: SweepSection
    judge: JudgeSection
    measure: MeasureSection
    curves: CurvesSection
    regression: RegressionSection


SECTION = DetectionSection
