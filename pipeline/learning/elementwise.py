"""Square root and logarithm of tensors: the same bytes on any processor where networks answer.

torch takes both from MKL's vector library, whose last digit differs between processors whatever `pipeline.processor`
pins; NumPy's are pinned (and its square root is rounded correctly). Answers are computed under
``torch.inference_mode()``, and there NumPy computes them; a training, which needs their derivatives, is under no such
mode and keeps torch's.
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
    return _computed(np.sqrt, x) if _answers(x) else x.sqrt()


def logarithm(x: torch.Tensor) -> torch.Tensor:
    """Natural logarithm of every element.

    Args:
        x: any shape, above 0.
    """
    return _computed(np.log, x) if _answers(x) else x.log()


def _answers(x: torch.Tensor) -> bool:
    return torch.is_inference_mode_enabled() and x.device.type == "cpu"


def _computed(function: Callable[[Any], Any], x: torch.Tensor) -> torch.Tensor:
    return torch.from_numpy(np.asarray(function(x.numpy())))
