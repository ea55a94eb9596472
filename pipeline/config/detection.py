"""The section ``detection``: detectors, the conditions they are put through, and how they are evaluated."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from pipeline.curves.settings import CurvesSettings, RegressionSettings
from pipeline.detection.settings import DetectorSettings, EvaluationSettings
from pipeline.experiments.settings import MeasureSettings, SweepSettings
from pipeline.settings import UNIQUE, Name, Settings


class DetectionSettings(Settings):
    """Detectors under blur and noise."""

    detectors: dict[Name, DetectorSettings] = Field(min_length=1)
    datasets: Annotated[list[Name], UNIQUE]
    sweep: SweepSettings
    evaluation: EvaluationSettings
    measure: MeasureSettings
    curves: CurvesSettings
    regression: RegressionSettings
