"""Settings of the input-output performance curves and of the regression on camera settings."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from pipeline.settings import UNIQUE, NonNegative, Positive, Settings

Bins = Annotated[list[NonNegative], Field(min_length=2)]


class CurvesSettings(Settings):
    """Bins of the curves, and which rises are marked."""

    average_directions: bool
    sigma_bins_dn: Bins
    mtf_bins: Bins
    tolerance_percent: NonNegative

    @model_validator(mode="after")
    def _rising(self) -> CurvesSettings:
        for name, bins in (("sigma_bins_dn", self.sigma_bins_dn), ("mtf_bins", self.mtf_bins)):
            if sorted(set(bins)) != list(bins):
                raise ValueError(f"{name}: expected rising bin centres")
        return self


class RegressionSettings(Settings):
    """Which settings stand for a condition; see `pipeline.curves.iso_exposure`."""

    sigma_per_iso: Positive
    px_per_ms: Positive
    terms: Annotated[list[Literal["c1", "c2", "c3", "c4", "c5", "c6", "c7", "c8"]], UNIQUE] = Field(min_length=1)
    least_error_percent: Positive
