"""Training the paper's network: mean squared error, Adam, one direction per sample, no noise.

As the authors' program does (batch 32, learning rate 1e-4, no schedule), but on our procedural pictures and kernels,
which are blurred inside the frame and labelled with the total MTF.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.learning.run_options import RunOptions
from pipeline.learning.samples import Chunk
from pipeline.learning.settings import Training
from pipeline.learning.trainer import Trained

if TYPE_CHECKING:
    import numpy as np
    import torch

SCORE = "mtf_error_percent"


def patch_arrays(chunk: Chunk) -> dict[str, np.ndarray]:
    """Patches (uint8) and their MTF, as they are."""
    return {"patches_dn": chunk.patches_dn, "mtf": chunk.mtf}


class Loss:
    """Mean squared error of the MTF along x of patches, and of patches turned clockwise against that along y.

    Args:
        half_precision: compute in bfloat16.
    """

    def __init__(self, half_precision: bool) -> None:
        self.half_precision = half_precision

    def __call__(
        self, model: torch.nn.Module, batch: Mapping[str, torch.Tensor]
    ) -> tuple[torch.Tensor, dict[str, torch.Tensor]]:
        """Loss to minimise, and measures to record; every second patch of the batch is turned."""
        import torch

        patches, truth = batch["patches_dn"].float() / 255, batch["mtf"][:, 0].clone()
        patches[1::2] = torch.rot90(patches[1::2], -1, (1, 2))
        truth[1::2] = batch["mtf"][1::2, 1]
        with torch.autocast(patches.device.type, torch.bfloat16, enabled=self.half_precision):
            result = model(patches)
        result = result.float()
        value = (result - truth).square().mean()
        return value, {"mtf_error_percent": 100 * (result - truth).detach().abs().mean().double()}


def measure(model: torch.nn.Module, data: Mapping[str, torch.Tensor]) -> dict[str, float]:
    """Mean absolute and mean squared error on held-out samples."""
    import torch

    result = torch.cat([model.both_directions(part.float() / 255) for part in data["patches_dn"].split(32)])  # type: ignore[operator]
    error = result - data["mtf"]
    return {"mtf_error_percent": 100 * float(error.abs().mean()), "mean_squared_error": float(error.square().mean())}


def train(training: Training, run_options: RunOptions) -> Trained:
    """Train the paper's network; arguments as for `pipeline.blur.training.spectral.train`."""
    from pipeline.blur.networks.cnn_net import MtfCnn
    from pipeline.learning.initial import initialise
    from pipeline.learning.training import train_on_samples

    model = MtfCnn()
    initialise(model, training.seed, "cnn network", rule="glorot")
    loss = Loss(training.half_precision)
    return train_on_samples(
        model, training, run_options, patch_arrays, loss, measure, name="mtf-cnn", code=__name__, score=SCORE
    )


def save(path: Path, trained: Trained, training: Training, *, released: bool = False) -> None:
    """Write the weight file of a training: weights in half precision (13.5 MB instead of 27), settings and measures."""
    from pipeline.blur.networks.cnn_net import ARCHITECTURE
    from pipeline.learning import fitting

    half = {name: value.half() for name, value in trained.model.state_dict().items()}
    fitting.save(path, trained, training, architecture=ARCHITECTURE, code=__name__, released=released, tensors=half)
