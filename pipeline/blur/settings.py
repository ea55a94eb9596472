"""Settings of the blur estimators' trainings: the fusion gate, the generic lens, and the ablation study."""

from __future__ import annotations

from dataclasses import field
from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from pipeline.learning.settings import KernelDistribution
from pipeline.settings import STRICT, Count, Fraction, Name, NonNegative, Positive, Seed, Settings


@dataclass(frozen=True, config=STRICT)
class FusionRecipe:
    """What the fusion gate's samples are drawn from (`pipeline.blur.fusion.samples`).

    Attributes:
        samples: number of patches, each with a picture and a blur of its own.
        kernel_distribution: see `pipeline.learning.kernels.draw`.
        anisotropy: see `pipeline.learning.images.view`.
        intrinsic_px: range of the intrinsic Gaussian's standard deviation, pixels.
        clean_fraction: share of samples without noise.
        largest_sigma_dn: of the noise; half of the levels are even, half logarithmic from 1 DN.
        largest_mean_mtf: kernels with a higher mean MTF are passed over.
        seed: root of the random streams.
    """

    samples: Annotated[int, Field(ge=4, le=100_000)] = 1440
    kernel_distribution: KernelDistribution = "with_optics"
    anisotropy: Fraction = 0.7
    intrinsic_px: tuple[NonNegative, NonNegative] = (0.0, 0.7)
    clean_fraction: Fraction = 0.5
    largest_sigma_dn: Annotated[float, Field(gt=1, le=100)] = 25.0
    largest_mean_mtf: Annotated[float, Field(gt=0, le=1)] = 0.65
    seed: Seed = 1


@dataclass(frozen=True, config=STRICT)
class FusionTraining:
    """The training of the fusion gate: all that it depends on, beside the code and the spectral network.

    Attributes:
        recipe: of the samples.
        steps: of the optimiser.
        learning_rate: at the first step.
        weight_decay: of AdamW.
        folds: of the cross-validation.
    """

    recipe: FusionRecipe = field(default_factory=FusionRecipe)
    steps: Count = 350
    learning_rate: Positive = 0.01
    weight_decay: NonNegative = 0.3
    folds: Annotated[int, Field(ge=2, le=20)] = 4


class GenericLensSettings(Settings):
    """What the spectral estimator is calibrated to a generic lens on; see `pipeline.blur.generic_lens`."""

    images: Count
    patches: Count
    samples: Annotated[int, Field(ge=100, le=100_000)]
    intrinsic_px: tuple[NonNegative, NonNegative]


class AblationVariant(Settings):
    """What one short training changes; None changes nothing. See `pipeline.blur.training.ablation`."""

    steps: Annotated[int, Field(ge=2)] | None = None
    seed: Seed | None = None
    images: Count | None = None
    kernels: Count | None = None
    replays: Count | None = None
    anisotropy: Fraction | None = None
    intrinsic_px: tuple[NonNegative, NonNegative] | None = None
    clean_fraction: Fraction | None = None
    pre_blur_noise_fraction: Fraction | None = None
    camera_fraction: Fraction | None = None
    width: Annotated[float, Field(gt=0, le=4)] | None = None
    block_px: Literal[64, 96] | None = None


class AblationSettings(Settings):
    """Short trainings of the spectral network that differ in one thing each, and on what else they are judged."""

    judged_on: dict[Name, AblationVariant]
    steps: Annotated[int, Field(ge=2)]
    images: Count
    kernels: Count
    variants: dict[Name, AblationVariant] = Field(min_length=1)
