"""Training the noise networks: what they are fed, what they minimise, how they are validated.

Pictures are procedural only (`pipeline.learning.images`), noise is drawn anew for every sample (`samples`). The
cell-wise network gets the fixed statistics of whole patches; the paper's gets 48 px crops, a seventh
of its 17 GFLOP a patch.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pipeline.learning import fitting
from pipeline.learning.picture_maker import PictureMaker
from pipeline.learning.run_options import RunOptions
from pipeline.learning.trainer import Trained
from pipeline.noise.settings import SigmaTraining
from pipeline.noise.training import samples
from pipeline.registry import Registry

if TYPE_CHECKING:
    import torch

    from pipeline.learning.trainer import Loss

COVERAGE = 0.95
SPREAD_LEVELS_DN = (0.0, 0.5, 2.0, 5.0, 10.0, 20.0, 60.0)
"""Ends of the ranges of true sigma over which validation reports the error."""
PROGRAMS = Registry(
    "trained noise network",
    "pipeline.noise.training.sensor_noise",
    {"cellwise": "pipeline.noise.training.cellwise:PROGRAM", "cnn": "pipeline.noise.training.cnn:PROGRAM"},
)


@dataclass(frozen=True)
class Program:
    """What differs between the networks.

    Attributes:
        module: dotted name of the module that defines it; its import closure enters the training's fingerprint.
        architecture: name and version in the header of the weight file.
        network: seed -> the network with initial weights.
        arrays: samples -> arrays by name; run where samples are made.
        loss: see `pipeline.learning.trainer.train`.
        answers: (network, held-out tensors) -> sigma and, where the network has one, its scale; DN.
        recordable: whether the loss is; see `pipeline.learning.trainer.train`.
    """

    module: str
    architecture: str
    network: Callable[[int], torch.nn.Module]
    arrays: Callable[[samples.Chunk], dict[str, np.ndarray]]
    loss: Loss
    answers: Callable[[torch.nn.Module, Mapping[str, torch.Tensor]], tuple[torch.Tensor, torch.Tensor | None]]
    recordable: bool = False


class Maker(PictureMaker[SigmaTraining]):
    """Makes chunks of samples with white noise: ``sigma_dn`` (N,) and the arrays of the network's program."""

    def __call__(self, number: int) -> dict[str, np.ndarray]:
        """Chunk `number`."""
        settings = self.settings
        purpose = f"{self.part} noise {settings.kind}"
        program: Program = PROGRAMS.get(settings.kind)
        return program.arrays(samples.chunk(self.tiles, settings.recipe, settings.seed, purpose, number))


def validation(
    settings: SigmaTraining, cache: Path, device: str = "cpu"
) -> Callable[[torch.nn.Module], dict[str, float]]:
    """Measures of a network on samples held out: errors over all and by true sigma, and what interval holds 95 %.

    ``interval`` is the factor k for which t +- k b holds ln(1 + sigma) in 95 % of the patches (cell-wise only);
    ``score_dn`` is what weights are selected by, the mean of |s - s'| / (1 + s' / 10).
    """
    import torch

    data = fitting.held_out(Maker(settings, cache, validation=True), settings.validation_chunks, device)
    truth = data["sigma_dn"]
    program: Program = PROGRAMS.get(settings.kind)

    def measure(model: torch.nn.Module) -> dict[str, float]:
        with torch.no_grad():
            sigma, scale = program.answers(model, data)
        error = (sigma - truth).abs()
        results = {"score_dn": float((error / (1 + truth / 10)).mean()), "sigma_error_dn": float(error.mean())}
        clean = truth == 0
        if clean.any():
            results["clean_sigma_dn"] = float(sigma[clean].mean())
        for low, high in pairwise(SPREAD_LEVELS_DN):
            inside = (truth > low) & (truth <= high)
            if inside.any():
                results[f"sigma_error_to_{high:g}_dn"] = float(error[inside].mean())
        if scale is not None:
            miss = (torch.log1p(sigma) - torch.log1p(truth)).abs() / scale
            results["interval"] = float(torch.quantile(miss, COVERAGE))
        return results

    return measure


def train(settings: SigmaTraining, run_options: RunOptions) -> Trained:
    """Train a noise network, or go on training it.

    Args:
        settings: all that the result depends on.
        run_options: how it runs.

    Returns:
        the network that validated best, and its learning curve.
    """
    cache, kind = run_options.cache, settings.kind
    program: Program = PROGRAMS.get(kind)
    for held_out in (False, True):
        Maker(settings, cache, held_out).bank(run_options.executor)
    return fitting.fit(
        program.network(settings.seed),
        program.loss,
        Maker(settings, cache),
        settings,
        run_options,
        name=f"sigma-{kind}",
        code=program.module,
        validate=validation(settings, cache, run_options.device),
        score="score_dn",
        recordable=program.recordable,
    )


def save(path: Path, trained: Trained, settings: SigmaTraining, *, released: bool = False) -> None:
    """Write the weight file of a training: weights, settings, measures, and for intervals their factor.

    Args:
        path: ``.safetensors``.
        trained: what `train` returned.
        settings: its settings.
        released: see `pipeline.learning.fitting.save`.
    """
    program: Program = PROGRAMS.get(settings.kind)
    measures = {name: float(f"{value:.6g}") for name, value in fitting.final_measures(trained).items()}
    fitting.save(
        path,
        trained,
        settings,
        architecture=program.architecture,
        code=program.module,
        released=released,
        measures=measures,
        interval=measures.get("validation_interval"),
    )
