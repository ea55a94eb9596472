"""Settings of the noise networks' trainings and of the samples they are trained on."""

from __future__ import annotations

from dataclasses import field
from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from pipeline.learning.settings import CameraRecipe, PictureTraining
from pipeline.settings import STRICT, Count, Fraction, Level, NonNegative

Kind = Literal["cellwise", "cnn"]


@dataclass(frozen=True, config=STRICT)
class Recipe:
    """What labelled samples of sensor noise are drawn from (`pipeline.noise.training.samples`).

    Attributes:
        size_px: side of a patch, pixels; a multiple of 8.
        views: clean images in a chunk.
        noises: samples made of each, with noise of their own.
        sigma_dn: range of the noise, DN.
        clean_fraction: share of samples without any.
        low_fraction: share whose noise is spread evenly over the logarithm from 0.3 to 8 DN; the rest is even.
        texture_fraction, blurred_noise_fraction: shares of clean images with fine texture, and with noise that came
            before a blur, which does not count.
        interpolated_fraction, compressed_fraction: shares enlarged from fewer pixels, and stored as JPEG.
        sources: which noise: ``"any"`` (photon, constant and mixed) or ``"mixed"`` only.
        tone_curve_fraction: share of the samples with noise whose light went through a tone curve after the noise came.
        gamma: range of that curve's exponent.
    """

    size_px: Annotated[int, Field(ge=16, le=256, multiple_of=8)] = 128
    views: Count = 8
    noises: Count = 4
    sigma_dn: tuple[Level, Level] = (0.0, 42.0)
    clean_fraction: Fraction = 0.18
    low_fraction: Fraction = 0.22
    texture_fraction: Fraction = 0.65
    blurred_noise_fraction: Fraction = 0.15
    interpolated_fraction: Fraction = 0.12
    compressed_fraction: Fraction = 0.15
    sources: Literal["any", "mixed"] = "any"
    tone_curve_fraction: Fraction = 0.0
    gamma: tuple[NonNegative, NonNegative] = (1.5, 2.6)


@dataclass(frozen=True, config=STRICT)
class CameraSamplesRecipe:
    """What shots of random cameras are drawn from (`pipeline.noise.training.camera_samples`).

    Attributes:
        scenes: in a chunk; each gives three samples.
        cameras: distribution of the cameras.
        texture_fraction, fur_fraction, text_fraction: scenes with fine texture, with strands of fur or grass, and with
            small print.
        lens_px: range of the lens's Gaussian, pixels.
        added_fraction: of the last shots, how many get white noise on top.
    """

    scenes: Count = 16
    cameras: CameraRecipe = field(default_factory=CameraRecipe)
    texture_fraction: Fraction = 0.5
    fur_fraction: Fraction = 0.12
    text_fraction: Fraction = 0.1
    lens_px: tuple[NonNegative, NonNegative] = (0.35, 1.6)
    added_fraction: Fraction = 0.4


@dataclass(frozen=True, kw_only=True, config=STRICT)
class SigmaTraining(PictureTraining):
    """The training of a network for white noise (`pipeline.noise.training.sensor_noise`).

    Attributes:
        kind: ``"cellwise"`` or ``"cnn"``.
        recipe: of the samples.
    """

    kind: Kind = "cellwise"
    recipe: Recipe = field(default_factory=Recipe)
    replays: Count = 3
    replay_window: Count = 128


@dataclass(frozen=True, kw_only=True, config=STRICT)
class CorrelatedTraining(PictureTraining):
    """The training of the network for correlated noise (`pipeline.noise.training.correlated`).

    Attributes:
        recipe: of the camera samples.
        recorded: of the samples of cameras that add white noise and a codec only.
        noise_free: of the samples that look like the mean of many shots, one per scene.
        members: perceptrons that are averaged.
        white_noise_free_fraction: of the samples with white noise: those without any, as a renderer makes them.
    """

    recipe: CameraSamplesRecipe = field(default_factory=CameraSamplesRecipe)
    recorded: CameraSamplesRecipe = field(default_factory=CameraSamplesRecipe)
    noise_free: CameraSamplesRecipe = field(default_factory=CameraSamplesRecipe)
    members: Annotated[int, Field(ge=1, le=16)] = 4
    white_noise_free_fraction: Fraction = 0.35
    replays: Count = 8
    replay_window: Count = 4000
    validation_chunks: Count = 60
