"""The paper's network, layer by layer: polyphase input with a Sobel channel, seven residual blocks, four dense layers.

Wischow et al. 2023 after Bauer et al., "Automatic estimation of modulation transfer functions", ICCP 2018; layer list
from the authors' program. 6,757,384 parameters. It estimates the MTF along x; for y the patch is turned by 90 degrees.
All convolutions are padded as TensorFlow's ``same``: with stride 2 on even sizes, at the bottom and right only.
"""

from __future__ import annotations

import torch
import torch.nn.functional as functional
from torch import nn

from pipeline.blur.networks.cnn_features import PHASES, network_input

ARCHITECTURE = "mtf-cnn-1"
FREQUENCIES = 8
WIDTH, WIDE = 128, 256


class SameConv(nn.Conv2d):
    """Convolution with TensorFlow's ``same`` padding: what cannot be split evenly goes to the bottom and right."""

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """(N, C, H, W) -> (N, C', ceil(H / stride), ceil(W / stride))."""
        before_after = []
        for length, kernel, stride in zip(x.shape[:1:-1], self.kernel_size[::-1], self.stride[::-1], strict=True):
            total = max((-(-length // stride) - 1) * stride + kernel - length, 0)
            before_after += [total // 2, total - total // 2]
        return super().forward(functional.pad(x, before_after))


class Block(nn.Module):
    """relu(relu(conv(relu(conv(x)))) + shortcut), the shortcut being x, or relu(1 x 1 conv) where the size changes."""

    def __init__(self, inputs: int, outputs: int, kernel: int, stride: int) -> None:
        super().__init__()
        self.first = SameConv(inputs, outputs, kernel, stride)
        self.second = SameConv(outputs, outputs, kernel)
        self.shortcut = SameConv(inputs, outputs, 1, stride) if stride > 1 else None

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """(N, inputs, H, W) -> (N, outputs, ceil(H / stride), ceil(W / stride))."""
        branch = functional.relu(self.second(functional.relu(self.first(x))))
        straight = x if self.shortcut is None else functional.relu(self.shortcut(x))
        return functional.relu(branch + straight)


class MtfCnn(nn.Module):
    """See the module."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = SameConv(2 * PHASES**2, WIDTH, 5)
        self.blocks = nn.Sequential(
            Block(WIDTH, WIDTH, 5, 1),
            Block(WIDTH, WIDTH, 3, 1),
            Block(WIDTH, WIDE, 3, 2),
            Block(WIDE, WIDE, 3, 2),
            Block(WIDE, WIDE, 3, 2),
            Block(WIDE, WIDE, 3, 2),
            Block(WIDE, WIDE, 2, 2),
        )
        self.dense = nn.Sequential(
            nn.Linear(WIDE, WIDE),
            nn.ReLU(),
            nn.Linear(WIDE, WIDE),
            nn.ReLU(),
            nn.Linear(WIDE, WIDE // 2),
            nn.ReLU(),
            nn.Linear(WIDE // 2, FREQUENCIES),
            nn.Sigmoid(),
        )

    def features(self, patches: torch.Tensor) -> torch.Tensor:
        """One vector per patch, by convolutions: (N, 192, 192) in [0, 1] -> (N, 256)."""
        seen = network_input(patches).contiguous(memory_format=torch.channels_last)
        return self.blocks(functional.relu(self.stem(seen))).flatten(1)

    def forward(self, patches: torch.Tensor, frames: int = 1) -> torch.Tensor:
        """MTF along x.

        Args:
            patches: (N * frames, 192, 192) float32 in [0, 1]; consecutive frames of one place stand together.
            frames: over how many frames features are averaged before the dense layers.

        Returns:
            (N, 8) in (0, 1).
        """
        result = self.features(patches)
        return self.dense(result.unflatten(0, (-1, frames)).mean(1))

    def both_directions(self, patches: torch.Tensor, frames: int = 1) -> torch.Tensor:
        """MTF along x, then along y (the patch turned clockwise): (N, 2, 8); see `forward`."""
        turned = torch.rot90(patches, -1, (1, 2))
        return torch.stack([self(patches, frames), self(turned, frames)], dim=1)
