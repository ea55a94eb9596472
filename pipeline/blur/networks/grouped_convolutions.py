"""The convolutions of several spectral networks as those of one, for a single patch.

The networks see the same maps, so their first convolutions are one with the channels of all; the others are
convolutions in groups, a network each. oneDNN computes all of them (`OneDnnConvolution`), in a fifth less time than the
networks one after the other. Of many patches they take longer.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import torch
from torch import nn

from pipeline.blur.networks.spectral_net import REDUCED, WIDTHS, SpectralNet, body


class OneDnnConvolution(nn.Conv2d):
    """A convolution by oneDNN where there is one, however few its values: of one patch PyTorch takes slower code."""

    def forward(self, input: torch.Tensor) -> torch.Tensor:
        """As `nn.Conv2d`, but for rounding."""
        if input.device.type != "cpu" or not torch.backends.mkldnn.is_available():
            return super().forward(input)
        result: torch.Tensor = torch.mkldnn_convolution(
            input,
            self.weight,
            self.bias,
            cast("tuple[int, ...]", self.padding),
            self.stride,
            self.dilation,
            self.groups,
        )
        return result


class GroupedBodies(nn.Module):
    """The bodies of several networks as one; what it gives differs from what they give by rounding alone.

    Args:
        networks: whose weights do not change any more; those of the bodies are copied.
    """

    def __init__(self, networks: Sequence[SpectralNet]) -> None:
        super().__init__()
        self.count = len(networks)
        self.body = body(
            [self.count * width for width in (*WIDTHS, REDUCED)], groups=self.count, convolution=OneDnnConvolution
        )
        each = [network.body.state_dict() for network in networks]
        # Channels are the first axis but for the weights of residual branches, (1, C, 1, 1).
        self.body.load_state_dict(
            {
                name: torch.cat([weights[name] for weights in each], dim=int(value.shape[0] == 1))
                for name, value in each[0].items()
            }
        )
        self.body.to(networks[0].head[0].weight.device, memory_format=torch.channels_last)  # type: ignore[call-overload]

    def forward(self, maps: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """What the body of each network gives, (N, 32, H / 4, W / 8), of maps (N, 3, H, W)."""
        result: torch.Tensor = self.body(maps.contiguous(memory_format=torch.channels_last))
        return result.chunk(self.count, dim=1)
