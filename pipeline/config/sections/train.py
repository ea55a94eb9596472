"""Trainings of the networks."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from pipeline.config.schema_base import Count, Level, NonNegative, Positive, Section, Share


class ScheduleSection(Section):
    """The optimiser of a training; see `pipeline.learning.trainer.Schedule`."""

    steps: Count
    learning_rate: Positive
    optimiser: Literal["adamw", "adam"]
    betas: tuple[Annotated[float, Field(ge=0, lt=1)], Annotated[float, Field(ge=0, lt=1)]]
    epsilon: Positive
    weight_decay: NonNegative
    warm_up: Count
    hold: Annotated[float, Field(ge=0, lt=1)]
    final_share: Share
    average_decay: Annotated[float, Field(ge=0, lt=1)]
    clip: Positive | None
    checkpoint_every: Count
    report_every: Count


class RecipeSection(Section):
    """What training samples are drawn from; see `pipeline.learning.samples.Recipe`."""

    views: Count
    kernels_per_view: Count
    anisotropy: Share
    intrinsic_px: tuple[NonNegative, NonNegative]
    clean_share: Share
    before_share: Share
    largest_sigma_dn: Annotated[float, Field(gt=1, le=100)]
    camera_fraction: Share


class MtfTrainingSection(Section):
    """The training of one blur network; see `pipeline.learning.training.Training`."""

    schedule: ScheduleSection
    recipe: RecipeSection
    images: Count
    validation_images: Count
    kernels: Count
    kernel_distribution: Literal["paper_like", "with_optics"]
    fresh: Count
    uses: Count
    window: Count
    validation_chunks: Count
    half_precision: bool


class NoiseRecipeSection(Section):
    """What the noise networks' samples are drawn from; see `pipeline.noise.samples.Recipe`."""

    size_px: Annotated[int, Field(ge=16, le=256, multiple_of=8)]
    views: Count
    noises: Count
    sigma_dn: tuple[Level, Level]
    clean_share: Share
    low_share: Share
    texture_share: Share
    blurred_noise_share: Share
    interpolated_share: Share
    compressed_share: Share
    sources: Literal["any", "mixed"]


class SigmaTrainingSection(Section):
    """A training of a noise network; see `pipeline.noise.training.Settings`."""

    schedule: ScheduleSection
    recipe: NoiseRecipeSection
    images: Count
    validation_images: Count
    fresh: Count
    uses: Count
    window: Count
    validation_chunks: Count


class CameraRecipeSection(Section):
    """Distribution of random cameras; see `pipeline.learning.cameras.CameraRecipe`."""

    sigma_dn: tuple[Positive, Positive]
    noise_free_fraction: Share
    codec_only_fraction: Share
    denoising_fraction: Share
    scaling_fraction: Share
    video_fraction: Share


class CameraSamplesSection(Section):
    """What shots of random cameras are drawn from; see `pipeline.noise.camera_samples.Recipe`."""

    scenes: Count
    cameras: CameraRecipeSection
    texture_fraction: Share
    fur_fraction: Share
    text_fraction: Share
    lens_px: tuple[NonNegative, NonNegative]
    added_fraction: Share


class CorrelatedTrainingSection(Section):
    """The training of the network for correlated noise; see `pipeline.noise.correlated_training.Settings`."""

    schedule: ScheduleSection
    recipe: CameraSamplesSection
    members: Annotated[int, Field(ge=1, le=16)]
    white_noise_free_fraction: Share
    images: Count
    validation_images: Count
    fresh: Count
    uses: Count
    window: Count
    validation_chunks: Count


class CropRecipeSection(Section):
    """How a detector's samples are cut; see `pipeline.detection.compact.samples.CropRecipe`."""

    size_px: Annotated[int, Field(ge=64, le=1024, multiple_of=32)]
    count: Count
    scale: tuple[Positive, Positive]
    at_object: Share


class DetectorTrainingSection(Section):
    """A training of a compact detector; see `pipeline.detection.compact.training.DetectorTraining`."""

    schedule: ScheduleSection
    recipe: CropRecipeSection
    frames: Count
    validation_frames: Count
    rays: Annotated[int, Field(ge=1, le=8)]
    width_px: Annotated[int, Field(ge=32, le=4096)]
    height_px: Annotated[int, Field(ge=32, le=4096)]
    uses: Count
    window: Count
    half_precision: bool


class TypicalCameraSection(Section):
    """What the spectral estimator is fitted to cameras at large on; see `pipeline.blur.typical_camera`."""

    images: Count
    patches: Count
    samples: Annotated[int, Field(ge=100, le=100_000)]
    intrinsic_px: tuple[NonNegative, NonNegative]


class FusionRecipeSection(Section):
    """What the fusion gate's samples are drawn from; see `pipeline.blur.fusion_samples.Recipe`."""

    samples: Annotated[int, Field(ge=4, le=100_000)]
    kernel_distribution: Literal["paper_like", "with_optics"]
    anisotropy: Share
    intrinsic_px: tuple[NonNegative, NonNegative]
    clean_share: Share
    largest_sigma_dn: Annotated[float, Field(gt=1, le=100)]
    largest_mean_mtf: Annotated[float, Field(gt=0, le=1)]


class FusionSection(Section):
    """The training of the fused estimator's gate; see `pipeline.blur.fusion_training.Settings`."""

    recipe: FusionRecipeSection
    steps: Count
    learning_rate: Positive
    weight_decay: NonNegative
    folds: Annotated[int, Field(ge=2, le=20)]


class TrainSection(Section):
    """Trainings by what they estimate or find."""

    mtf: dict[Literal["spectral", "spectral_processed", "cnn"], MtfTrainingSection]
    fusion: FusionSection
    typical_camera: TypicalCameraSection
    sigma: dict[Literal["cellwise", "cnn"], SigmaTrainingSection]
    sigma_correlated: CorrelatedTrainingSection
    detector: dict[Literal["compact", "compact_two_stage"], DetectorTrainingSection]


SECTION = TrainSection
