"""YOLOv4 (Bochkovskiy, Wang, Liao, 2020, arXiv:2004.10934) from the ONNX Model Zoo's file, the paper's first detector.

Input: red, green, blue divided by 255, (1, side, side, 3); the image is scaled to fit the middle (sizes rounded
down), the rest filled with 128 / 255. Output: three maps (1, g, g, 3, 5 + classes) of stride 8, 16 and 32, with three
anchors each::

    centre = ((sigmoid(xy) - 1/2) * s + 1/2 + cell) * stride,   s = 1.2, 1.1, 1.05
    size   = exp(wh) * anchor,   score = objectness * best class

Objectness and classes leave the network as probabilities. ``mode="paper"`` repeats the authors' program: 8-bit
resizing, scores above 0.5, suppression at an overlap of 0.213, margins un-rounded on the way back (up to half a canvas
pixel from those on the way in), corners clipped to the last pixel and cut to whole numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from pipeline.camera.quantise import to_8bit
from pipeline.detection import coco
from pipeline.detection.base import Detections, each_image
from pipeline.detection.letterbox import Placement
from pipeline.detection.modes import Limits, Mode, limits
from pipeline.detection.onnx_model import OnnxModel
from pipeline.detection.yolo import ANCHORS_PX, STRIDES, scored
from pipeline.errors import InputError

if TYPE_CHECKING:
    from pipeline.detection.base import Images

XY_SCALE = (1.2, 1.1, 1.05)
FILL_DN = 128.0
PAPER = Limits(score_floor=0.5, iou_threshold=0.213, max_detections=3 * 52 * 52)
_LARGEST_LOG = 20.0


class Yolov4:
    """YOLOv4 detector on the CPU.

    Args:
        weights: ONNX file with the input and outputs of the Model Zoo's ``yolov4.onnx``.
        mode: ``"full"`` keeps scores above 0.01, suppresses at 0.5 and keeps 300 boxes; ``"paper"``, see above.
        threads: CPU threads.
        score_floor: instead of the mode's; a box must score more, [0, 1].
        iou_threshold: instead of the mode's, [0, 1].
        max_detections: instead of the mode's.
        labels: class names in the network's order.
        sha256: expected hash of the file, or None.

    Raises:
        InputError: an option out of range, or a file that is missing, broken or no YOLOv4 with these classes.
    """

    def __init__(
        self,
        weights: str | Path,
        mode: Mode = "full",
        threads: int = 1,
        score_floor: float | None = None,
        iou_threshold: float | None = None,
        max_detections: int | None = None,
        labels: Sequence[str] = coco.NAMES,
        sha256: str | None = None,
    ) -> None:
        self.limits = limits(mode, PAPER, score_floor, iou_threshold, max_detections)
        self.mode = mode
        self.labels = np.asarray(labels, dtype=np.str_)
        self.model = OnnxModel(weights, threads, sha256)
        # Axes 2 and 3 of this input are width and channels, not height and width.
        side, channels = self.model.own_size or (0, 0)
        if channels != 3 or side < STRIDES[-1] or side % STRIDES[-1]:
            raise InputError(
                f"{weights}: expected an input of (1, side, side, 3) with a fixed side in multiples of {STRIDES[-1]};"
                " not the YOLOv4 of the ONNX Model Zoo"
            )
        self.side_px = side
        self._raw(np.zeros((side, side), dtype=np.float32))  # a wrong file is told at once

    def detect(self, images: Images) -> list[Detections]:
        """See `pipeline.detection.base.Detector.detect`."""
        return [self._detect(image) for image in each_image(images)]

    def _detect(self, image: NDArray[np.float32]) -> Detections:
        paper = self.mode == "paper"
        canvas, placement = canvas_of(to_8bit(image) if paper else image * np.float32(255.0), self.side_px, paper)
        rows = self._raw(canvas)
        kind, score = scored(rows)
        boxes = placement.undo(decode(rows[:, :4], self.side_px))
        if paper:
            boxes[:, 2:] = np.minimum(boxes[:, 2:], [image.shape[1] - 1, image.shape[0] - 1])
        chosen = self.limits.select(boxes, score, kind, above=True)
        result = np.trunc(boxes[chosen]) if paper else boxes[chosen]
        return Detections.of(result, np.clip(score[chosen], 0.0, 1.0), self.labels[kind[chosen]])

    def _raw(self, canvas: NDArray[np.floating]) -> NDArray[np.float32]:
        """The network's rows (anchors of all cells, 5 + classes) for a canvas (side, side) in DN, finest map first."""
        red_green_blue = np.repeat((canvas / 255.0).astype(np.float32)[None, :, :, None], 3, axis=3)
        outputs = sorted(self.model.run(red_green_blue), key=lambda output: -output.size)
        columns = 5 + len(self.labels)
        expected = [(1, self.side_px // stride, self.side_px // stride, 3, columns) for stride in STRIDES]
        shapes = [output.shape for output in outputs]
        if shapes != expected:
            raise InputError(
                f"{self.model.path}: outputs of shape {shapes}, expected {expected};"
                f" not a YOLOv4 of {len(self.labels)} classes"
            )
        return np.concatenate([output.reshape(-1, columns) for output in outputs])


def canvas_of(
    image: NDArray[np.uint8] | NDArray[np.float32], side_px: int, unrounded: bool
) -> tuple[NDArray[np.floating], Placement]:
    """Fit an image into the middle of a square.

    Args:
        image: (H, W) in DN; 8-bit images are resized in 8 bit.
        side_px: of the square.
        unrounded: take boxes back by margins that are not rounded, as the authors' program does.

    Returns:
        the canvas (side, side) in DN, and where the image lies on it.
    """
    height, width = image.shape
    scale = min(side_px / width, side_px / height)
    inner = (max(1, int(scale * width)), max(1, int(scale * height)))
    x, y = (side_px - inner[0]) // 2, (side_px - inner[1]) // 2
    canvas = np.full((side_px, side_px), FILL_DN)
    canvas[y : y + inner[1], x : x + inner[0]] = cv2.resize(image, inner, interpolation=cv2.INTER_LINEAR)
    if unrounded:
        return canvas, Placement(scale, (side_px - scale * width) / 2, (side_px - scale * height) / 2, width, height)
    return canvas, Placement(scale, x, y, width, height)


def decode(raw: NDArray[np.floating], side_px: int) -> NDArray[np.float64]:
    """The network's numbers as boxes on the canvas.

    Args:
        raw: (M, 4) x, y, w, h of every anchor of every cell: finest map first, row by row, anchors innermost.
        side_px: of the canvas.

    Returns:
        (M, 4) x1 y1 x2 y2, pixels of the canvas.
    """
    boxes, start = [], 0
    for stride, scale, anchors in zip(STRIDES, XY_SCALE, ANCHORS_PX, strict=True):
        cells = side_px // stride
        part = raw[start : start + 3 * cells * cells].reshape(cells, cells, 3, 4).astype(np.float64)
        start += 3 * cells * cells
        corner = np.stack(np.meshgrid(np.arange(cells), np.arange(cells)), axis=-1)[:, :, None]
        centre = ((expit(part[..., :2]) - 0.5) * scale + 0.5 + corner) * stride
        half = 0.5 * np.exp(np.minimum(part[..., 2:], _LARGEST_LOG)) * anchors
        boxes.append(np.concatenate([centre - half, centre + half], axis=-1).reshape(-1, 4))
    return np.concatenate(boxes)
