"""Training the pixel network: what it is fed, what it minimises, how it is validated."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.blur.spectral_training import COVERAGE, SCORE, SIGMA_WEIGHT
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


def loss(model: torch.nn.Module, batch: Mapping[str, torch.Tensor]) -> tuple[torch.Tensor, dict[str, float]]:
    """Likelihood of MTF and noise; every second patch of the batch is seen mirrored, which changes neither."""
    import torch

    from pipeline.blur.spectral_net import laplace_loss

    patches = batch["patches_dn"].float()
    other = torch.arange(len(patches), device=patches.device) % 2 == 1
    patches = torch.where(other[:, None, None], patches.flip(2), patches)
    mtf, scale, sigma_dn, sigma_scale = model(patches)
    value = laplace_loss(mtf, scale, batch["mtf"])
    value = value + SIGMA_WEIGHT * laplace_loss(sigma_dn, sigma_scale, batch["sigma_dn"])
    measures = {
        "mtf_error_percent": 100 * float((mtf - batch["mtf"]).detach().abs().mean()),
        "sigma_error_dn": float((sigma_dn - batch["sigma_dn"]).detach().abs().mean()),
    }
    return value, measures


def measure(model: torch.nn.Module, data: Mapping[str, torch.Tensor]) -> dict[str, float]:
    """Mean absolute errors on held-out samples, and how wide intervals must be: see `spectral_training.measure`."""
    import torch

    results = [model(patches) for patches in data["patches_dn"].split(256)]
    mtf, scale, sigma_dn, _ = (torch.cat(parts) for parts in zip(*results, strict=True))
    error = (mtf - data["mtf"]).abs()
    clean = data["sigma_dn"] == 0
    return {
        "mtf_error_percent": 100 * float(error.mean()),
        "mtf_error_clean_percent": 100 * float(error[clean].mean()),
        "mtf_error_noisy_percent": 100 * float(error[~clean].mean()),
        "sigma_error_dn": float((sigma_dn - data["sigma_dn"]).abs().mean()),
        "interval": float(torch.quantile((error / scale).flatten(), COVERAGE)),
    }


def train(training: Training, run_options: RunOptions) -> Trained:
    """Train the pixel network.

    Args:
        training: all that the result depends on.
        run_options: how it runs.

    Returns:
        the network that validated best, and its learning curve.
    """
    from pipeline.blur.pixel_net import PixelNet
    from pipeline.learning.initial import initialise
    from pipeline.learning.training import train_on_samples

    model = PixelNet(training.half_precision)
    initialise(model, training.seed, "pixel network")
    trained = train_on_samples(
        model, training, run_options, chunk_arrays, loss, measure, name="mtf-pixels", code=__name__, score=SCORE
    )
    model.half_precision = False
    return trained


def save(path: Path, trained: Trained, training: Training, *, released: bool = False) -> None:
    """Write the weight file of a training: weights, settings, measures and the interval's factor."""
    from pipeline.blur.pixel_net import ARCHITECTURE
    from pipeline.learning import fitting

    interval = fitting.final_measures(trained)["validation_interval"]
    fitting.save(
        path, trained, training, architecture=ARCHITECTURE, code=__name__, released=released, interval=interval
    )
