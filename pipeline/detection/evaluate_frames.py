"""Average precision of a detector on labelled frames, sharp or corrupted."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from pipeline.datasets.frame import Frame
from pipeline.detection.average_precision import ClassResult, evaluate
from pipeline.detection.base import Detections, Detector
from pipeline.detection.classes import ClassMap
from pipeline.detection.matching import Rule
from pipeline.errors import InputError


def evaluate_frames(
    frames: Sequence[Frame],
    detector: Detector,
    class_map: ClassMap,
    min_height_px: float = 0.0,
    min_visible_fraction: float = 0.0,
    rule: Rule = "paper",
    iou_threshold: float = 0.5,
    generator: np.random.Generator | None = None,
    image: Callable[[Frame], NDArray[np.float32]] = Frame.image,
) -> dict[str, ClassResult]:
    """Run a detector on frames and judge it.

    Args:
        frames: with their boxes.
        detector: finds objects.
        class_map: what the frames' words mean.
        min_height_px: objects less high are ignored.
        min_visible_fraction: objects less visible, in [0, 1], are ignored.
        rule: ``"paper"`` or ``"coco"``, see `pipeline.detection.matching`.
        iou_threshold: least intersection over union of a right detection.
        generator: for bootstrap intervals, or None for none.
        image: how a frame becomes (H, W) float32 in [0, 1]; give a function that corrupts it to judge that.

    Returns:
        results by class.

    Raises:
        InputError: there is no frame.
    """
    if not frames:
        raise InputError("frames: none given; an average precision needs at least one labelled frame")
    results = [detector.detect([image(frame)])[0] for frame in frames]
    return evaluate_found(
        frames, results, class_map, min_height_px, min_visible_fraction, rule, iou_threshold, generator
    )


def evaluate_found(
    frames: Sequence[Frame],
    found: Sequence[Detections],
    class_map: ClassMap,
    min_height_px: float = 0.0,
    min_visible_fraction: float = 0.0,
    rule: Rule = "paper",
    iou_threshold: float = 0.5,
    generator: np.random.Generator | None = None,
) -> dict[str, ClassResult]:
    """Judge detections that were made before.

    Args:
        frames: with their boxes.
        found: one entry per frame, in the same order.
        class_map: see `evaluate_frames`, as all the rest.
        min_height_px: objects less high are ignored.
        min_visible_fraction: objects less visible are ignored.
        rule: ``"paper"`` or ``"coco"``.
        iou_threshold: least intersection over union of a right detection.
        generator: for bootstrap intervals, or None for none.

    Returns:
        results by class.
    """
    truths = [class_map.truth(frame.boxes, min_height_px, min_visible_fraction) for frame in frames]
    return evaluate(found, truths, class_map.classes, rule, iou_threshold, generator)
