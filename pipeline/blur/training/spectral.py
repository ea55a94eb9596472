"""Training the spectral network: what it is fed, what it minimises, how it is validated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.blur.networks.spectral_features import BLOCK_PX
from pipeline.blur.training import mtf_likelihood
from pipeline.learning.run_options import RunOptions
from pipeline.learning.samples import Chunk
from pipeline.learning.settings import Training
from pipeline.learning.trainer import Trained

if TYPE_CHECKING:
    import numpy as np
    import torch


@dataclass(frozen=True)
class Form:
    """Of the network and of its features; the released one has these values.

    Attributes:
        width: factor on the numbers of channels and of hidden units (`SpectralNet`).
        block_px: side of the blocks of the features (`features`).
    """

    width: float = 1.0
    block_px: int = BLOCK_PX

    @property
    def suffix(self) -> str:
        """Of the checkpoint's name; empty for the released form."""
        return "" if self == Form() else f"-{self.width:g}-{self.block_px}"


def feature_arrays(chunk: Chunk, block_px: int = BLOCK_PX) -> dict[str, np.ndarray]:
    """Features and truth of a chunk: maps, vector (float16), mtf, sigma_dn (float32)."""
    import torch

    from pipeline.blur.networks.spectral_features import features

    maps, vector = features(torch.from_numpy(chunk.patches_dn).float(), block_px)
    return {
        "maps": maps.half().numpy(),
        "vector": vector.half().numpy(),
        "mtf": chunk.mtf,
        "sigma_dn": chunk.sigma_dn,
    }


def loss(model: torch.nn.Module, batch: Mapping[str, torch.Tensor]) -> tuple[torch.Tensor, dict[str, torch.Tensor]]:
    """Likelihood of MTF and noise.

    Every second sample of the batch is seen mirrored; chunks are of even size, so it is the same ones each time.
    """
    from pipeline.blur.networks.spectral_features import mirrored

    maps = batch["maps"].float()
    maps[1::2] = mirrored(maps[1::2])
    return mtf_likelihood.loss(model(maps, batch["vector"].float()), batch)


def measure(model: torch.nn.Module, data: Mapping[str, torch.Tensor]) -> dict[str, float]:
    """Measures on held-out samples (`pipeline.blur.training.mtf_likelihood.measures`)."""
    pieces = zip(data["maps"].split(256), data["vector"].split(256), strict=True)
    return mtf_likelihood.measures([model(maps.float(), vector.float()) for maps, vector in pieces], data)


def train(training: Training, run_options: RunOptions, form: Form | None = None) -> Trained:
    """Train the spectral network.

    Args:
        training: all that the result depends on.
        run_options: how it runs.
        form: of the network; without it, that of the released one.

    Returns:
        the network that validated best, and its learning curve.
    """
    from pipeline.blur.networks.spectral_net import SpectralNet
    from pipeline.learning.initial import initialise
    from pipeline.learning.training import train_on_samples

    form = form or Form()
    model = SpectralNet(training.half_precision, form.width, form.block_px)
    initialise(model, training.seed, "spectral network")
    trained = train_on_samples(
        model, training, run_options, partial(feature_arrays, block_px=form.block_px), loss, measure,
        name=f"mtf-spectral{form.suffix}", code=__name__, score=mtf_likelihood.SCORE,
    )  # fmt: skip
    model.half_precision = False
    return trained


def save(path: Path, trained: Trained, training: Training, *, released: bool = False) -> None:
    """Write the weight file of a training: weights, settings, measures and the interval's factor."""
    from pipeline.blur.networks.spectral_net import ARCHITECTURE

    mtf_likelihood.save(path, trained, training, ARCHITECTURE, __name__, released=released)
