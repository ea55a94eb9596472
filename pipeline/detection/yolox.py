"""YOLOX (Ge, Liu, Wang, Li, Sun, 2021, arXiv:2107.08430) from an ONNX file exported by its authors' program.

Input: blue, green, red in 0..255 (a grey image three times), scaled to fit the top left corner, the rest filled with
114. Output: one row per cell of the grids of stride 8, 16, 32 (row by row)::

    centre = (xy + cell) * stride,   size = exp(wh) * stride,   score = objectness * best class

Boxes of one class that overlap by more than one half are suppressed. Scores are kept from 0.01, so that precision and
recall can be followed to the end; choose a working point with `Detections.above`.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pipeline.detection import coco
from pipeline.detection.base import Detections, each_image
from pipeline.detection.letterbox import letterbox
from pipeline.detection.modes import FULL, limits
from pipeline.detection.onnx_model import OnnxModel
from pipeline.detection.yolo import STRIDES, scored
from pipeline.errors import InputError

if TYPE_CHECKING:
    from pipeline.detection.base import Images

FILL_DN = 114.0


class Yolox:
    """YOLOX detector on the CPU.

    Args:
        weights: ONNX file.
        input_px: length of the longer side at the network's input (each image keeps its proportions and is padded to
            multiples of 32); or (width, height), multiples of 32; or None for the file's own size.
        threads: CPU threads.
        score_floor: detections below this score are dropped, [0, 1].
        iou_threshold: intersection over union above which the weaker box is dropped, [0, 1].
        max_detections: boxes kept per image at most.
        labels: class names in the network's order.
        sha256: expected hash of the file, or None.

    Raises:
        InputError: an option out of range, or a file that is missing, broken or no YOLOX with these classes.
    """

    def __init__(
        self,
        weights: str | Path,
        input_px: int | tuple[int, int] | None = None,
        threads: int = 1,
        score_floor: float = FULL.score_floor,
        iou_threshold: float = FULL.iou_threshold,
        max_detections: int = FULL.max_detections,
        labels: Sequence[str] = coco.NAMES,
        sha256: str | None = None,
    ) -> None:
        self.limits = limits("full", FULL, score_floor, iou_threshold, max_detections)
        self.input_px = _checked_input(input_px)
        self.labels = np.asarray(labels, dtype=np.str_)
        self.model = OnnxModel(weights, threads, sha256)
        if self.input_px is None and self.model.own_size is None:
            raise InputError(f"{weights}: the file leaves its input size open; give input_px")
        height, width = self.model.own_size or (STRIDES[-1], STRIDES[-1])
        self._raw(np.zeros((height, width), dtype=np.float32))  # a wrong file is told at once

    def detect(self, images: Images) -> list[Detections]:
        """See `pipeline.detection.base.Detector.detect`."""
        return [self._detect(image) for image in each_image(images)]

    def _detect(self, image: NDArray[np.float32]) -> Detections:
        width, height = self.canvas_px(image.shape[1], image.shape[0])
        canvas, placement = letterbox(image * np.float32(255.0), width, height, FILL_DN)
        rows = self._raw(canvas)
        kind, score = scored(rows)
        likely = np.flatnonzero(score >= self.limits.score_floor)
        boxes = placement.undo(decode(rows[likely, :4], likely, width, height))
        kept = self.limits.select(boxes, score[likely], kind[likely])
        chosen = likely[kept]
        return Detections.of(boxes[kept], score[chosen], self.labels[kind[chosen]])

    def canvas_px(self, width_px: int, height_px: int) -> tuple[int, int]:
        """Width and height of the network's input for an image of this size."""
        if self.input_px is None:
            height, width = self.model.own_size or (0, 0)
            return width, height
        if isinstance(self.input_px, tuple):
            return self.input_px
        scale = self.input_px / max(width_px, height_px)
        return _whole_cells(width_px * scale), _whole_cells(height_px * scale)

    def _raw(self, canvas: NDArray[np.float32]) -> NDArray[np.float32]:
        """The network's rows (cells, 5 + classes) for a canvas (H, W) in DN."""
        height, width = canvas.shape
        outputs = self.model.run(np.ascontiguousarray(np.broadcast_to(canvas, (1, 3, height, width))))
        expected = (1, len(grid(width, height)[1]), 5 + len(self.labels))
        if len(outputs) != 1 or outputs[0].shape != expected:
            raise InputError(
                f"{self.model.path}: outputs of shape {[output.shape for output in outputs]} for an input of {width} x"
                f" {height} px, expected one of {expected}; not a YOLOX of {len(self.labels)} classes"
            )
        return outputs[0][0]


def decode(raw: NDArray[np.float32], cells: NDArray[np.integer], width_px: int, height_px: int) -> NDArray[np.float64]:
    """The network's numbers as boxes on the canvas.

    Args:
        raw: (M, 4) x, y, log w, log h in units of the cell.
        cells: (M,) row numbers of the network's output.
        width_px: of the canvas.
        height_px: of the canvas.

    Returns:
        (M, 4) x1 y1 x2 y2, pixels of the canvas.
    """
    corner, stride = grid(width_px, height_px)
    centre = (raw[:, :2].astype(np.float64) + corner[cells]) * stride[cells, None]
    half = 0.5 * np.exp(np.minimum(raw[:, 2:].astype(np.float64), 20.0)) * stride[cells, None]
    return np.concatenate([centre - half, centre + half], axis=1)


@functools.lru_cache(maxsize=8)
def grid(width_px: int, height_px: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Column and row (cells, 2) and stride in pixels (cells,) of every cell, in the network's order."""
    corners, strides = [], []
    for stride in STRIDES:
        y, x = np.mgrid[: height_px // stride, : width_px // stride]
        corners.append(np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float64))
        strides.append(np.full(x.size, float(stride)))
    return np.concatenate(corners), np.concatenate(strides)


def _whole_cells(length_px: float) -> int:
    """Rounded to a pixel, then up to a multiple of the largest stride."""
    return max(1, -(-round(length_px) // STRIDES[-1])) * STRIDES[-1]


def _checked_input(input_px: int | Sequence[int] | None) -> int | tuple[int, int] | None:
    if input_px is None:
        return None
    sides = [input_px] if isinstance(input_px, int) else list(input_px)
    good = len(sides) in (1, 2) and all(isinstance(side, int) and side >= STRIDES[-1] for side in sides)
    if not isinstance(input_px, int):
        good = good and len(sides) == 2 and all(side % STRIDES[-1] == 0 for side in sides)
    if not good:
        raise InputError(
            f"input_px: expected the longer side in pixels (at least {STRIDES[-1]}), or (width, height) in multiples of"
            f" {STRIDES[-1]}, not {input_px!r}"
        )
    return input_px if isinstance(input_px, int) else (sides[0], sides[1])
