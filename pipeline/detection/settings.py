"""Settings of detectors, of their evaluation, and of the compact detectors' trainings."""

from __future__ import annotations

from dataclasses import field
from typing import Annotated, Any, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from pipeline.learning.settings import LoopSettings
from pipeline.settings import STRICT, Count, Draws, Fraction, Name, NonNegative, Positive, Settings


class DetectorSettings(Settings):
    """One detector by its registry name; of one with weights, where they lie, and what gets them."""

    kind: Name
    weights: str | None = None
    dvc_dependency: str | None = None
    """File that the stage `detector` depends on; by default the weights, or the module of a third party's detector."""
    fetch_command: str | None = None
    options: dict[str, Any] = Field(default_factory=dict)

    def arguments(self) -> dict[str, Any]:
        """Keyword arguments of the detector's class: its weights, where it has some, and its options."""
        return ({} if self.weights is None else {"weights": self.weights}) | self.options


class EvaluationSettings(Settings):
    """What counts as a true positive; see `pipeline.detection.average_precision`."""

    rule: Literal["paper", "coco"]
    iou_threshold: Annotated[float, Field(gt=0, le=1)]
    min_height_px: NonNegative
    min_visible_fraction: Fraction
    bootstrap_draws: Draws


@dataclass(frozen=True, config=STRICT)
class CropRecipe:
    """How a compact detector's sample is cut (`pipeline.detection.compact.samples`).

    Attributes:
        size_px: side of a sample, a multiple of 32.
        count: samples in a chunk.
        scale: range of sample pixels per frame pixel (log-uniform).
        at_object: share of crops that hold a randomly picked object.
    """

    size_px: Annotated[int, Field(ge=64, le=1024, multiple_of=32)] = 416
    count: Count = 16
    scale: tuple[Positive, Positive] = (0.6, 1.6)
    at_object: Fraction = 0.8


@dataclass(frozen=True, kw_only=True, config=STRICT)
class DetectorTraining(LoopSettings):
    """The training of a compact detector: all that its weights depend on, beside the code.

    Attributes:
        recipe: of the samples.
        frames, validation_frames: rendered viewpoints.
        rays: N of N x N rays a pixel of these frames.
        width_px, height_px: of these frames.
        half_precision: convolutions in bfloat16 while training.
    """

    recipe: CropRecipe = field(default_factory=CropRecipe)
    frames: Count = 400
    validation_frames: Count = 24
    rays: Annotated[int, Field(ge=1, le=8)] = 2
    width_px: Annotated[int, Field(ge=32, le=4096)] = 896
    height_px: Annotated[int, Field(ge=32, le=4096)] = 768
    replays: Count = 1
    replay_window: Count = 64
    half_precision: bool = True
