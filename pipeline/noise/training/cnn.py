"""What the training of the paper's noise network consists of, beside what both noise networks share.

Arrays of its samples are ``sigma_dn`` (N,) and ``image`` (N, 1, S, S) uint8. See
`pipeline.noise.training.sensor_noise`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch

from pipeline.learning.initial import initialise
from pipeline.noise.networks import cnn_net
from pipeline.noise.training.samples import Chunk
from pipeline.noise.training.sensor_noise import Program


def network(seed: int) -> torch.nn.Module:
    """The network with initial weights, drawn by Keras' rule as the paper's are."""
    model = cnn_net.PixelNet()
    initialise(model, seed, "pixel noise network", "glorot")
    return model


def arrays(chunk: Chunk) -> dict[str, np.ndarray]:
    """Patches and their sigma, as they are."""
    return {"image": chunk.patches_dn[:, None], "sigma_dn": chunk.sigma_dn}


def loss(model: torch.nn.Module, batch: Mapping[str, torch.Tensor]) -> tuple[torch.Tensor, dict[str, torch.Tensor]]:
    """See `pipeline.noise.networks.cnn_net.loss`."""
    estimate = model(batch["image"].float() / 255)
    truth = batch["sigma_dn"] / 255
    error = 255 * (estimate.detach().flatten(1).median(1).values - truth).abs().mean()
    return cnn_net.loss(estimate, truth), {"sigma_error_dn": error}


def answers(model: torch.nn.Module, data: Mapping[str, torch.Tensor]) -> tuple[torch.Tensor, torch.Tensor | None]:
    """Sigma of held-out samples, (N,): the median over pixels; the network has no scale."""
    maps = [model(image.float() / 255) for image in data["image"].split(16)]
    return 255 * torch.cat(maps).flatten(1).median(1).values, None


PROGRAM = Program(__name__, cnn_net.ARCHITECTURE, network, arrays, loss, answers, recordable=True)
