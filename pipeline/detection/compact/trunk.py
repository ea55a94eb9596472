"""What both compact detectors see with: a small residual network and a feature pyramid over it.

Residual blocks of 3x3 convolutions (He, Zhang, Ren, Sun 2016) at strides 4, 8, 16 and 32; repeated maximum pooling at
the coarsest for context (SPPF, after He et al. 2015); top-down sums of lateral 1x1 convolutions (feature pyramid, Lin
et al. 2017), smoothed by depth-wise separable convolutions.
"""

from __future__ import annotations

import functools

import torch
from torch import nn
from torch.nn import functional

STRIDES = (8, 16, 32)
WIDTHS = (24, 48, 96, 160)
PYRAMID = 64
MEAN, SPREAD = 0.45, 0.25  # of grey levels in [0, 1]


class Convolution(nn.Sequential):
    """Convolution, batch normalisation, SiLU."""

    def __init__(self, inputs: int, outputs: int, side: int = 3, stride: int = 1, groups: int = 1) -> None:
        super().__init__(
            nn.Conv2d(inputs, outputs, side, stride, side // 2, groups=groups, bias=False),
            nn.BatchNorm2d(outputs),
            nn.SiLU(inplace=True),
        )


class Separable(nn.Sequential):
    """A 3x3 convolution of each channel by itself, then a 1x1 convolution over channels."""

    def __init__(self, channels: int) -> None:
        super().__init__(Convolution(channels, channels, groups=channels), Convolution(channels, channels, side=1))


class Residual(nn.Module):
    """x + two convolutions of it."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.inner = nn.Sequential(Convolution(channels, channels), Convolution(channels, channels))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        total: torch.Tensor = x + self.inner(x)
        return total


class Context(nn.Module):
    """The features beside their maxima over 5, 9 and 13 cells."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.before = Convolution(channels, channels // 2, side=1)
        self.after = Convolution(2 * channels, channels, side=1)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        seen = [self.before(x)]
        for _ in range(3):
            seen.append(_largest(seen[-1]) if not self.training else functional.max_pool2d(seen[-1], 5, 1, 2))
        joined: torch.Tensor = self.after(torch.cat(seen, 1))
        return joined


def _largest(x: torch.Tensor) -> torch.Tensor:
    """Maxima over 5 x 5 cells of maps (N, C, H, W): the values of ``max_pool2d`` in a tenth of its time; for inference.

    Along rows, then along columns, from shifted copies. Gradients of equal cells go elsewhere, so training keeps
    ``max_pool2d``.
    """
    maxima = functional.pad(x, (2, 2, 2, 2), value=-torch.inf)
    for axis in (3, 2):
        length = x.shape[axis]
        maxima = functools.reduce(torch.maximum, [maxima.narrow(axis, first, length) for first in range(5)])
    return maxima


class Trunk(nn.Module):
    """Images to feature maps at strides 8, 16 and 32."""

    def __init__(self) -> None:
        super().__init__()
        first, second, third, fourth = WIDTHS
        self.stem = nn.Sequential(nn.PixelUnshuffle(2), Convolution(4, first, stride=2), Convolution(first, first))
        self.fine = nn.Sequential(Convolution(first, second, stride=2), Residual(second))
        self.middle = nn.Sequential(Convolution(second, third, stride=2), Residual(third), Residual(third))
        self.coarse = nn.Sequential(Convolution(third, fourth, stride=2), Residual(fourth), Context(fourth))
        self.lateral = nn.ModuleList([nn.Conv2d(width, PYRAMID, 1) for width in (second, third, fourth)])
        self.smooth = nn.ModuleList([Separable(PYRAMID) for _ in STRIDES])

    def forward(self, images: torch.Tensor) -> list[torch.Tensor]:
        """Feature maps.

        Args:
            images: (N, 1, H, W) in [0, 1]; H and W multiples of 32.

        Returns:
            (N, 64, H / s, W / s) for the strides s = 8, 16, 32.
        """
        fine = self.fine(self.stem((images - MEAN) / SPREAD))
        middle = self.middle(fine)
        coarse = self.coarse(middle)
        maps = [lateral(x) for lateral, x in zip(self.lateral, (fine, middle, coarse), strict=True)]
        for level in (1, 0):
            maps[level] = maps[level] + functional.interpolate(maps[level + 1], scale_factor=2.0, mode="nearest")
        return [smooth(x) for smooth, x in zip(self.smooth, maps, strict=True)]
