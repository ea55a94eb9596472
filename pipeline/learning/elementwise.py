"""Square root and logarithm of tensors: the same bytes on any processor, in answers and in trainings.

torch takes the square root and the logarithm of float64 from MKL's vector library, whose last digit differs between
processors whatever `pipeline.processor` pins. NumPy's are pinned, and its square root is rounded correctly, so that
NumPy computes both; their derivatives are quotients. Networks on another device, in half precision or being exported
keep torch's.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import torch


def square_root(x: torch.Tensor) -> torch.Tensor:
    """Square root of every element.

    Args:
        x: any shape, at least 0.
    """
    return _SquareRoot.apply(x) if _by_numpy(x) else x.sqrt()


def logarithm(x: torch.Tensor) -> torch.Tensor:
    """Natural logarithm of every element.

    Args:
        x: any shape, above 0.
    """
    return _Logarithm.apply(x) if _by_numpy(x) else x.log()


class _SquareRoot(torch.autograd.Function):
    """d sqrt(x) / dx = 1 / (2 sqrt(x))."""

    @staticmethod
    def forward(context: Any, x: torch.Tensor) -> torch.Tensor:
        root = _computed(np.sqrt, x)
        context.save_for_backward(root)
        return root

    @staticmethod
    def backward(context: Any, gradient: torch.Tensor) -> torch.Tensor:
        (root,) = context.saved_tensors
        return gradient / (2 * root)


class _Logarithm(torch.autograd.Function):
    """d ln(x) / dx = 1 / x."""

    @staticmethod
    def forward(context: Any, x: torch.Tensor) -> torch.Tensor:
        context.save_for_backward(x)
        return _computed(np.log, x)

    @staticmethod
    def backward(context: Any, gradient: torch.Tensor) -> torch.Tensor:
        (x,) = context.saved_tensors
        return gradient / x


def _by_numpy(x: torch.Tensor) -> bool:
    return x.device.type == "cpu" and x.dtype in (torch.float32, torch.float64) and not torch.jit.is_tracing()


def _computed(function: Callable[[Any], Any], x: torch.Tensor) -> torch.Tensor:
    return torch.from_numpy(np.asarray(function(x.detach().numpy())))
