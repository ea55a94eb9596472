"""Training the compact detectors on *Sim*: frames, samples, loop, and average precision on places held back.

Validation frames are whole frames of further viewpoints of the same split; the weights with the highest mean average
precision on them (over classes, as the paper counts) are kept. No evaluation frame takes part.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.detection.compact.samples import CropMaker
from pipeline.detection.settings import DetectorTraining
from pipeline.detection.sim_frames import SimFrames, sim_frames
from pipeline.learning import fitting
from pipeline.learning.run_options import RunOptions
from pipeline.learning.trainer import Trained
from pipeline.registry import Registry

if TYPE_CHECKING:
    import torch

NETWORKS = Registry(
    "compact detector",
    "pipeline.detection.compact",
    {
        "compact": "pipeline.detection.compact.one_stage:OneStage",
        "compact_two_stage": "pipeline.detection.compact.two_stage:TwoStage",
    },
)
SCORE = "missed_percent"
LOWEST_PX, LEAST_VISIBLE = 25.0, 0.3
"""Objects judged, as on the evaluation frames."""


def frame_source(training: DetectorTraining, cache: Path, *, validation: bool = False) -> dict[str, Any]:
    """Arguments of `sim_frames`."""
    numbers = {"count": training.frames}
    if validation:
        numbers = {"count": training.validation_frames, "first": training.frames}
    size = {"width_px": training.width_px, "height_px": training.height_px}
    return {"seed": training.seed, "cache": cache, "samples": training.rays, **numbers, **size}


def program(name: str) -> ModuleType:
    """The module that defines a network, its loss and how its output becomes candidates."""
    return sys.modules[NETWORKS.get(name).__module__]


def code(name: str) -> tuple[str, ...]:
    """Modules whose import closure the weights of a network depend on."""
    return __name__, program(name).__name__


def measure(name: str, frames: SimFrames) -> Callable[[torch.nn.Module], dict[str, float]]:
    """A function that judges a model on whole frames: average precision of each class, and what the mean misses."""
    from pipeline.detection.average_precision import evaluate, mean_average_precision
    from pipeline.detection.compact.detector import filled, to_detections
    from pipeline.detection.matching import GroundTruth
    from pipeline.scenes.labels import LABELS

    candidates = program(name).candidates
    truths = []
    for box, label, visible in zip(frames.boxes, frames.labels, frames.visible, strict=True):
        ignore = (box[:, 3] - box[:, 1] < LOWEST_PX) | (visible < LEAST_VISIBLE)
        truths.append(GroundTruth(box.astype(np.float64), label, ignore))

    def measures(model: torch.nn.Module) -> dict[str, float]:
        entries = []
        for image in frames.images:
            picture = filled(image / np.float32(255)).to(next(model.parameters()).device)
            raw = tuple(values.cpu() for values in candidates(model, picture, 0.01))
            entries.append(to_detections(raw, image.shape, iou_threshold=0.5, max_detections=300))
        results = evaluate(entries, truths, LABELS)
        values = {f"ap_{label}_percent": 100 * result.average_precision for label, result in results.items()}
        mean = mean_average_precision(results.values())
        known = {key: value for key, value in values.items() if np.isfinite(value)}
        return {**known, SCORE: 100 * (1 - mean) if np.isfinite(mean) else 100.0}

    return measures


def train(name: str, training: DetectorTraining, run_options: RunOptions) -> Trained:
    """Train a detector, or go on from where an interrupted run stopped.

    Args:
        name: ``"compact"`` or ``"compact_two_stage"``.
        training: all that the result depends on.
        run_options: how it runs.

    Returns:
        the network that validated best, and its learning curve.
    """
    import torch

    from pipeline.learning.initial import initialise

    model = NETWORKS.create(name, half_precision=training.half_precision)
    initialise(model, training.seed, f"detector {name}")
    model.set_prior()
    # All frames first, with all the workers there are; the producers then only read them.
    sim_frames(**frame_source(training, run_options.cache), executor=run_options.executor)
    held_back = sim_frames(**frame_source(training, run_options.cache, validation=True), executor=run_options.executor)
    trained = fitting.fit(
        model.to(memory_format=torch.channels_last),
        program(name).loss,
        CropMaker(training.recipe, training.seed, frame_source(training, run_options.cache)),
        training,
        run_options,
        name=f"detector-{name}",
        code=code(name),
        validate=measure(name, held_back),
        score=SCORE,
    )
    model.half_precision = False
    return trained


def save(path: Path, name: str, trained: Trained, training: DetectorTraining, *, released: bool = False) -> None:
    """Write the weight file of a training: weights, settings and measures."""
    fitting.save(path, trained, training, architecture=program(name).ARCHITECTURE, code=code(name), released=released)
