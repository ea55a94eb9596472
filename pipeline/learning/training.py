"""A whole training: banks of pictures and kernels, samples made ahead, the loop, validation on unseen pictures.

Networks differ in three functions: how a chunk of samples becomes arrays (run where samples are made), the loss, and
the measures on held-out samples.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.learning.feed import Arrays, Feed
from pipeline.learning.samples import Chunk, Recipe, Samples
from pipeline.learning.trainer import Loss, Schedule, Trained, train

if TYPE_CHECKING:
    import torch

Transform = Callable[[Chunk], Arrays]
Measures = Callable[["torch.nn.Module"], dict[str, float]]


@dataclass(frozen=True)
class Training:
    """Everything that the result of a training depends on, beside the code.

    Attributes:
        schedule: of the optimiser.
        recipe: of the samples.
        images, validation_images: pictures in the banks.
        kernels: kernels in the bank; validation has a sixteenth of them, at least one block.
        fresh, uses, window: see `pipeline.learning.feed`; a batch has fresh * uses chunks.
        validation_chunks: chunks that weights are selected on, of pictures and kernels never trained on.
        half_precision: convolutions in bfloat16 while training.
        seed: of everything.
    """

    schedule: Schedule
    recipe: Recipe = field(default_factory=Recipe)
    images: int = 2400
    validation_images: int = 160
    kernels: int = 12_000
    fresh: int = 1
    uses: int = 2
    window: int = 256
    validation_chunks: int = 40
    half_precision: bool = True
    seed: int = 1

    @classmethod
    def from_section(cls, section: Any, seed: int) -> Training:
        """From a section ``train.mtf.<network>`` of the configuration."""
        content: dict[str, Any] = section.model_dump()
        schedule, recipe = content.pop("schedule"), content.pop("recipe")
        schedule["betas"] = tuple(schedule["betas"])
        recipe["intrinsic_px"] = tuple(recipe["intrinsic_px"])
        return cls(Schedule(**schedule), Recipe(**recipe), seed=seed, **content)


def open_samples(training: Training, cache: Path, *, validation: bool = False, **executor: Any) -> Samples:
    """The sampler with its banks, which are made and kept in the cache if they are not there.

    Args:
        training: which banks.
        cache: folder outside of any stage's outputs.
        validation: the held-out pictures, kernels and draws.
        executor: arguments of `pipeline.executor.run_map`.
    """
    from pipeline.learning import images, kernels

    word = "validation" if validation else "training"
    pictures = training.validation_images if validation else training.images
    blurs = max(training.kernels // 16, kernels.BLOCK) if validation else training.kernels
    seed = training.seed
    tiles = images.bank(pictures, seed, purpose=f"{word} image", folder=cache / "images", executor=executor)
    bank = kernels.bank(blurs, seed, purpose=f"{word} kernels", folder=cache / "kernels", executor=executor)
    return Samples(tiles, bank, training.recipe, seed, f"{word} samples")


@dataclass
class Maker:
    """Chunk number -> arrays. Opens its banks on first use, in whichever process that is."""

    training: Training
    cache: Path
    transform: Transform
    validation: bool = False
    _samples: Samples | None = None

    def __call__(self, number: int) -> Arrays:
        """The arrays of one chunk."""
        if self._samples is None:
            self._samples = open_samples(self.training, self.cache, validation=self.validation)
        return self.transform(self._samples.chunk(number))


def held_out(training: Training, cache: Path, transform: Transform) -> dict[str, torch.Tensor]:
    """All validation samples, as tensors by name."""
    import torch

    make = Maker(training, cache, transform, validation=True)
    made = [make(number) for number in range(training.validation_chunks)]
    return {name: torch.from_numpy(np.concatenate([one[name] for one in made])) for name in made[0]}


def fingerprint(training: Training, code: Sequence[str]) -> str:
    """What a training depends on, hashed: its settings, this package's source and that of more modules.

    Args:
        training: settings.
        code: names of modules beside `pipeline.learning`.
    """
    import importlib

    text = hashlib.blake2b(json.dumps(asdict(training), sort_keys=True).encode(), digest_size=8)
    paths = sorted(Path(__file__).parent.glob("*.py"))
    for path in [*paths, *(Path(str(importlib.import_module(name).__file__)) for name in code)]:
        text.update(path.read_bytes())
    return text.hexdigest()


def fit(
    model: torch.nn.Module,
    training: Training,
    transform: Transform,
    loss: Loss,
    measure: Callable[[torch.nn.Module, Mapping[str, torch.Tensor]], dict[str, float]],
    *,
    cache: Path,
    folder: Path | None,
    score: str,
    producers: int = 1,
    executor: Mapping[str, Any] | None = None,
    report: Callable[[dict[str, float]], None] | None = None,
    stop_after: int | None = None,
) -> Trained:
    """Train a network from its initial weights, or from where an interrupted run stopped.

    Args:
        model: initialised (`pipeline.learning.initial`).
        training: settings.
        transform: chunk -> arrays; a function of a module.
        loss: see `trainer.train`.
        measure: (model, held-out tensors) -> measures.
        cache: folder of the banks.
        folder: of the checkpoint; None keeps none.
        score: measure that selects weights.
        producers: processes that make samples ahead; 0 makes them here. Does not change the result.
        executor: of `pipeline.executor.run_map`, for the banks.
        report: called with every new row of the learning curve.
        stop_after: see `trainer.train`.
    """
    import torch

    from pipeline.executor import one_thread

    one_thread()
    # Banks first, with all the workers there are; the producers then only read them.
    open_samples(training, cache, **(executor or {}))
    data = held_out(training, cache, transform)
    model = model.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    maker = Maker(training, cache, transform)
    repetition = {"fresh": training.fresh, "uses": training.uses, "window": training.window}
    with Feed(maker, training.seed, producers=producers, **repetition) as feed:
        return train(
            model,
            loss,
            feed,
            training.schedule,
            folder=folder,
            validate=lambda network: measure(network, data),
            score=score,
            report=report,
            stop_after=stop_after,
        )


def final_measures(trained: Trained) -> dict[str, float]:
    """The row of the learning curve at which the weights were taken: its measures by name."""
    rows = [row for row in trained.curve if row["step"] == trained.best_step]
    return dict(rows[-1]) if rows else {}
