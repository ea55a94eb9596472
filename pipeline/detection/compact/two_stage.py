"""Two stages: cells propose regions of any class, then a second network looks into each region and names it.

The design of Faster R-CNN (Ren, He, Girshick, Sun 2015) on the small trunk. Regions are read from the pyramid by
bilinear samples at the centres of 7x7 parts (RoIAlign, He et al. 2017, one sample a part), from the level that fits
their size. A region's score is the geometric mean of what both stages think (Zhou, Koltun, Kraehenbuehl 2021)::

    score_c = sqrt(p(object) p(c | region))
    loss    = first stage's + CE(class) + 2 mean(1 - GIoU) over the regions of objects
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import nn
from torch.nn import functional

from pipeline.detection.compact import boxes
from pipeline.detection.compact.one_stage import BOX_WEIGHT, Found, OneStage, cell_loss
from pipeline.detection.compact.trunk import PYRAMID, STRIDES
from pipeline.learning.elementwise import square_root

ARCHITECTURE = "detector-compact-two-stage-1"
PARTS = 7
HIDDEN = 192
REGIONS_TRAINED, REGIONS_JUDGED = 48, 100
FINE_PX, MIDDLE_PX = 64.0, 144.0
"""Regions up to these sizes, the root of the area, are read at strides 8 and 16."""
RIGHT = 0.5
"""Least overlap of a region with an object to be named after it."""


class TwoStage(nn.Module):
    """The two-stage detector.

    Args:
        classes: C.
        half_precision: convolutions in bfloat16.
    """

    def __init__(self, classes: int = 3, half_precision: bool = False) -> None:
        super().__init__()
        self.classes = classes
        self.first = OneStage(1, half_precision)
        self.hidden = nn.Sequential(
            nn.Linear(PYRAMID * PARTS * PARTS, HIDDEN), nn.SiLU(), nn.Linear(HIDDEN, HIDDEN), nn.SiLU()
        )
        self.name = nn.Linear(HIDDEN, classes + 1)  # the last is background
        self.move = nn.Linear(HIDDEN, 4)

    @property
    def half_precision(self) -> bool:
        """Whether convolutions are in bfloat16."""
        return self.first.half_precision

    @half_precision.setter
    def half_precision(self, value: bool) -> None:
        self.first.half_precision = value

    def set_prior(self) -> None:
        """Begin with rare objects, and with regions where the first stage put them."""
        self.first.set_prior()
        nn.init.zeros_(self.move.weight)
        nn.init.zeros_(self.move.bias)

    def forward(self, images: torch.Tensor) -> Found:
        """What the first stage's cells say; see `look` for the second."""
        result: Found = self.first(images)
        return result

    def look(self, maps: list[torch.Tensor], regions: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """The second stage.

        Args:
            maps: the pyramid.
            regions: (N, R, 4) pixels.

        Returns:
            logits (N, R, C + 1), and boxes (N, R, 4), pixels.
        """
        count, many = regions.shape[:2]
        hidden = self.hidden(pooled(maps, regions).flatten(0, 1).flatten(1))
        sides = (regions[..., 2:] - regions[..., :2]).clamp(min=1.0)
        shift = self.move(hidden).unflatten(0, (count, many))
        middle = 0.5 * (regions[..., :2] + regions[..., 2:]) + 0.1 * shift[..., :2] * sides
        half = 0.5 * sides * (0.2 * shift[..., 2:]).clamp(-2, 2).exp()
        return self.name(hidden).unflatten(0, (count, many)), torch.cat([middle - half, middle + half], -1)


def pooled(maps: list[torch.Tensor], regions: torch.Tensor) -> torch.Tensor:
    """What the pyramid holds in each region, (N, R, 64, 7, 7)."""
    count, many = regions.shape[:2]
    parts = (torch.arange(PARTS, dtype=regions.dtype, device=regions.device) + 0.5) / PARTS
    x = regions[..., 0:1] + parts * (regions[..., 2:3] - regions[..., 0:1])  # (N, R, 7)
    y = regions[..., 1:2] + parts * (regions[..., 3:4] - regions[..., 1:2])
    where = torch.stack([x[:, :, None, :].expand(-1, -1, PARTS, -1), y[..., None].expand(-1, -1, -1, PARTS)], -1)
    size = square_root(boxes.areas(regions))
    level = (size > FINE_PX).long() + (size > MIDDLE_PX).long()
    total = torch.zeros(count, many, PYRAMID, PARTS, PARTS, dtype=torch.float32, device=regions.device)
    for index, (features, stride) in enumerate(zip(maps, STRIDES, strict=True)):
        sides = [features.shape[3] * stride, features.shape[2] * stride]
        extent = torch.tensor(sides, dtype=torch.float32, device=regions.device)
        grid = (2 * where / extent - 1).reshape(count, many * PARTS, PARTS, 2)
        seen = functional.grid_sample(features.float(), grid, padding_mode="border", align_corners=False)
        seen = seen.reshape(count, PYRAMID, many, PARTS, PARTS).transpose(1, 2)
        total = total + seen * (level == index)[..., None, None, None]
    return total


@torch.no_grad()
def proposals(found: Found, max_detections: int, iou_threshold: float = 0.7) -> tuple[torch.Tensor, torch.Tensor]:
    """The best regions of each image, with little overlap among them.

    Args:
        found: output of the first stage.
        max_detections: R; where there are fewer, the weakest cells fill up.
        iou_threshold: limit on the intersection over union of two regions.

    Returns:
        regions (N, R, 4), pixels, and their probability (N, R).
    """
    import numpy as np

    from pipeline.detection.nms import suppress

    chosen, scores = [], []
    for logit, box in zip(found.logit[..., 0], found.box, strict=True):
        best = logit.topk(min(4 * max_detections, len(logit))).indices
        score, region = logit[best].sigmoid(), box[best]
        kind = np.zeros(len(best), np.int64)
        kept = suppress(region.cpu().numpy(), score.cpu().numpy(), kind, iou_threshold, max_detections)
        rest = np.setdiff1d(np.arange(len(best)), kept)[: max_detections - len(kept)]
        order = torch.from_numpy(np.concatenate([kept, rest])).to(region.device)
        chosen.append(region[order])
        scores.append(score[order])
    return torch.stack(chosen), torch.stack(scores)


def loss(model: nn.Module, batch: Mapping[str, torch.Tensor]) -> tuple[torch.Tensor, dict[str, float]]:
    """Loss of both stages on a batch of `pipeline.detection.compact.samples`."""
    assert isinstance(model, TwoStage)
    images = batch["image"].float().div_(255).contiguous(memory_format=torch.channels_last)
    truth, kind = batch["box"], batch["kind"].long()
    result = model(images)
    value, measures, _ = cell_loss(result, truth, torch.where(kind >= 0, 0, kind))
    regions, _ = proposals(result, REGIONS_TRAINED)
    regions = torch.cat([regions, truth], 1)  # objects themselves are regions too, so that every one is named
    over = boxes.overlap(regions, truth) * (kind != -1)[:, None]
    best = over.max(-1)
    owner = kind.gather(1, best.indices)
    right = (best.values >= RIGHT) & (owner >= 0)
    goal = torch.where(right, owner, model.classes)
    real = torch.cat([torch.ones_like(right[:, :REGIONS_TRAINED]), kind >= 0], 1)
    counted = real & ~((best.values >= RIGHT) & (owner < 0))
    logit, moved = model.look(result.maps, regions)
    name_loss = functional.cross_entropy(logit[counted], goal[counted])
    aim = truth.gather(1, best.indices[..., None].expand(-1, -1, 4))
    apart = 1 - boxes.generalised_overlap(moved[right], aim[right])
    move_loss = apart.sum() / right.sum().clamp(min=1)
    measures |= {"name_loss": float(name_loss.detach()), "move_loss": float(move_loss.detach())}
    return value + name_loss + BOX_WEIGHT * move_loss, measures


@torch.no_grad()
def candidates(model: TwoStage, image: torch.Tensor, floor: float) -> tuple[torch.Tensor, ...]:
    """Boxes (M, 4), scores (M,) and class numbers (M,) of one image (1, 1, H, W), before suppression."""
    result = model(image)
    regions, first = proposals(result, REGIONS_JUDGED)
    logit, moved = model.look(result.maps, regions)
    second, kind = logit[0].softmax(-1)[:, : model.classes].max(-1)
    score = square_root(first[0] * second)
    likely = score >= floor
    return moved[0][likely], score[likely], kind[likely]
