"""Settings of the experiments: which conditions, which estimators, on how many patches."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from pipeline.settings import (
    UNIQUE,
    BlurKind,
    Count,
    Draws,
    Level,
    Name,
    NoiseSource,
    NonNegative,
    PatchPx,
    Positive,
    Settings,
    TilePx,
)


class EstimatorSettings(Settings):
    """One estimator by its registry name, with the options its class takes."""

    kind: Name
    options: dict[str, Any] = Field(default_factory=dict)


class NoiseEstimatorSettings(EstimatorSettings):
    """A noise estimator of the noise figure."""

    per_frame: Count | None = None
    """Tiles of a frame that a slow one is run on, where that is fewer than all are."""


class BlurEstimatorSettings(EstimatorSettings):
    """A blur estimator of Table I."""

    per_frame: Count | None = None
    """Patches of a frame that a slow one is run on, where that is fewer than all are."""
    calibration_samples: Annotated[int, Field(ge=100, le=100_000)] | None = None
    """Blurred sharp patches that it is calibrated to each dataset's camera on; null leaves it as it is."""


class NoiseSettings(Settings):
    """The evaluation of noise estimators (the noise figure)."""

    noise_sources: Annotated[list[NoiseSource], UNIQUE] = Field(min_length=1)
    target_sigmas_dn: Annotated[list[Level], UNIQUE] = Field(min_length=1)
    tile_px: TilePx
    tiles_per_frame: Count | None
    bootstrap_draws: Draws
    map_target_sigma_dn: Level
    estimators: dict[Name, NoiseEstimatorSettings] = Field(min_length=1)


class BlurSettings(Settings):
    """The evaluation of blur estimators (Table I)."""

    patch_px: PatchPx
    patches_per_frame: Count | None
    bootstrap_draws: Draws
    estimators: dict[Name, BlurEstimatorSettings] = Field(min_length=1)


class GallerySettings(Settings):
    """The picture of the image-formation chain."""

    sigma_dn: Level
    kernel_size_px: Annotated[int, Field(ge=1, le=55)]
    crop_px: PatchPx


class CorruptionSettings(Settings):
    """Which effects at which levels."""

    noise_sources: Annotated[list[Literal["photon", "dcsn", "readout", "combined"]], UNIQUE] = Field(min_length=1)
    target_sigmas_dn: Annotated[list[Level], UNIQUE] = Field(min_length=1)
    gallery: GallerySettings


class PairSettings(Settings):
    """Blur and noise that come together; each enters where it does in the camera."""

    blur_kind: BlurKind
    noise_source: NoiseSource


class SubsetSettings(Settings):
    """The part of the experiments that one blur estimator is run on; what is left out is not restricted."""

    frames: Count | None = None
    sizes_px: Annotated[list[Positive], UNIQUE] | None = None
    angles_deg: Annotated[list[NonNegative], UNIQUE] | None = None
    target_sigmas_dn: Annotated[list[Level], UNIQUE] | None = None
    experiments: Annotated[list[Name], UNIQUE] | None = None


class DenoiseSettings(Settings):
    """Denoise, then estimate; see `pipeline.blur.denoise`. Without a filter it is left out."""

    filter_px: Annotated[float, Field(gt=1, le=31)] | None
    from_sigma_dn: NonNegative
    sigma_by: Name


class CombinedSettings(Settings):
    """Blur and noise at once; see `pipeline.experiments.combined`."""

    experiments: dict[Name, PairSettings] = Field(min_length=1)
    sizes_px: Annotated[list[Positive], UNIQUE] = Field(min_length=1)
    target_sigmas_dn: Annotated[list[Level], UNIQUE] = Field(min_length=1)
    frames: Count | None
    patches_per_frame: Count | None
    tiles_per_frame: Count | None
    noise_estimators: Annotated[list[Name], UNIQUE]
    blur_estimators: dict[Name, SubsetSettings]
    denoise: DenoiseSettings
    example_px: Positive
    bootstrap_draws: Draws


class DenoisedBlurSettings(Settings):
    """The supplement's table of improved blur estimation under noise."""

    blur_kind: BlurKind
    noise_source: NoiseSource
    sizes_px: Annotated[list[Positive], UNIQUE] = Field(min_length=1)
    target_sigmas_dn: Annotated[list[Annotated[float, Field(gt=0, le=100)]], UNIQUE] = Field(min_length=1)
    filters_px: Annotated[list[Annotated[float, Field(gt=1, le=31)]], UNIQUE] = Field(min_length=1)
    frames: Count | None
    patches_per_frame: Count | None
    blur_estimators: Annotated[list[Name], UNIQUE] = Field(min_length=1)
    bootstrap_draws: Draws


class SweepSettings(Settings):
    """The conditions a detector is put through; see `pipeline.experiments.condition`."""

    blur: BlurKind
    match: Literal["nominal", "paper"]
    sizes_px: Annotated[list[Annotated[float, Field(ge=0, le=55)]], UNIQUE] = Field(min_length=1)
    angles_deg: Annotated[list[Annotated[float, Field(ge=0, lt=360)]], UNIQUE] = Field(min_length=1)
    noise_source: NoiseSource
    target_sigmas_dn: Annotated[list[Level], UNIQUE] = Field(min_length=1)
    frames: Count | None
    options: dict[Name, dict[str, Any]]


class MeasureSettings(Settings):
    """How noise and MTF are estimated on objects; see `pipeline.experiments.iopc`."""

    mtf: Name
    sigma: Name
    patch_px: PatchPx
    tile_px: TilePx
    per_frame: Count | None


class OrderStudySettings(Settings):
    """Conditions of the comparison of orders and lights; see `pipeline.experiments.order_study`."""

    sizes_px: Annotated[list[Annotated[float, Field(ge=0, le=55)]], UNIQUE] = Field(min_length=1)
    target_sigmas_dn: Annotated[list[Level], UNIQUE] = Field(min_length=1)
