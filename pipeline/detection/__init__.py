"""Object detectors, one per file, and how well they do.

>>> from pipeline import detection
>>> detector = detection.create("yolox", weights="yolox_nano.onnx", input_px=1280)
>>> found = detector.detect([image])[0]                  # image: (H, W) float in [0, 1]
>>> found.boxes, found.score, found.label                # (M, 4) x1 y1 x2 y2 in pixels, (M,), (M,)
"""

from __future__ import annotations

import functools
import json
from typing import TYPE_CHECKING, Any

from pipeline.registry import Registry

if TYPE_CHECKING:
    from pipeline.detection.base import Detector

REGISTRY = Registry(
    kind="detector",
    group="pipeline.detection",
    builtin={
        "compact": "pipeline.detection.compact.detector:Compact",
        "compact_two_stage": "pipeline.detection.compact.two_stage_detector:CompactTwoStage",
        "faster_rcnn": "pipeline.detection.faster_rcnn:FasterRcnn",
        "yolov4": "pipeline.detection.yolov4:Yolov4",
        "yolov7": "pipeline.detection.yolov7:Yolov7",
        "yolox": "pipeline.detection.yolox:Yolox",
    },
    method="detect",
)


def create(name: str, **options: Any) -> Detector:
    """A detector by name.

    Args:
        name: one of ``REGISTRY.names()``.
        options: the detector's own, as in its class.

    Raises:
        InputError: unknown name or option, a class without `detect`, or a model file that cannot be used.
    """
    detector: Detector = REGISTRY.create(name, **options)
    return detector


@functools.lru_cache(maxsize=2)
def opened(name: str, options: str) -> Detector:
    """A detector, kept open by each worker process.

    Args:
        name: one of ``REGISTRY.names()``.
        options: the detector's own, as JSON.

    Returns:
        the same detector for the same arguments.

    Raises:
        InputError: see `create`.
    """
    return create(name, **json.loads(options))
