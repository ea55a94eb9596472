"""The pixel network: a patch itself to the MTF with its uncertainty, both directions at once.

Where the spectral network sees log power spectra, this one sees edges: how a step or a line spreads shows a short
motion that a spectrum without phases does not tell from a softer scene. The patch, less its mean and divided by its
contrast, is folded to half the size with four channels; three pairs of residual blocks halve it to 12 x 12 cells; heads
of attention weight the cells, and together with mean and contrast two hidden layers of 256 give what the spectral
network gives: 16 MTF values, 16 scales of their Laplace distribution, noise sigma and its scale. 1.41 million
parameters, 13 ms a patch on a core.
"""

from __future__ import annotations

import torch
import torch.nn.functional as functional
from torch import nn

from pipeline.blur.networks.spectral_net import HIDDEN, VALUES, Answer, answer
from pipeline.learning.elementwise import square_root

ARCHITECTURE = "mtf-pixels-1"
FOLD_PX = 2
WIDTHS = (32, 56, 96, 160)
NORM_GROUPS = 8
HEADS = 8
SMALLEST_CONTRAST_DN = 2.0
CONTRAST_UNIT = 64.0
NUMBERS = 2


class Residual(nn.Module):
    """relu(shortcut(x) + norm(conv(relu(norm(conv(x)))))), of the same size or half of it."""

    def __init__(self, inputs: int, outputs: int, stride: int) -> None:
        super().__init__()
        self.first = nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False)
        self.first_norm = nn.GroupNorm(NORM_GROUPS, outputs)
        self.second = nn.Conv2d(outputs, outputs, 3, 1, 1, bias=False)
        self.second_norm = nn.GroupNorm(NORM_GROUPS, outputs)
        self.shortcut = nn.Conv2d(inputs, outputs, 1, stride) if stride > 1 else nn.Identity()

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """(N, inputs, H, W) -> (N, outputs, H / stride, W / stride)."""
        branch = self.second_norm(self.second(functional.relu(self.first_norm(self.first(x)))))
        return functional.relu(self.shortcut(x) + branch)


class PixelNet(nn.Module):
    """See the module.

    Args:
        half_precision: run the convolutions in bfloat16 where that is faster (training).
    """

    def __init__(self, half_precision: bool = False) -> None:
        super().__init__()
        self.half_precision = half_precision
        stem, *rest = WIDTHS
        layers: list[nn.Module] = [nn.Conv2d(FOLD_PX**2, stem, 5, padding=2), nn.ReLU()]
        inputs = stem
        for outputs in rest:
            layers += [Residual(inputs, outputs, 2), Residual(outputs, outputs, 1)]
            inputs = outputs
        self.body = nn.Sequential(*layers)
        self.attention = nn.Conv2d(inputs, HEADS, 1)
        self.head = nn.Sequential(
            nn.Linear(2 * inputs + NUMBERS, HIDDEN),
            nn.ReLU(),
            nn.Linear(HIDDEN, HIDDEN),
            nn.ReLU(),
            nn.Linear(HIDDEN, VALUES),
        )

    def forward(self, patches_dn: torch.Tensor) -> Answer:
        """For patches (N, 192, 192), 0..255: see `pipeline.blur.networks.spectral_net.answer`."""
        return self.outputs(self.hidden(patches_dn))

    def hidden(self, patches_dn: torch.Tensor) -> torch.Tensor:
        """(N, 256) units of the first hidden layer, after its ReLU."""
        patches_dn = patches_dn.float()
        mean = patches_dn.mean((1, 2), keepdim=True)
        contrast = square_root((patches_dn - mean).square().mean((1, 2), keepdim=True))
        normal = (patches_dn - mean) / contrast.clamp_min(SMALLEST_CONTRAST_DN)
        folded = functional.pixel_unshuffle(normal[:, None], FOLD_PX).contiguous(memory_format=torch.channels_last)
        with torch.autocast(folded.device.type, torch.bfloat16, enabled=self.half_precision):
            seen = self.body(folded)
            scores = self.attention(seen)
        cells = seen.float().flatten(2)
        weights = scores.float().flatten(2).softmax(dim=2)
        attended = torch.einsum("nhcp,nhp->nhc", cells.unflatten(1, (HEADS, -1)), weights).flatten(1)
        numbers = torch.cat([mean.flatten(1) / 255, (contrast.flatten(1) / CONTRAST_UNIT).clamp_min(1e-3).log()], dim=1)
        return self.head[1](self.head[0](torch.cat([cells.mean(2), attended, numbers], dim=1)))

    def outputs(self, hidden: torch.Tensor) -> Answer:
        """The answer from these units; see `forward`."""
        return answer(self.head[2:](hidden))
