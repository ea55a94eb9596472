"""Training the compact detectors on *Sim*: frames, samples, loop, and average precision on places held back.

Validation frames are whole frames of further viewpoints of the same split; the weights with the highest mean average
precision on them (over classes, as the paper counts) are kept. No evaluation frame takes part.
"""

from __future__ import annotations

import hashlib
import importlib
import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.detection.compact.samples import CropMaker, CropRecipe
from pipeline.detection.sim_frames import SimFrames, fingerprint, sim_frames
from pipeline.learning.trainer import Schedule, Trained

if TYPE_CHECKING:
    import torch

NETWORKS = {"compact": ("one_stage", "OneStage"), "compact_two_stage": ("two_stage", "TwoStage")}
SCORE = "missed_percent"
LOWEST_PX, LEAST_VISIBLE = 25.0, 0.3
"""Objects judged, as on the evaluation frames."""


@dataclass(frozen=True)
class DetectorTraining:
    """Everything that a detector's weights depend on, beside the code.

    Attributes:
        schedule: of the optimiser.
        recipe: of the samples.
        frames, validation_frames: rendered viewpoints.
        rays: N of N x N rays a pixel of these frames.
        width_px, height_px: of these frames.
        uses, window: see `pipeline.learning.feed`.
        half_precision: convolutions in bfloat16 while training.
        seed: of everything.
    """

    schedule: Schedule
    recipe: CropRecipe = field(default_factory=CropRecipe)
    frames: int = 400
    validation_frames: int = 24
    rays: int = 2
    width_px: int = 896
    height_px: int = 768
    uses: int = 1
    window: int = 64
    half_precision: bool = True
    seed: int = 1

    @classmethod
    def from_section(cls, section: Any, seed: int) -> DetectorTraining:
        """From a section ``train.detector.<network>`` of the configuration."""
        content: dict[str, Any] = section.model_dump()
        schedule, recipe = content.pop("schedule"), content.pop("recipe")
        schedule["betas"] = tuple(schedule["betas"])
        recipe["scale"] = tuple(recipe["scale"])
        return cls(Schedule(**schedule), CropRecipe(**recipe), seed=seed, **content)

    def source(self, cache: Path, *, validation: bool = False) -> dict[str, Any]:
        """Arguments of `sim_frames`."""
        numbers = {"count": self.validation_frames, "first": self.frames} if validation else {"count": self.frames}
        size = {"width_px": self.width_px, "height_px": self.height_px}
        return {"seed": self.seed, "cache": cache, "samples": self.rays, **numbers, **size}


def training_fingerprint(training: DetectorTraining, name: str) -> str:
    """What a training depends on, hashed: settings, this folder's source, the trainer's, and the frames'."""
    from pipeline.learning import trainer

    text = hashlib.blake2b(json.dumps([name, asdict(training), fingerprint()], sort_keys=True).encode(), digest_size=8)
    for path in [*sorted(Path(__file__).parent.glob("*.py")), Path(trainer.__file__)]:
        text.update(path.read_bytes())
    return text.hexdigest()


def measure(name: str, frames: SimFrames) -> Callable[[torch.nn.Module], dict[str, float]]:
    """A function that judges a model on whole frames: average precision of each class, and what the mean misses."""
    from pipeline.detection.average_precision import evaluate, mean_average_precision
    from pipeline.detection.compact.detector import filled, judged
    from pipeline.detection.matching import Truth
    from pipeline.scenes.labels import LABELS

    candidates = importlib.import_module(f"pipeline.detection.compact.{NETWORKS[name][0]}").candidates
    truths = []
    for box, label, visible in zip(frames.boxes, frames.labels, frames.visible, strict=True):
        ignore = (box[:, 3] - box[:, 1] < LOWEST_PX) | (visible < LEAST_VISIBLE)
        truths.append(Truth(box.astype(np.float64), label, ignore))

    def measures(model: torch.nn.Module) -> dict[str, float]:
        found = []
        for image in frames.images:
            raw = candidates(model, filled(image / np.float32(255)), 0.01)
            found.append(judged(raw, image.shape, overlap=0.5, most=300))
        results = evaluate(found, truths, LABELS)
        values = {f"ap_{label}_percent": 100 * result.average_precision for label, result in results.items()}
        mean = mean_average_precision(results.values())
        known = {key: value for key, value in values.items() if np.isfinite(value)}
        return {**known, SCORE: 100 * (1 - mean) if np.isfinite(mean) else 100.0}

    return measures


def train(
    name: str,
    training: DetectorTraining,
    cache: Path,
    *,
    folder: Path | None = None,
    producers: int = 1,
    executor: Mapping[str, Any] | None = None,
    report: Callable[[dict[str, float]], None] | None = None,
    stop_after: int | None = None,
) -> Trained:
    """Train a detector, or go on from where an interrupted run stopped.

    Args:
        name: ``"compact"`` or ``"compact_two_stage"``.
        training: all that the result depends on.
        cache: folder for frames and checkpoints, outside of any stage's outputs.
        folder: of the checkpoint; None names it by the fingerprint of settings and code.
        producers: processes that make samples ahead.
        executor: of `pipeline.executor.run_map`, for rendering.
        report: called with every new row of the learning curve.
        stop_after: see `pipeline.learning.trainer.train`.

    Returns:
        the network that validated best, and its learning curve.
    """
    import torch

    from pipeline.executor import one_thread
    from pipeline.learning.feed import Feed
    from pipeline.learning.initial import initialise
    from pipeline.learning.trainer import train as run

    one_thread()
    module, network = NETWORKS[name]
    program = importlib.import_module(f"pipeline.detection.compact.{module}")
    model = getattr(program, network)(half_precision=training.half_precision)
    initialise(model, training.seed, f"detector {name}")
    model.set_prior()
    model = model.to(memory_format=torch.channels_last)
    # All frames first, with all the workers there are; the producers then only read them.
    sim_frames(**training.source(cache), executor=executor)
    held_back = sim_frames(**training.source(cache, validation=True), executor=executor)
    maker = CropMaker(training.recipe, training.seed, training.source(cache))
    repetition = {"fresh": 1, "uses": training.uses, "window": training.window}
    with Feed(maker, training.seed, producers=producers, **repetition) as feed:
        trained = run(
            model,
            program.loss,
            feed,
            training.schedule,
            folder=folder or cache / f"detector-{name}-{training_fingerprint(training, name)}",
            validate=measure(name, held_back),
            score=SCORE,
            report=report,
            stop_after=stop_after,
        )
    model.half_precision = False
    return trained


def save(path: Path, name: str, trained: Trained, training: DetectorTraining) -> None:
    """Write the weight file of a training: weights, settings and measures."""
    from pipeline.learning import weights
    from pipeline.learning.training import final_measures

    program = importlib.import_module(f"pipeline.detection.compact.{NETWORKS[name][0]}")
    weights.save(
        path,
        trained.model.state_dict(),
        program.ARCHITECTURE,
        settings=asdict(training),
        fingerprint=training_fingerprint(training, name),
        step=trained.best_step,
        measures=final_measures(trained),
    )
