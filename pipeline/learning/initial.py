"""Initial weights from a named random stream."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

from pipeline.streams import torch_stream

if TYPE_CHECKING:
    from torch import nn


def initialise(model: nn.Module, seed: int, name: str, rule: Literal["torch", "glorot"] = "torch") -> None:
    """Draw the weights of all convolutions and linear layers anew; other parameters stay as they are.

    Args:
        model: changed in place.
        seed: of the stream.
        name: of the stream; the same two give the same weights, whatever was drawn before.
        rule: ``torch``: weights and biases uniform in +-1/sqrt(inputs), torch's own rule; ``glorot``: weights uniform
            in +-sqrt(6 / (inputs + outputs)), biases zero, Keras' rule (Glorot and Bengio 2010).
    """
    import torch
    from torch import nn

    generator = torch_stream(seed, "initial weights", name)
    with torch.no_grad():
        for layer in model.modules():
            if not isinstance(layer, (nn.Conv2d, nn.Linear)):
                continue
            inputs = layer.weight[0].numel()
            outputs = layer.weight.numel() // layer.weight.shape[1]
            bound = 1 / math.sqrt(inputs) if rule == "torch" else math.sqrt(6 / (inputs + outputs))
            layer.weight.uniform_(-bound, bound, generator=generator)
            if layer.bias is None:
                continue
            if rule == "torch":
                layer.bias.uniform_(-bound, bound, generator=generator)
            else:
                layer.bias.zero_()
