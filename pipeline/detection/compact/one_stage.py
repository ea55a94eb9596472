"""One stage: every cell of three grids estimates which class it sees and where the object ends.

Separate branches for class and box on each level of the pyramid; no anchors (FCOS, Tian et al. 2019), no centre-ness:
probabilities are trained towards the overlap of the box (task-aligned, Feng et al. 2021)::

    loss = sum BCE(p, target) / T + 2 sum target (1 - GIoU) / T,    T = sum of targets
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import torch
from torch import nn
from torch.nn import functional

from pipeline.detection.compact import boxes
from pipeline.detection.compact.assignment import assign
from pipeline.detection.compact.trunk import PYRAMID, STRIDES, Separable, Trunk

ARCHITECTURE = "detector-compact-1"
BOX_WEIGHT = 2.0
PRIOR = 0.01  # probability that a cell sees an object, before training


@dataclass(frozen=True)
class Found:
    """What the cells say.

    Attributes:
        logit: (N, P, C) of the class probabilities.
        box: (N, P, 4) pixels.
        centres: (P, 2) of the cells, pixels.
        strides: (P,) of the cells, pixels.
        maps: the pyramid that they looked at.
    """

    logit: torch.Tensor
    box: torch.Tensor
    centres: torch.Tensor
    strides: torch.Tensor
    maps: list[torch.Tensor]


class OneStage(nn.Module):
    """The one-stage detector.

    Args:
        classes: C.
        half_precision: trunk and branches in bfloat16.
    """

    def __init__(self, classes: int = 3, half_precision: bool = False) -> None:
        super().__init__()
        self.classes, self.half_precision = classes, half_precision
        self.trunk = Trunk()
        self.class_branch = nn.ModuleList([nn.Sequential(Separable(PYRAMID), Separable(PYRAMID)) for _ in STRIDES])
        self.box_branch = nn.ModuleList([nn.Sequential(Separable(PYRAMID), Separable(PYRAMID)) for _ in STRIDES])
        self.class_out = nn.ModuleList([nn.Conv2d(PYRAMID, classes, 1) for _ in STRIDES])
        self.box_out = nn.ModuleList([nn.Conv2d(PYRAMID, 4, 1) for _ in STRIDES])

    def set_prior(self) -> None:
        """Begin with rare objects, four cells in size."""
        for class_out, box_out in zip(self.class_out, self.box_out, strict=True):
            nn.init.constant_(class_out.bias, -math.log((1 - PRIOR) / PRIOR))  # type: ignore[arg-type]
            nn.init.constant_(box_out.bias, math.log(2))  # type: ignore[arg-type]

    def forward(self, images: torch.Tensor) -> Found:
        """What all cells say of (N, 1, H, W) images in [0, 1], H and W multiples of 32."""
        with torch.autocast(images.device.type, torch.bfloat16, enabled=self.half_precision):
            maps = self.trunk(images)
            logits = [out(branch(x)) for out, branch, x in zip(self.class_out, self.class_branch, maps, strict=True)]
            numbers = [out(branch(x)) for out, branch, x in zip(self.box_out, self.box_branch, maps, strict=True)]
        centres, strides = boxes.cells(images.shape[2], images.shape[3], STRIDES, images.device)
        joined = torch.cat([x.flatten(2) for x in logits], 2).transpose(1, 2).float()
        box = boxes.spelled(torch.cat([x.flatten(2) for x in numbers], 2).transpose(1, 2).float(), centres, strides)
        return Found(joined, box, centres, strides, maps)


def cell_loss(
    found: Found, truth: torch.Tensor, kind: torch.Tensor
) -> tuple[torch.Tensor, dict[str, float], torch.Tensor]:
    """The loss above, its parts for the record, and which cells answer for an object (N, P)."""
    goal = assign(found.logit.sigmoid(), found.box, found.centres, found.strides, truth, kind)
    total = goal.probability.sum().clamp(min=1.0)
    entropy = functional.binary_cross_entropy_with_logits(found.logit, goal.probability, reduction="none")
    class_loss = (entropy * goal.counted[..., None]).sum() / total
    weight = goal.probability.sum(-1)[goal.taken]
    apart = 1 - boxes.generalised_overlap(found.box[goal.taken], goal.box[goal.taken])
    box_loss = (weight * apart).sum() / total
    return (
        class_loss + BOX_WEIGHT * box_loss,
        {"class_loss": float(class_loss.detach()), "box_loss": float(box_loss.detach())},
        goal.taken,
    )


def loss(model: nn.Module, batch: Mapping[str, torch.Tensor]) -> tuple[torch.Tensor, dict[str, float]]:
    """Loss on a batch of `pipeline.detection.compact.samples`."""
    images = batch["image"].float().div_(255).contiguous(memory_format=torch.channels_last)
    value, measures, _ = cell_loss(model(images), batch["box"], batch["kind"].long())
    return value, measures


@torch.no_grad()
def candidates(model: OneStage, image: torch.Tensor, floor: float) -> tuple[torch.Tensor, ...]:
    """Boxes (M, 4), scores (M,) and class numbers (M,) of one image (1, 1, H, W), before suppression."""
    result = model(image)
    score, kind = result.logit[0].sigmoid().max(-1)
    likely = score >= floor
    return result.box[0][likely], score[likely], kind[likely]
