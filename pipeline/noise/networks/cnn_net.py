"""The paper's noise network: every pixel's sigma from its surroundings (Tan et al. 2019, as in Wischow et al. 2023).

Three times a convolution to 64 channels and a residual block of four more (``x + block(x)``, nothing after the sum),
then one convolution to a single channel; all 3 x 3, zero-padded, with ReLU, without normalisation: 519 361 parameters,
about 17 GFLOP for 128 x 128 px. Input and output are in [0, 1]; grey images enter as three equal channels.
"""

from __future__ import annotations

import torch
import torch.nn.functional as functional
from torch import nn

ARCHITECTURE = "sigma-cnn-1"
WIDTH = 64
STAGES = 3
BLOCK_LAYERS = 4
MEAN_WEIGHT = 0.75


class PixelNet(nn.Module):
    """See the module."""

    def __init__(self) -> None:
        super().__init__()
        self.enter = nn.ModuleList(
            nn.Conv2d(3 if stage == 0 else WIDTH, WIDTH, 3, padding=1) for stage in range(STAGES)
        )
        self.blocks = nn.ModuleList(nn.Sequential(*_layers()) for _ in range(STAGES))
        self.leave = nn.Conv2d(WIDTH, 1, 3, padding=1)

    def forward(self, image: torch.Tensor) -> torch.Tensor:
        """Sigma of every pixel: (N, H, W) from (N, 1, H, W), both in units of white = 1."""
        x = image.expand(-1, 3, -1, -1)
        for enter, block in zip(self.enter, self.blocks, strict=True):
            x = functional.relu(enter(x))
            x = x + block(x)
        return functional.relu(self.leave(x))[:, 0]


def _layers() -> list[nn.Module]:
    """Convolutions of a residual block, each with its ReLU."""
    return [layer for _ in range(BLOCK_LAYERS) for layer in (nn.Conv2d(WIDTH, WIDTH, 3, padding=1), nn.ReLU())]


def loss(predicted: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """The paper's loss, averaged over the batch.

        0.25 sum_pixels (y - s)^2  +  0.75 (mean_pixels y - s)^2

    Args:
        predicted: (N, H, W) y.
        truth: (N,) s, white = 1.
    """
    error = predicted - truth[:, None, None]
    whole = error.mean((1, 2)).square()
    return ((1 - MEAN_WEIGHT) * error.square().sum((1, 2)) + MEAN_WEIGHT * whole).mean()
