"""Settings of trainings: schedule of the optimiser, what samples are drawn from, and what every training has."""

from __future__ import annotations

import math
from dataclasses import field
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator
from pydantic.dataclasses import dataclass

from pipeline.settings import STRICT, Count, Fraction, NonNegative, Positive, Seed

KernelDistribution = Literal["paper_like", "with_optics"]
Decay = Annotated[float, Field(ge=0, lt=1)]


@dataclass(frozen=True, config=STRICT)
class Schedule:
    """How a network is trained.

    Attributes:
        steps: T; the schedule ends there.
        learning_rate: its greatest value.
        optimiser: ``adamw`` or ``adam``.
        betas, epsilon, weight_decay: of the optimiser.
        warm_up: steps.
        constant_lr_fraction: share of the steps before the rate begins to fall, in [0, 1). Until then the length of the
            training makes no difference, so it can still be changed.
        final_lr_ratio: e, of the learning rate at the end; 1 keeps it constant.
        ema_decay: of the moving average of the weights; 0 keeps the weights themselves.
        max_grad_norm: greatest norm of the gradient; None leaves it.
        checkpoint_every, report_every: steps.
    """

    steps: Count
    learning_rate: Positive = 2e-3
    optimiser: Literal["adamw", "adam"] = "adamw"
    betas: tuple[Decay, Decay] = (0.9, 0.99)
    epsilon: Positive = 1e-8
    weight_decay: NonNegative = 1e-3
    warm_up: Count = 150
    constant_lr_fraction: Decay = 0.0
    final_lr_ratio: Fraction = 0.01
    ema_decay: Decay = 0.998
    max_grad_norm: Positive | None = 1.0
    checkpoint_every: Count = 1000
    report_every: Count = 100

    @model_validator(mode="after")
    def _validation_has_a_row(self) -> Self:
        if self.checkpoint_every % self.report_every:
            raise ValueError(
                f"checkpoint_every is {self.checkpoint_every}; expected a multiple of report_every, "
                f"{self.report_every}, so that validation has a row in the learning curve"
            )
        return self

    def rate(self, step: int) -> float:
        """Learning rate of a step."""
        fall = max(0.0, step / self.steps - self.constant_lr_fraction) / (1 - self.constant_lr_fraction)
        cosine = 0.5 * (1 + math.cos(math.pi * min(fall, 1.0)))
        warm = min(1.0, (step + 1) / max(self.warm_up, 1))
        return self.learning_rate * warm * (self.final_lr_ratio + (1 - self.final_lr_ratio) * cosine)


@dataclass(frozen=True, config=STRICT)
class CameraRecipe:
    """Distribution of random cameras (`pipeline.learning.cameras`).

    Attributes:
        sigma_dn: range of the noise behind the tone curve before denoising, DN, even in its logarithm.
        noise_free_fraction: cameras without noise.
        codec_only_fraction: cameras without colour filters or processing, whose white noise meets a codec alone.
        denoising_fraction: colour cameras that denoise luma.
        scaling_fraction: colour cameras that scale their pictures, 0.5 to 1.4; 0 where the sampler wants none.
        video_fraction: cameras that deliver video frames (H.264, MPEG-4, Motion JPEG).
    """

    sigma_dn: tuple[Positive, Positive] = (0.5, 45.0)
    noise_free_fraction: Fraction = 0.08
    codec_only_fraction: Fraction = 0.25
    denoising_fraction: Fraction = 0.5
    scaling_fraction: Fraction = 0.25
    video_fraction: Fraction = 0.1


@dataclass(frozen=True, config=STRICT)
class Recipe:
    """What labelled samples of blur are drawn from (`pipeline.learning.samples`).

    Attributes:
        views: views in a chunk.
        kernels_per_view: samples made of each view, by different kernels.
        anisotropy: see `pipeline.learning.images.view`.
        intrinsic_px: range of the intrinsic Gaussian's standard deviation, pixels.
        clean_fraction, pre_blur_noise_fraction: shares of samples without noise and with photon noise before the blur;
            the others have noise after it.
        largest_sigma_dn: of the noise; half of the levels are even, half logarithmic from 1 DN.
        camera_fraction: share of views that are delivered by a random camera.
        cameras: their distribution; they do not scale, which would move frequencies.
    """

    views: Count = 16
    kernels_per_view: Count = 2
    anisotropy: Fraction = 0.7
    intrinsic_px: tuple[NonNegative, NonNegative] = (0.0, 0.7)
    clean_fraction: Fraction = 0.45
    pre_blur_noise_fraction: Fraction = 0.15
    largest_sigma_dn: Annotated[float, Field(gt=1, le=100)] = 30.0
    camera_fraction: Fraction = 0.0
    cameras: CameraRecipe = field(
        default_factory=lambda: CameraRecipe(
            sigma_dn=(0.5, 40.0), noise_free_fraction=0.3, scaling_fraction=0.0, video_fraction=0.02
        )
    )

    @property
    def chunk(self) -> int:
        """Samples in a chunk."""
        return self.views * self.kernels_per_view


@dataclass(frozen=True, kw_only=True, config=STRICT)
class LoopSettings:
    """What the loop of every training takes (`pipeline.learning.fitting.fit`).

    Attributes:
        schedule: of the optimiser.
        new_chunks_per_step, replays, replay_window: see `pipeline.learning.chunk_loader`; a batch has
            new_chunks_per_step * replays chunks.
        seed: of everything.
    """

    schedule: Schedule
    new_chunks_per_step: Count = 1
    replays: Count = 2
    replay_window: Count = 256
    seed: Seed = 1


@dataclass(frozen=True, kw_only=True, config=STRICT)
class PictureTraining(LoopSettings):
    """A training on samples made of procedural pictures.

    Attributes:
        images, validation_images: pictures in the banks.
        validation_chunks: chunks that weights are selected on, of pictures never trained on.
    """

    images: Count = 2400
    validation_images: Count = 160
    validation_chunks: Count = 40


@dataclass(frozen=True, kw_only=True, config=STRICT)
class Training(PictureTraining):
    """The training of a blur network: all that the result depends on, beside the code.

    Attributes:
        recipe: of the samples.
        kernels: kernels in the bank; validation has a sixteenth of them, at least one block.
        kernel_distribution: of `pipeline.learning.kernels.DISTRIBUTIONS`.
        half_precision: convolutions in bfloat16 while training.
    """

    recipe: Recipe = field(default_factory=Recipe)
    kernels: Count = 12_000
    kernel_distribution: KernelDistribution = "paper_like"
    half_precision: bool = True
