"""The compact detectors as everyone calls them: a weight file in, boxes out.

Frames keep their own pixels (or are scaled by `scale`) and are filled up to multiples of 32. Trained by the stage
`train_detector` on sharp *Sim* frames; classes car, person and bicycle.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pipeline.detection.base import Detections, each_image
from pipeline.errors import InputError
from pipeline.learning.inference import inference
from pipeline.project_files import located
from pipeline.scenes.labels import LABELS
from pipeline.weight_files import active

if TYPE_CHECKING:
    import torch

    from pipeline.detection.base import Images

    Candidates = Callable[[Any, torch.Tensor, float], tuple[torch.Tensor, ...]]

COARSEST = 32
FILL = 114 / 255


class Compact:
    """One-stage detector.

    Args:
        weights: file written by the stage `train_detector`; None for the released one.
        scale: network pixels per image pixel.
        score_floor: detections below this score are dropped, [0, 1].
        iou_threshold: intersection over union above which the weaker box of a class is dropped, [0, 1].
        max_detections: boxes kept per image at most.

    Raises:
        InputError: an option out of range, or a file that is missing, broken or of another network.
    """

    released_file: ClassVar[str] = "data/weights/detector_compact.safetensors"
    labels: ClassVar[tuple[str, ...]] = LABELS

    def __init__(
        self,
        weights: str | Path | None = None,
        scale: float = 1.0,
        score_floor: float = 0.01,
        iou_threshold: float = 0.5,
        max_detections: int = 300,
    ) -> None:
        for name, value in (("score_floor", score_floor), ("iou_threshold", iou_threshold)):
            if not 0.0 <= value <= 1.0:
                raise InputError(f"{name}: expected a number in [0, 1], not {value!r}")
        if max_detections < 1:
            raise InputError(f"max_detections: expected at least 1, not {max_detections!r}")
        if not 0.05 <= scale <= 20:
            raise InputError(f"scale: expected a number in [0.05, 20], not {scale!r}")
        self.weights, self.scale = Path(weights or active(located(self.released_file))), scale
        self.score_floor, self.iou_threshold, self.max_detections = score_floor, iou_threshold, max_detections
        self._model: Any = None
        self.released = False
        self._open()  # a wrong file is told at once

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_model": None}

    def detect(self, images: Images) -> list[Detections]:
        """See `pipeline.detection.base.Detector.detect`."""
        return [self._detect(image) for image in each_image(images)]

    def _detect(self, image: NDArray[np.float32]) -> Detections:
        from pipeline.detection.letterbox import letterbox

        network, candidates = self._open()
        height, width = (max(1, round(side * self.scale)) for side in image.shape)
        inner, placement = letterbox(image, width, height, FILL) if self.scale != 1 else (image, None)
        with inference():
            raw = candidates(network, filled(inner), self.score_floor)
        return to_detections(raw, image.shape, self.iou_threshold, self.max_detections, placement)

    def _open(self) -> Any:
        if self._model is None:
            from pipeline.learning import weights

            model, architecture, candidates = weights.untrained(self._network)
            self.released = bool(weights.into(model, self.weights, architecture)["released"])
            self._model = (model.eval(), candidates)
        return self._model

    def _network(self) -> tuple[torch.nn.Module, str, Candidates]:
        """The network without weights, its architecture, and how its output becomes candidates."""
        from pipeline.detection.compact import one_stage

        return one_stage.OneStage(len(LABELS)), one_stage.ARCHITECTURE, one_stage.candidates


def filled(image: NDArray[np.float32]) -> torch.Tensor:
    """An image (H, W) as the networks take it: (1, 1, H', W'), grey to the right and below up to multiples of 32."""
    import torch

    height, width = (-(-side // COARSEST) * COARSEST for side in image.shape)
    canvas = np.full((height, width), FILL, np.float32)
    canvas[: image.shape[0], : image.shape[1]] = image
    return torch.from_numpy(canvas)[None, None].contiguous(memory_format=torch.channels_last)


def to_detections(
    raw: tuple[torch.Tensor, ...],
    shape: tuple[int, ...],
    iou_threshold: float,
    max_detections: int,
    placement: Any = None,
) -> Detections:
    """Candidates as detections in an image: back in its pixels, clipped to it, the weaker of two alike dropped.

    Args:
        raw: boxes (M, 4), scores (M,) and class numbers (M,).
        shape: height and width of the image.
        iou_threshold: see `Compact`.
        max_detections: see `Compact`.
        placement: where the image lies on what the network saw; None where they are the same.
    """
    from pipeline.detection.nms import suppress

    box, score, kind = (part.numpy() for part in raw)
    box = box.astype(np.float64) if placement is None else placement.undo(box)
    box = np.clip(box, 0.0, [shape[1], shape[0], shape[1], shape[0]])
    real = (box[:, 2] > box[:, 0]) & (box[:, 3] > box[:, 1])
    box, score, kind = box[real], score[real].astype(np.float64), kind[real]
    kept = suppress(box, score, kind, iou_threshold, max_detections)
    return Detections.of(box[kept], score[kept], np.asarray(LABELS, dtype=np.str_)[kind[kept]])
