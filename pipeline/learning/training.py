"""A training on labelled samples: banks of pictures and kernels, samples made ahead, validation on unseen pictures.

Networks differ in three functions: how a chunk of samples becomes arrays (run where samples are made), the loss, and
the measures on held-out samples.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.learning.chunk_loader import Arrays
from pipeline.learning.fitting import fit, held_out
from pipeline.learning.run_options import RunOptions
from pipeline.learning.samples import Chunk, Samples
from pipeline.learning.settings import Training
from pipeline.learning.trainer import Loss, Trained

if TYPE_CHECKING:
    import torch

Transform = Callable[[Chunk], Arrays]


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
    bank = kernels.bank(
        blurs,
        seed,
        purpose=f"{word} kernels",
        distribution=training.kernel_distribution,
        folder=cache / "kernels",
        executor=executor,
    )
    return Samples(tiles, bank, training.recipe, seed, f"{word} samples")


@dataclass
class Maker:
    """Training samples: chunk number -> arrays. Opens its banks on first use, in whichever process that is."""

    training: Training
    cache: Path
    transform: Transform
    _samples: Samples | None = None

    def __call__(self, number: int) -> Arrays:
        """The arrays of one chunk."""
        if self._samples is None:
            self._samples = open_samples(self.training, self.cache)
        return self.transform(self._samples.chunk(number))


def validation_samples(training: Training, run_options: RunOptions, transform: Transform) -> dict[str, torch.Tensor]:
    """All validation samples, as tensors by name; makes their banks."""
    opened = open_samples(training, run_options.cache, validation=True, **run_options.executor)
    return held_out(lambda number: transform(opened.chunk(number)), training.validation_chunks, run_options.device)


def train_on_samples(
    model: torch.nn.Module,
    training: Training,
    run_options: RunOptions,
    transform: Transform,
    loss: Loss,
    measure: Callable[[torch.nn.Module, Mapping[str, torch.Tensor]], dict[str, float]],
    *,
    name: str,
    code: str,
    score: str,
) -> Trained:
    """Train a network on samples of banks that are made first; all else as for `pipeline.learning.fitting.fit`.

    Args:
        model: initialised; its convolutions are laid out channels last.
        training: settings.
        run_options: how it runs.
        transform: chunk -> arrays; a function of a module.
        loss: see `pipeline.learning.trainer.train`; one that a GPU can record.
        measure: (model, held-out tensors) -> measures.
        name: of what is trained.
        code: dotted name of the module that defines transform and loss; its import closure enters the fingerprint.
        score: measure that selects weights.
    """
    import torch

    # Banks first, with all the workers there are; the producers then only read them.
    open_samples(training, run_options.cache, **run_options.executor)
    data = validation_samples(training, run_options, transform)
    return fit(
        model.to(memory_format=torch.channels_last),  # type: ignore[call-overload]
        loss,
        Maker(training, run_options.cache, transform),
        training,
        run_options,
        name=name,
        code=code,
        validate=lambda network: measure(network, data),
        score=score,
        recordable=True,
    )
