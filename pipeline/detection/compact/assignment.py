"""Which cell answers for which object: task-aligned assignment (Feng, Zhong, Gao, Scott, Huang 2021, "TOOD").

Cells inside an object, and those next to its centre, are ranked by alignment a = p^(1/2) u^6, with the cell's present
probability p of the object's class and the overlap u of its present box; the best ten take the object on. A cell
claimed twice goes to the object it overlaps most. Its target probability is a, scaled so that the object's best cell
gets its overlap: where the box is poor, the score shall be low.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch

from pipeline.detection.compact import boxes
from pipeline.learning.elementwise import square_root

TAKEN = 10
IGNORED, ABSENT = -2, -1


@dataclass(frozen=True)
class Assigned:
    """What each cell should say.

    Attributes:
        probability: (N, P, C) target, 0 for background.
        taken: (N, P) bool, cells that answer for an object.
        box: (N, P, 4) the box of that object.
        counted: (N, P) bool, cells whose probability counts; not those in ignored objects.
    """

    probability: torch.Tensor
    taken: torch.Tensor
    box: torch.Tensor
    counted: torch.Tensor


@torch.no_grad()
def assign(
    probability: torch.Tensor,
    found: torch.Tensor,
    centres: torch.Tensor,
    strides: torch.Tensor,
    truth: torch.Tensor,
    kind: torch.Tensor,
) -> Assigned:
    """Assign objects to cells.

    Args:
        probability: (N, P, C) what cells say now, in [0, 1].
        found: (N, P, 4) their boxes, pixels.
        centres: (P, 2) of the cells.
        strides: (P,) of the cells.
        truth: (N, M, 4) boxes of objects, pixels.
        kind: (N, M) class numbers; -1 where there is no object, -2 for an object that is neither wanted nor wrong.
    """
    wanted = kind >= 0
    x, y = centres[:, 0], centres[:, 1]
    inside = (x > truth[..., 0:1]) & (x < truth[..., 2:3]) & (y > truth[..., 1:2]) & (y < truth[..., 3:4])  # (N, M, P)
    middle = 0.5 * (truth[..., :2] + truth[..., 2:])
    near = ((centres - middle[..., None, :]).abs() < strides[:, None]).all(-1) & (strides == strides.min())
    candidate = (inside | near) & wanted[..., None]
    of_class = probability.transpose(1, 2).gather(1, kind.clamp(min=0)[..., None].expand(-1, -1, probability.shape[1]))
    over = boxes.overlap(truth, found)  # (N, M, P)
    aligned = (square_root(of_class) * over**6).clamp(min=1e-9) * candidate
    best = aligned.topk(min(TAKEN, aligned.shape[-1]), -1)
    chosen = torch.zeros_like(candidate).scatter_(-1, best.indices, best.values > 0)
    owner = torch.where(chosen, over, -1.0).max(1)  # over objects
    taken = owner.values >= 0
    mine = torch.zeros_like(chosen).scatter_(1, owner.indices[:, None], taken[:, None]) & chosen
    aligned, over = aligned * mine, over * mine
    scale = over.amax(-1, keepdim=True) / aligned.amax(-1, keepdim=True).clamp(min=1e-12)
    target = (aligned * scale).amax(1)  # (N, P)
    which = kind.gather(1, owner.indices).clamp(min=0)
    wished = torch.zeros_like(probability).scatter_(-1, which[..., None], (target * taken)[..., None])
    box = truth.gather(1, owner.indices[..., None].expand(-1, -1, 4))
    ignored = (inside & (kind == IGNORED)[..., None]).any(1)
    return Assigned(wished, taken, box, taken | ~ignored)
