"""Non-maximum suppression: of boxes that overlap, keep the best."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray


def suppress(
    boxes: NDArray[np.floating],
    score: NDArray[np.floating],
    kind: NDArray[np.integer],
    iou_threshold: float,
    max_detections: int | None = None,
) -> NDArray[np.int64]:
    """Greedy suppression within each class.

    From the highest score down, a box is dropped when its intersection over union with a kept box of its class exceeds
    the limit.

    Args:
        boxes: (M, 4) x1 y1 x2 y2.
        score: (M,).
        kind: (M,) class numbers.
        iou_threshold: limit on the intersection over union, in [0, 1].
        max_detections: keep so many at most, all classes together; None keeps all.

    Returns:
        indices of the boxes kept, highest score first.
    """
    if len(boxes) == 0:
        return np.zeros(0, dtype=np.int64)
    # OpenCV shifts classes apart by the largest coordinate, which does not part boxes left of 0
    corners = boxes[:, :2] - min(float(boxes[:, :2].min()), 0.0)
    corner_size = np.concatenate([corners, boxes[:, 2:] - boxes[:, :2]], axis=1).astype(np.float64)
    floor = float(score.min()) - 1.0  # OpenCV wants a floor of its own; nothing is to fall below it
    kept = cv2.dnn.NMSBoxesBatched(corner_size.tolist(), score.tolist(), kind.tolist(), floor, iou_threshold)
    order = np.asarray(kept, dtype=np.int64).reshape(-1)
    order = order[np.argsort(-score[order], kind="stable")]
    return order[:max_detections]
