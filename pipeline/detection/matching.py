"""Which detections of one class in one image are right.

Two published rules, and one addition. ``paper``: the rules of Cartucho's mAP program, which the paper used (Pascal VOC
2012). Each detection, from the highest score down, belongs to the object it overlaps most; the first to claim an
object is right, later ones are wrong. Widths and heights are one pixel longer than the difference of the corners.
They limit the number of detections nowhere. ``coco``: each detection takes the best object that is still free, and only
the 100 best detections of a class in an image count (Lin et al. 2014; pycocotools).

The addition, as in KITTI's evaluation: a detection that is not right, but has at least half of its area in one ignored
region, counts neither way. So does one that belongs to an ignored object; nobody misses an ignored object.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Rule = Literal["paper", "coco"]
RULES: tuple[Rule, ...] = ("paper", "coco")

TRUE_POSITIVE, FALSE_POSITIVE, IGNORED = 1, 0, -1
IGNORED_FRACTION = 0.5
COCO_MAX_DETECTIONS = 100
"""Of one class in one image."""


@dataclass(frozen=True)
class GroundTruth:
    """What is to be found in one image.

    Attributes:
        boxes: (K, 4) float64, x1 y1 x2 y2, pixels.
        label: (K,) str.
        ignore: (K,) bool; for its own class such an object is a region where detections count neither way.
    """

    boxes: NDArray[np.float64]
    label: NDArray[np.str_]
    ignore: NDArray[np.bool_]

    def called(self, label: str) -> GroundTruth:
        """The objects and ignored regions of one class."""
        chosen = self.label == label
        return GroundTruth(self.boxes[chosen], self.label[chosen], self.ignore[chosen])


def overlaps(
    one: NDArray[np.float64], other: NDArray[np.float64], pixel: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """How much boxes overlap, each of one set with each of the other.

    Args:
        one: (M, 4) x1 y1 x2 y2.
        other: (K, 4).
        pixel: added to widths and heights (1 for inclusive corners, 0 for continuous coordinates).

    Returns:
        intersection over union, and intersection over the area of ``one``, both (M, K), 0 where boxes do not meet.
    """
    low = np.maximum(one[:, None, :2], other[None, :, :2])
    high = np.minimum(one[:, None, 2:], other[None, :, 2:])
    size = high - low + pixel
    shared = np.where((size > 0).all(axis=2), size[..., 0] * size[..., 1], 0.0)
    area_one = np.prod(one[:, 2:] - one[:, :2] + pixel, axis=1)[:, None]
    area_other = np.prod(other[:, 2:] - other[:, :2] + pixel, axis=1)[None, :]
    union = area_one + area_other - shared
    with np.errstate(divide="ignore", invalid="ignore"):
        over_union = np.where(shared > 0, shared / union, 0.0)
        over_one = np.where(shared > 0, shared / area_one, 0.0)
    return over_union, over_one


def match(boxes: NDArray[np.float64], truth: GroundTruth, rule: Rule, iou_threshold: float) -> NDArray[np.int8]:
    """Judge the detections of one class in one image.

    Args:
        boxes: (M, 4), highest score first.
        truth: objects and ignored regions of this class.
        rule: ``"paper"`` or ``"coco"``.
        iou_threshold: least intersection over union of a right detection, in (0, 1].

    Returns:
        (M,) `TRUE_POSITIVE`, `FALSE_POSITIVE` or `IGNORED`.
    """
    verdict = np.full(len(boxes), FALSE_POSITIVE, dtype=np.int8)
    if len(boxes) == 0 or len(truth.boxes) == 0:
        return verdict
    over_union, inside = overlaps(boxes, truth.boxes, pixel=1.0 if rule == "paper" else 0.0)
    if rule == "paper":
        _claim_best(verdict, over_union, truth.ignore, iou_threshold)
    else:
        _claim_free(verdict, over_union[:, ~truth.ignore], iou_threshold)
    excused = (inside[:, truth.ignore] >= IGNORED_FRACTION).any(axis=1)
    verdict[(verdict == FALSE_POSITIVE) & excused] = IGNORED
    return verdict


def _claim_best(
    verdict: NDArray[np.int8], over_union: NDArray[np.float64], ignore: NDArray[np.bool_], iou_threshold: float
) -> None:
    """Each detection claims the object it overlaps most, claimed already or not; of equal ones the first."""
    claimed = np.zeros(over_union.shape[1], dtype=bool)
    for index, best in enumerate(over_union.argmax(axis=1)):
        if over_union[index, best] < iou_threshold:
            continue
        if ignore[best]:
            verdict[index] = IGNORED
        elif not claimed[best]:
            verdict[index] = TRUE_POSITIVE
            claimed[best] = True


def _claim_free(verdict: NDArray[np.int8], over_union: NDArray[np.float64], iou_threshold: float) -> None:
    """Each detection claims the free object it overlaps most; of equal ones the last, as pycocotools does."""
    least = min(iou_threshold, 1.0 - 1e-10)
    free = over_union.copy()
    count = free.shape[1]
    for index in range(len(free)):
        if count == 0:
            return
        best = count - 1 - int(free[index, ::-1].argmax())
        if free[index, best] >= least:
            verdict[index] = TRUE_POSITIVE
            free[:, best] = -1.0
