"""YOLOv7 (Wang, Bochkovskiy, Liao, CVPR 2023) from ONNX files made by its authors' ``export.py``.

Input: red, green, blue divided by 255, (1, 3, H, W); the image is scaled to fit the middle, the rest filled with
114 / 255. How the output is read follows from its shape, never from its name:

=====================  =============================  =========================================================
output                 exported with                  read as
=====================  =============================  =========================================================
(N, 7)                 ``--grid --end2end --max-wh``  image, x1, y1, x2, y2, class, score; suppressed already
(1, cells, 5 + K)      ``--grid``                     centre, size in pixels, objectness, classes; all decoded
3 of (1, 3, g, g, ..)  neither                        logits, t = sigmoid(...): centre = (2 t - 1/2 + cell) * stride,
                                                      size = (2 t)^2 * anchor
=====================  =============================  =========================================================

Anything else is refused. Score = objectness * best class. The first form carries the thresholds of its export (0.35
unless told otherwise), which cut a precision-recall curve short; prefer the second for average precision.

``mode="paper"`` keeps what the official export keeps (score 0.35, overlap 0.65, 100 boxes): the paper names YOLOv7 but
prints no thresholds.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from pipeline.detection import coco
from pipeline.detection.base import Detections, each_image
from pipeline.detection.letterbox import letterbox
from pipeline.detection.modes import Limits, Mode, limits
from pipeline.detection.onnx_model import OnnxModel
from pipeline.detection.yolo import ANCHORS_PX, STRIDES, scored
from pipeline.errors import InputError

if TYPE_CHECKING:
    from pipeline.detection.base import Images

FILL_DN = 114.0
PAPER = Limits(score_floor=0.35, iou_threshold=0.65, max_detections=100)
SUPPRESSED_COLUMNS = 7
EXPORT = "export again with --grid (or with --grid --end2end --max-wh 640)"


class Yolov7:
    """YOLOv7 detector on the CPU.

    Args:
        weights: ONNX file of the official export.
        mode: ``"full"`` keeps scores from 0.01, suppresses at 0.5 and keeps 300 boxes; ``"paper"``, see above. Boxes
            that the file has already suppressed are not suppressed again.
        input_px: (width, height) of the input in multiples of 32, for files that leave it open; None for the file's.
        threads: CPU threads.
        score_floor: instead of the mode's, [0, 1].
        iou_threshold: instead of the mode's, [0, 1].
        max_detections: instead of the mode's.
        labels: class names in the network's order.
        sha256: expected hash of the file, or None.

    Raises:
        InputError: an option out of range, or a file that is missing, broken or no YOLOv7 with these classes.
    """

    def __init__(
        self,
        weights: str | Path,
        mode: Mode = "full",
        input_px: Sequence[int] | None = None,
        threads: int = 1,
        score_floor: float | None = None,
        iou_threshold: float | None = None,
        max_detections: int | None = None,
        labels: Sequence[str] = coco.NAMES,
        sha256: str | None = None,
    ) -> None:
        self.limits = limits(mode, PAPER, score_floor, iou_threshold, max_detections)
        self.labels = np.asarray(labels, dtype=np.str_)
        self.model = _opened(weights, threads, sha256)
        self.width_px, self.height_px = _input_size(self.model, input_px)
        self._found(np.zeros((self.height_px, self.width_px), dtype=np.float32))  # a wrong file is told at once

    def detect(self, images: Images) -> list[Detections]:
        """See `pipeline.detection.base.Detector.detect`."""
        return [self._detect(image) for image in each_image(images)]

    def _detect(self, image: NDArray[np.float32]) -> Detections:
        canvas, placement = letterbox(image * np.float32(255.0), self.width_px, self.height_px, FILL_DN, centred=True)
        boxes, score, kind, suppressed = self._found(canvas)
        boxes = placement.undo(boxes)
        chosen = self.limits.select(boxes, score, kind, suppressed=suppressed)
        return Detections.of(boxes[chosen], np.clip(score[chosen], 0.0, 1.0), self.labels[kind[chosen]])

    def _found(
        self, canvas: NDArray[np.float32]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64], bool]:
        """Boxes (M, 4) on the canvas, scores (M,), class numbers (M,), and whether they are suppressed already."""
        height, width = canvas.shape
        image = np.ascontiguousarray(np.broadcast_to(canvas / np.float32(255.0), (1, 3, height, width)))
        outputs = self.model.run(image)
        rows = self._rows(outputs)
        if rows is None:
            (result,) = outputs
            kind = result[:, 5].astype(np.int64)
            if len(kind) and not 0 <= kind.min() <= kind.max() < len(self.labels):
                raise InputError(f"{self.model.path}: class number {kind.max()}, but {len(self.labels)} labels")
            return result[:, 1:5].astype(np.float64), result[:, 6].astype(np.float64), kind, True
        kind, score = scored(rows)
        half = rows[:, 2:4] / 2
        boxes = np.concatenate([rows[:, :2] - half, rows[:, :2] + half], axis=1)
        return boxes, score, kind, False

    def _rows(self, outputs: list[NDArray[np.float32]]) -> NDArray[np.float64] | None:
        """Decoded rows (cells, 5 + classes) from either raw form, or None if the boxes are suppressed already.

        Raises:
            InputError: none of the three forms.
        """
        shapes, columns = [output.shape for output in outputs], 5 + len(self.labels)
        maps = [(1, 3, self.height_px // stride, self.width_px // stride, columns) for stride in STRIDES]
        whole = (1, sum(3 * shape[2] * shape[3] for shape in maps), columns)
        if len(shapes) == 1 and len(shapes[0]) == 2 and shapes[0][1] == SUPPRESSED_COLUMNS:
            return None
        # Older states of the export give the three maps beside the decoded rows.
        if whole in shapes and all(shape in maps for shape in shapes if shape != whole):
            return outputs[shapes.index(whole)][0].astype(np.float64)
        if sorted(shapes) == sorted(maps):
            return np.concatenate([decode(outputs[shapes.index(shape)], level) for level, shape in enumerate(maps)])
        if len(shapes) == 4 and any("int" in str(output.dtype) for output in outputs):
            raise InputError(f"{self.model.path}: four outputs, as exported for TensorRT; {EXPORT}")
        raise InputError(
            f"{self.model.path}: outputs of shape {shapes} for an input of {self.width_px} x {self.height_px} px;"
            f" expected (N, {SUPPRESSED_COLUMNS}), {whole} or {maps}: not a YOLOv7 of {len(self.labels)} classes,"
            f" or {EXPORT}"
        )


def decode(raw: NDArray[np.float32], level: int) -> NDArray[np.float64]:
    """One map of logits as rows in pixels of the canvas.

    Args:
        raw: (1, 3, rows, columns, 5 + classes).
        level: 0, 1, 2 for stride 8, 16, 32.

    Returns:
        (3 * rows * columns, 5 + classes): centre and size in pixels, objectness and classes in [0, 1].
    """
    numbers = expit(raw[0].astype(np.float64))
    cells = np.stack(np.meshgrid(np.arange(raw.shape[3]), np.arange(raw.shape[2])), axis=-1)
    numbers[..., :2] = (2 * numbers[..., :2] - 0.5 + cells) * STRIDES[level]
    numbers[..., 2:4] = (2 * numbers[..., 2:4]) ** 2 * ANCHORS_PX[level][:, None, None]
    rows: NDArray[np.float64] = numbers.reshape(-1, raw.shape[-1])
    return rows


def _opened(weights: str | Path, threads: int, sha256: str | None) -> OnnxModel:
    """The model; files for TensorRT, which ONNX Runtime cannot open, get a hint of their own."""
    try:
        return OnnxModel(weights, threads, sha256)
    except InputError as error:
        if "TRT" in str(error):
            raise InputError(f"{weights}: exported for TensorRT, which cannot run here; {EXPORT}") from error
        raise


def _input_size(model: OnnxModel, input_px: Sequence[int] | None) -> tuple[int, int]:
    """Width and height of the input: the file's, or the one asked for where the file leaves it open."""
    if input_px is not None:
        sides = list(input_px) if isinstance(input_px, Sequence) else []
        if len(sides) != 2 or not all(isinstance(side, int) and side >= 32 and side % 32 == 0 for side in sides):
            raise InputError(f"input_px: expected (width, height) in multiples of 32, not {input_px!r}")
        if model.own_size not in (None, (sides[1], sides[0])):
            raise InputError(
                f"input_px: {model.path} is fixed to {model.own_size[1]} x {model.own_size[0]} px"
                f" (its grid is a constant); leave input_px unset or export again with --img-size {sides[1]} {sides[0]}"
            )
        return sides[0], sides[1]
    if model.own_size is None:
        raise InputError(f"{model.path}: the file leaves its input size open; give input_px")
    height, width = model.own_size
    if height % 32 or width % 32 or min(height, width) < 32:
        raise InputError(f"{model.path}: its input is {width} x {height} px, expected multiples of 32; not a YOLOv7")
    return width, height
