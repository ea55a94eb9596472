"""Least loss of a few weights over samples that are all in memory: AdamW, the rate falling evenly to zero.

For what trains in seconds; networks train with checkpoints (`pipeline.learning.trainer`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import torch


def descend(
    parameters: Iterable[torch.nn.Parameter],
    loss: Callable[[], torch.Tensor],
    *,
    steps: int,
    learning_rate: float,
    weight_decay: float = 0.0,
) -> None:
    """Train parameters in place.

    Args:
        parameters: what is trained.
        loss: called at every step, of the parameters as they are then; a scalar.
        steps: how many.
        learning_rate: of the first step; that of step t of T is (1 - t / T) of it.
        weight_decay: of AdamW.
    """
    import torch

    # fused, as in `pipeline.learning.trainer`
    optimiser = torch.optim.AdamW(parameters, lr=learning_rate, weight_decay=weight_decay, fused=True)
    for step in range(steps):
        for group in optimiser.param_groups:
            group["lr"] = learning_rate * (1 - step / steps)
        optimiser.zero_grad()
        loss().backward()
        optimiser.step()
