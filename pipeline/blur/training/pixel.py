"""Training the pixel network: what it is fed, what it minimises, how it is validated."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.blur.training import mtf_likelihood
from pipeline.learning.run_options import RunOptions
from pipeline.learning.samples import Chunk
from pipeline.learning.settings import Training
from pipeline.learning.trainer import Trained

if TYPE_CHECKING:
    import numpy as np
    import torch


def chunk_arrays(chunk: Chunk) -> dict[str, np.ndarray]:
    """Patches and truth of a chunk: patches_dn (uint8), mtf, sigma_dn (float32)."""
    return {"patches_dn": chunk.patches_dn, "mtf": chunk.mtf, "sigma_dn": chunk.sigma_dn}


def loss(model: torch.nn.Module, batch: Mapping[str, torch.Tensor]) -> tuple[torch.Tensor, dict[str, torch.Tensor]]:
    """Likelihood of MTF and noise; every second patch of the batch is seen mirrored, which changes neither."""
    import torch

    patches = batch["patches_dn"].float()
    other = torch.arange(len(patches), device=patches.device) % 2 == 1
    patches = torch.where(other[:, None, None], patches.flip(2), patches)
    return mtf_likelihood.loss(model(patches), batch)


def measure(model: torch.nn.Module, data: Mapping[str, torch.Tensor]) -> dict[str, float]:
    """Measures on held-out samples (`pipeline.blur.training.mtf_likelihood.measures`)."""
    return mtf_likelihood.measures([model(patches) for patches in data["patches_dn"].split(256)], data)


def train(training: Training, run_options: RunOptions) -> Trained:
    """Train the pixel network.

    Args:
        training: all that the result depends on.
        run_options: how it runs.

    Returns:
        the network that validated best, and its learning curve.
    """
    from pipeline.blur.networks.pixel_net import PixelNet
    from pipeline.learning.initial import initialise
    from pipeline.learning.training import train_on_samples

    model = PixelNet(training.half_precision)
    initialise(model, training.seed, "pixel network")
    trained = train_on_samples(
        model, training, run_options, chunk_arrays, loss, measure,
        name="mtf-pixels", code=__name__, score=mtf_likelihood.SCORE,
    )  # fmt: skip
    model.half_precision = False
    return trained


def save(path: Path, trained: Trained, training: Training, *, released: bool = False) -> None:
    """Write the weight file of a training: weights, settings, measures and the interval's factor."""
    from pipeline.blur.networks.pixel_net import ARCHITECTURE

    mtf_likelihood.save(path, trained, training, ARCHITECTURE, __name__, released=released)
