"""What all trainings share: settings from the configuration, their fingerprint, feed and loop, the weight file.

A network adds a maker of samples (chunk number -> arrays), a loss, and measures on held-out samples. All arithmetic is
done by one thread, so that a result does not depend on the number of cores.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.dependencies import closure
from pipeline.learning import weights
from pipeline.learning.chunk_loader import ChunkLoader, Maker
from pipeline.learning.run_options import RunOptions
from pipeline.learning.settings import LoopSettings
from pipeline.learning.trainer import Loss, Trained, train

if TYPE_CHECKING:
    import torch

Code = str | tuple[str, ...]
Measures = Callable[["torch.nn.Module"], dict[str, float]]


def fingerprint(settings: LoopSettings, code: Code) -> str:
    """Hash of what a training depends on: its settings and the source of its code.

    Args:
        settings: of the training.
        code: dotted name of the module that trains, or several; their import closure is hashed
            (`pipeline.dependencies.closure`).
    """
    return closure.fingerprint(code, asdict(settings))


def held_out(make: Maker, chunks: int, device: str = "cpu") -> dict[str, torch.Tensor]:
    """Samples to validate on: chunks 0 .. `chunks` - 1 of a maker, as tensors by name on a device."""
    import torch

    from pipeline.executor import one_thread

    one_thread()
    made = [make(number) for number in range(chunks)]
    return {name: torch.from_numpy(np.concatenate([item[name] for item in made])).to(device) for name in made[0]}


def fit(
    model: torch.nn.Module,
    loss: Loss,
    make: Maker,
    settings: LoopSettings,
    run_options: RunOptions,
    *,
    name: str,
    code: Code,
    validate: Measures,
    score: str,
    recordable: bool = False,
) -> Trained:
    """Train a network from its initial weights, or from where an interrupted run stopped.

    Args:
        model: initialised (`pipeline.learning.initial`).
        loss: see `pipeline.learning.trainer.train`.
        make: chunk number -> arrays; see `pipeline.learning.chunk_loader`.
        settings: all that the result depends on.
        run_options: how it runs.
        name: of what is trained, e.g. ``"mtf-spectral"``; with the fingerprint it names the checkpoint's folder.
        code: see `fingerprint`.
        validate: model -> measures.
        score: measure that selects weights (smallest).
        recordable: see `pipeline.learning.trainer.train`.

    Returns:
        the network that validated best, and its learning curve.
    """
    from pipeline.executor import one_thread

    one_thread()
    repetition = {
        "new_chunks_per_step": settings.new_chunks_per_step,
        "replays": settings.replays,
        "replay_window": settings.replay_window,
    }
    with ChunkLoader(make, settings.seed, producers=run_options.producers, **repetition) as loader:
        return train(
            model,
            loss,
            loader,
            settings.schedule,
            folder=run_options.folder or run_options.cache / f"{name}-{fingerprint(settings, code)}",
            validate=validate,
            score=score,
            device=run_options.device,
            recordable=recordable,
            report=run_options.report,
            stop_after=run_options.stop_after,
        )


def final_measures(trained: Trained) -> dict[str, float]:
    """The row of the learning curve at which the weights were taken: its measures by name."""
    rows = [row for row in trained.curve if row["step"] == trained.best_step]
    return dict(rows[-1]) if rows else {}


def save(
    path: Path,
    trained: Trained,
    settings: LoopSettings,
    *,
    architecture: str,
    code: Code,
    released: bool = False,
    tensors: Mapping[str, torch.Tensor] | None = None,
    **details: Any,
) -> None:
    """Write the weight file of a training: weights, settings, fingerprint, step and measures.

    Args:
        path: ``.safetensors``.
        trained: what `fit` returned.
        settings: of the training.
        architecture: name and version; see `pipeline.learning.weights.save`.
        code: see `fingerprint`.
        released: whether these weights are for use, as those of the profile default are; others are announced
            wherever they are loaded (`pipeline.learning.weights.into`).
        tensors: in place of the network's weights as they are.
        details: further entries of its header, or replacements.
    """
    header = {
        "settings": asdict(settings),
        "fingerprint": fingerprint(settings, code),
        "released": released,
        "step": trained.best_step,
        "measures": final_measures(trained),
    }
    if trained.device != "cpu":
        header["device"] = trained.device
    weights.save(path, trained.model.state_dict() if tensors is None else tensors, architecture, **header | details)
