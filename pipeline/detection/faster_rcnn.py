"""Faster R-CNN (Ren, He, Girshick, Sun, 2015) with ResNet-50 and a feature pyramid: the ONNX Model Zoo's file.

``FasterRCNN-10.onnx`` takes one image (3, H, W): blue, green, red in 0..255 minus their means, the shorter side scaled
to 800 px, right and bottom filled with zeros up to multiples of 32. It returns boxes (N, 4) in pixels of the scaled
image, class numbers (N,) where 0 stands for the background, and scores (N,); suppression is part of the network, as is
its own lowest score of 0.05.

``mode="paper"`` repeats the authors' program: 8-bit resizing, scores from 0.5, corners cut to whole numbers and not
clipped. The Model Zoo recommends that no side exceed 1333 px (``longest_px=1333``); the authors set no such limit, so
that a KITTI frame becomes 2650 x 800 px.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.quantise import to_8bit
from pipeline.detection import coco
from pipeline.detection.base import Detections, each_image
from pipeline.detection.modes import Limits, Mode, limits
from pipeline.detection.onnx_model import OnnxFile
from pipeline.errors import InputError

if TYPE_CHECKING:
    from pipeline.detection.base import Images

NAMES = ("__background__", *coco.NAMES)
MEAN_BGR_DN = np.array([102.9801, 115.9465, 122.7717])
SHORTEST_PX = 800
MULTIPLE_PX = 32
FULL = Limits(score_floor=0.0, iou_threshold=1.0, max_detections=300)
PAPER = Limits(score_floor=0.5, iou_threshold=1.0, max_detections=300)


class FasterRcnn:
    """Faster R-CNN detector on the CPU.

    Args:
        weights: ONNX file with the input and outputs of the Model Zoo's ``FasterRCNN-10.onnx``.
        mode: ``"full"`` keeps every box of the network, clipped to the image; ``"paper"``, see above.
        shortest_px: length of the shorter side at the network's input.
        longest_px: limit on the longer side, which then rules; None for no limit.
        threads: CPU threads (the authors' program sets 15).
        score_floor: instead of the mode's, [0, 1].
        max_detections: boxes kept per image at most (the network itself gives 100).
        labels: class names in the network's order, the background first.
        sha256: expected hash of the file, or None.

    Raises:
        InputError: an option out of range, or a file that is missing, broken or no such Faster R-CNN.
    """

    def __init__(
        self,
        weights: str | Path,
        mode: Mode = "full",
        shortest_px: int = SHORTEST_PX,
        longest_px: int | None = None,
        threads: int = 1,
        score_floor: float | None = None,
        max_detections: int | None = None,
        labels: Sequence[str] = NAMES,
        sha256: str | None = None,
    ) -> None:
        self.limits = limits(mode, PAPER, score_floor, None, max_detections, FULL)
        self.mode = mode
        if shortest_px < MULTIPLE_PX:
            raise InputError(f"shortest_px: expected at least {MULTIPLE_PX}, not {shortest_px!r}")
        if longest_px is not None and longest_px < shortest_px:
            raise InputError(f"longest_px: expected at least shortest_px ({shortest_px}), not {longest_px!r}")
        self.shortest_px, self.longest_px = shortest_px, longest_px
        self.labels = np.asarray(labels, dtype=np.str_)
        self.model = _PlainInput(weights, threads, sha256)

    def detect(self, images: Images) -> list[Detections]:
        """See `pipeline.detection.base.Detector.detect`."""
        return [self._detect(image) for image in each_image(images)]

    def _detect(self, image: NDArray[np.float32]) -> Detections:
        paper = self.mode == "paper"
        tensor, scale = self.prepare(image)
        boxes, kind, score = self.model.detections(tensor)
        if len(kind) and not 0 <= kind.min() <= kind.max() < len(self.labels):
            raise InputError(f"{self.model.path}: class number {kind.max()}, but {len(self.labels)} labels")
        boxes = boxes / scale
        boxes = np.trunc(boxes) if paper else np.clip(boxes, 0.0, [image.shape[1], image.shape[0]] * 2)
        real = (boxes[:, 2] > boxes[:, 0]) & (boxes[:, 3] > boxes[:, 1])
        likely = np.flatnonzero((paper | real) & (score >= self.limits.score_floor) & (kind > 0))
        chosen = likely[np.argsort(-score[likely], kind="stable")][: self.limits.max_detections]
        return Detections.of(boxes[chosen], np.clip(score[chosen], 0.0, 1.0), self.labels[kind[chosen]])

    def prepare(self, image: NDArray[np.float32]) -> tuple[NDArray[np.float32], float]:
        """The network's input for an image.

        Args:
            image: (H, W) in [0, 1].

        Returns:
            (3, H', W') float32, and pixels of the input per pixel of the image.
        """
        from PIL import Image

        height, width = image.shape
        scale = float(self.shortest_px) / min(width, height)
        if self.longest_px is not None:
            scale = min(scale, float(self.longest_px) / max(width, height))
        size = (max(1, int(scale * width)), max(1, int(scale * height)))
        # Pillow keeps the kind of number: 8 bit as the authors' program has it, or floats.
        source = to_8bit(image) if self.mode == "paper" else image * np.float32(255.0)
        grey = np.asarray(Image.fromarray(source).resize(size, Image.Resampling.BILINEAR), dtype=np.float32)
        padded = [-(-side // MULTIPLE_PX) * MULTIPLE_PX for side in grey.shape]
        tensor = np.zeros((3, *padded), dtype=np.float32)
        tensor[:, : size[1], : size[0]] = grey - MEAN_BGR_DN[:, None, None]
        return tensor, scale


class _PlainInput(OnnxFile):
    """A network whose image input is (3, H, W), of any size and without a batch axis, and that answers with boxes."""

    def __init__(self, path: str | Path, threads: int, sha256: str | None) -> None:
        super().__init__(path, threads, sha256)
        session = self.session()
        shapes = [entry.shape for entry in session.get_inputs()]
        if len(shapes) != 1 or len(shapes[0]) != 3 or shapes[0][0] != 3:
            raise InputError(f"{self.path}: inputs of shape {shapes}, expected one of (3, height, width); {_NOT}")
        ranks = [len(entry.shape) for entry in session.get_outputs()]
        if ranks != [2, 1, 1]:
            shapes = [entry.shape for entry in session.get_outputs()]
            raise InputError(f"{self.path}: outputs of shape {shapes}, expected boxes (N, 4), labels, scores; {_NOT}")

    def detections(
        self, tensor: NDArray[np.float32]
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
        """Boxes (N, 4) in pixels of the input, class numbers (N,) and scores (N,) for an input (3, H, W)."""
        boxes, labels, scores = self.outputs(tensor)
        if boxes.ndim != 2 or boxes.shape[1] != 4 or not len(boxes) == len(labels) == len(scores):
            raise InputError(f"{self.path}: {boxes.shape} boxes, {labels.shape} labels, {scores.shape} scores; {_NOT}")
        if labels.dtype.kind not in "iu":
            raise InputError(f"{self.path}: labels are {labels.dtype}, expected whole numbers; {_NOT}")
        return boxes.astype(np.float64), labels.astype(np.int64), scores.astype(np.float64)


_NOT = "not the Faster R-CNN of the ONNX Model Zoo"
