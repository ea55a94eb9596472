"""The section ``train``: every training by what its network estimates or detects."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from pipeline.blur.settings import FusionTraining, GenericLensSettings
from pipeline.detection.settings import DetectorTraining
from pipeline.learning.settings import Training
from pipeline.noise.settings import CorrelatedTraining, SigmaTraining
from pipeline.settings import Settings

BlurNetwork = Annotated[str, Field(pattern="^(spectral|spectral_processed|pixels|cnn)$")]
NoiseNetwork = Annotated[str, Field(pattern="^(cellwise|cnn)$")]
DetectorNetwork = Annotated[str, Field(pattern="^(compact|compact_two_stage)$")]


class TrainSettings(Settings):
    """Trainings by network."""

    mtf: dict[BlurNetwork, Training]
    fusion: FusionTraining
    generic_lens: GenericLensSettings
    sigma: dict[NoiseNetwork, SigmaTraining]
    sigma_correlated: CorrelatedTraining
    detector: dict[DetectorNetwork, DetectorTraining]
