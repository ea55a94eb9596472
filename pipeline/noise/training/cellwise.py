"""What the training of the cell-wise noise network consists of, beside what both noise networks share.

Arrays of its samples are ``sigma_dn`` (N,), ``statistics`` (N, C, h, w) in half precision, ``base_dn`` and ``map_dn``
(N, h, w). See `pipeline.noise.training.sensor_noise`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch

from pipeline.learning.initial import initialise
from pipeline.noise.networks import cellwise_net
from pipeline.noise.networks.cellwise_features import features
from pipeline.noise.training.samples import Chunk
from pipeline.noise.training.sensor_noise import Program


def network(seed: int) -> torch.nn.Module:
    """The network with initial weights."""
    model = cellwise_net.CellwiseNet()
    initialise(model, seed, "cell-wise noise network")
    return model


def arrays(chunk: Chunk) -> dict[str, np.ndarray]:
    """Statistics of cells and the true noise of a chunk."""
    with torch.no_grad():
        pieces = [features(part) for part in torch.from_numpy(chunk.patches_dn).float().split(8)]
    statistics, base = (torch.cat(parts) for parts in zip(*pieces, strict=True))
    return {
        "statistics": statistics.half().numpy(),
        "base_dn": base.numpy(),
        "map_dn": chunk.map_dn,
        "sigma_dn": chunk.sigma_dn,
    }


def loss(model: torch.nn.Module, batch: Mapping[str, torch.Tensor]) -> tuple[torch.Tensor, dict[str, float]]:
    """See `pipeline.noise.networks.cellwise_net.loss`."""
    sigma, scale, cells = model(batch["statistics"].float(), batch["base_dn"])
    value = cellwise_net.loss(sigma, scale, cells, batch["sigma_dn"], batch["map_dn"])
    return value, {"sigma_error_dn": float((sigma - batch["sigma_dn"]).detach().abs().mean())}


def answers(model: torch.nn.Module, data: Mapping[str, torch.Tensor]) -> tuple[torch.Tensor, torch.Tensor | None]:
    """Sigma of held-out samples and the scale of its likelihood, (N,) each."""
    pieces = zip(data["statistics"].split(64), data["base_dn"].split(64), strict=True)
    estimates = [model(statistics.float(), base)[:2] for statistics, base in pieces]
    sigma, scale = (torch.cat(parts) for parts in zip(*estimates, strict=True))
    return sigma, scale


PROGRAM = Program(__name__, cellwise_net.ARCHITECTURE, network, arrays, loss, answers)
