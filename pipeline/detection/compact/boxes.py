"""Boxes as tensors: where they are, how much they overlap, and how cells of a grid spell them.

A cell of stride s at p = (column + 1/2, row + 1/2) s spells a box by four numbers t (left, top, right, bottom)::

    x1 = p_x - s exp(t_left),   y1 = p_y - s exp(t_top),   x2 = p_x + s exp(t_right),   y2 = p_y + s exp(t_bottom)
"""

from __future__ import annotations

import functools

import torch

LARGEST_LOG = 4.5  # exp(4.5) = 90 cells, 2880 px at stride 32


@functools.lru_cache(maxsize=16)
def cells(
    height_px: int, width_px: int, strides: tuple[int, ...], device: torch.device | None = None
) -> tuple[torch.Tensor, torch.Tensor]:
    """Where the cells of all strides lie: finest stride first, row by row.

    Args:
        height_px: of the picture.
        width_px: likewise.
        strides: of the grids, px.
        device: where the tensors are made; the processor if None.

    Returns:
        centres (P, 2), x y in pixels, and strides (P,).
    """
    centres, sizes = [], []
    for stride in strides:
        rows, columns = torch.meshgrid(
            torch.arange(height_px // stride, dtype=torch.float32, device=device),
            torch.arange(width_px // stride, dtype=torch.float32, device=device),
            indexing="ij",
        )
        centres.append((torch.stack([columns, rows], -1).reshape(-1, 2) + 0.5) * stride)
        sizes.append(torch.full((rows.numel(),), float(stride), dtype=torch.float32, device=device))
    return torch.cat(centres), torch.cat(sizes)


def spelled(numbers: torch.Tensor, centres: torch.Tensor, strides: torch.Tensor) -> torch.Tensor:
    """Boxes (..., P, 4) from what cells say (..., P, 4)."""
    reach = numbers.clamp(max=LARGEST_LOG).exp() * strides[:, None]
    return torch.cat([centres - reach[..., :2], centres + reach[..., 2:]], -1)


def areas(boxes: torch.Tensor) -> torch.Tensor:
    """Areas (...,) of boxes (..., 4); 0 for boxes turned inside out."""
    sides = (boxes[..., 2:] - boxes[..., :2]).clamp(min=0)
    return sides[..., 0] * sides[..., 1]


def overlap(one: torch.Tensor, other: torch.Tensor) -> torch.Tensor:
    """Intersection over union of every box of one with every box of the other.

    Args:
        one: (..., A, 4).
        other: (..., B, 4).

    Returns:
        (..., A, B) in [0, 1].
    """
    a, b = one[..., :, None, :], other[..., None, :, :]
    common = areas(torch.cat([torch.maximum(a[..., :2], b[..., :2]), torch.minimum(a[..., 2:], b[..., 2:])], -1))
    return common / (areas(a) + areas(b) - common).clamp(min=1e-6)


def generalised_overlap(one: torch.Tensor, other: torch.Tensor) -> torch.Tensor:
    """Generalised intersection over union of boxes in pairs (Rezatofighi et al. 2019), in [-1, 1].

    IoU - (hull - union) / hull, with the smallest box around both as hull: it has a slope where the two do not touch.

    Args:
        one: (M, 4).
        other: (M, 4).
    """
    low, high = torch.maximum(one[:, :2], other[:, :2]), torch.minimum(one[:, 2:], other[:, 2:])
    common = areas(torch.cat([low, high], 1))
    union = (areas(one) + areas(other) - common).clamp(min=1e-6)
    hull = areas(torch.cat([torch.minimum(one[:, :2], other[:, :2]), torch.maximum(one[:, 2:], other[:, 2:])], 1))
    return common / union - (hull - union) / hull.clamp(min=1e-6)
