"""What the paper's network sees of a patch: grey levels and a Sobel gradient, split into phases.

Bauer et al., "Automatic estimation of modulation transfer functions", ICCP 2018; Wischow et al. 2023.
"""

from __future__ import annotations

import torch
import torch.nn.functional as functional
from kornia.filters import spatial_gradient

PHASES = 6  # the patch is split into 6 x 6 sub-sampled images


def network_input(patches: torch.Tensor) -> torch.Tensor:
    """What the network sees of patches.

    Mean-free grey levels and their horizontal Sobel gradient (border pixels repeated), each split into its 36 phases:
    channel (row mod 6) * 6 + (column mod 6), gradients after greys.

    Args:
        patches: (N, 192, 192) float32 in [0, 1].

    Returns:
        (N, 72, 32, 32).
    """
    centred = (patches - patches.mean((1, 2), keepdim=True))[:, None]
    gradient = spatial_gradient(centred, "sobel", normalized=False)[:, :, 0]  # rows -1 0 1, -2 0 2, -1 0 1
    return functional.pixel_unshuffle(torch.cat([centred, gradient], dim=1), PHASES)
