"""The spectral network: maps and profiles of log power to the MTF with its uncertainty, both directions at once.

Three convolutional stages on the maps (width 24, 40, 56; the last two halve the size), a 1 x 1 reduction to 32
channels, then together with the profiles two hidden layers of 256 and 34 outputs: 16 MTF values (sigmoid), 16 scales of
their Laplace distribution, noise sigma and its scale. 1.35 million parameters.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
import torch.nn.functional as functional
from torch import nn

from pipeline.blur.networks.spectral_features import BLOCK_PX, MAPS, VECTOR_LENGTH

ARCHITECTURE = "mtf-spectral-1"
FREQUENCIES = 8
VALUES = 4 * FREQUENCIES + 2
WIDTHS = (24, 40, 56)
REDUCED = 32
HIDDEN = 256
SMALLEST_SCALE = 0.004
SCALE_FACTOR = 0.1
SIGMA_FACTOR = 10.0
SMALLEST_SIGMA_SCALE = 0.1
BRANCH_START = 0.3  # initial weight of a residual branch

Answer = tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]
"""See `answer`."""


class Residual(nn.Module):
    """relu(shortcut(x) + w * conv(relu(conv(x)))), halving the size; w is learned per channel."""

    def __init__(self, inputs: int, outputs: int, groups: int = 1, convolution: type[nn.Conv2d] = nn.Conv2d) -> None:
        super().__init__()
        self.first = convolution(inputs, outputs, 3, 2, 1, groups=groups)
        self.second = convolution(outputs, outputs, 3, 1, 1, groups=groups)
        self.shortcut = convolution(inputs, outputs, 1, 2, groups=groups)
        self.weight = nn.Parameter(torch.full((1, outputs, 1, 1), BRANCH_START))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """(N, inputs, H, W) -> (N, outputs, H / 2, W / 2)."""
        branch = self.second(functional.relu(self.first(x)))
        return functional.relu(self.shortcut(x) + self.weight.to(branch.dtype) * branch)


def body(widths: Sequence[int], groups: int = 1, convolution: type[nn.Conv2d] = nn.Conv2d) -> nn.Sequential:
    """The convolutions, of four widths; in groups, those of as many networks that see the same maps."""
    first, second, third, reduced = widths
    return nn.Sequential(
        convolution(MAPS, first, 3, padding=1),
        nn.ReLU(),
        Residual(first, second, groups, convolution),
        Residual(second, third, groups, convolution),
        convolution(third, reduced, 1, groups=groups),
        nn.ReLU(),
    )


class SpectralNet(nn.Module):
    """See the module.

    Args:
        half_precision: run the convolutions in bfloat16 where that is faster (training); answers move by about 0.001.
        width: factor on the numbers of channels and of hidden units.
        block_px: of the features.
    """

    def __init__(self, half_precision: bool = False, width: float = 1.0, block_px: int = BLOCK_PX) -> None:
        super().__init__()
        *widths, reduced, hidden = (round(width * count) for count in (*WIDTHS, REDUCED, HIDDEN))
        self.half_precision = half_precision
        self.body = body((*widths, reduced))
        self.head = nn.Sequential(
            nn.Linear(reduced * (block_px // 4) * (block_px // 8) + VECTOR_LENGTH, hidden),
            nn.ReLU(),
            nn.Linear(hidden, hidden),
            nn.ReLU(),
            nn.Linear(hidden, VALUES),
        )

    def forward(self, maps: torch.Tensor, vector: torch.Tensor) -> Answer:
        """The answer for features (`spectral_features.features`); see `answer`."""
        return self.outputs(self.hidden(maps, vector))

    def hidden(self, maps: torch.Tensor, vector: torch.Tensor) -> torch.Tensor:
        """(N, hidden) units of the first hidden layer, after its ReLU."""
        maps = maps.contiguous(memory_format=torch.channels_last)
        with torch.autocast(maps.device.type, torch.bfloat16, enabled=self.half_precision):
            seen = self.body(maps)
        return self.units(seen, vector)

    def units(self, seen: torch.Tensor, vector: torch.Tensor) -> torch.Tensor:
        """(N, hidden) units, from what the body gives of the maps; see `hidden`."""
        return self.head[1](self.head[0](torch.cat([seen.float().flatten(1), vector], dim=1)))

    def outputs(self, hidden: torch.Tensor) -> Answer:
        """The answer from these units; see `forward`."""
        return answer(self.head[2:](hidden))


def answer(values: torch.Tensor) -> Answer:
    """MTF and noise with their uncertainty, from the values (N, 34) of a network's last layer.

    Returns:
        mtf: (N, 2, 8) in (0, 1); scale: (N, 2, 8) > 0, mean absolute error expected; sigma_dn: (N,) noise added
        after the blur; sigma_scale_dn: (N,).
    """
    count = 2 * FREQUENCIES
    mtf = torch.sigmoid(values[:, :count]).unflatten(1, (2, FREQUENCIES))
    scale = functional.softplus(values[:, count : 2 * count]) * SCALE_FACTOR + SMALLEST_SCALE
    sigma_dn = functional.softplus(values[:, -2]) * SIGMA_FACTOR
    sigma_scale_dn = functional.softplus(values[:, -1]) + SMALLEST_SIGMA_SCALE
    return mtf, scale.unflatten(1, (2, FREQUENCIES)), sigma_dn, sigma_scale_dn


def laplace_loss(mean: torch.Tensor, scale: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """Mean negative log likelihood of a Laplace distribution, |y - m| / b + log b; the best b is the mean error."""
    return ((mean - truth).abs() / scale + scale.log()).mean()
