"""What every detector takes and gives."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.arrays import as_array
from pipeline.camera.constants import RANGE_SLACK
from pipeline.errors import InputError

if TYPE_CHECKING:
    import torch

    Images = Sequence[NDArray[np.floating] | torch.Tensor] | NDArray[np.floating] | torch.Tensor


@dataclass(frozen=True)
class Detections:
    """What a detector found in one image.

    Attributes:
        boxes: (M, 4) float64, x1 y1 x2 y2 in pixels, 0-based; a box covers [x1, x2) x [y1, y2).
        score: (M,) float64 in [0, 1].
        label: (M,) str.
    """

    boxes: NDArray[np.float64]
    score: NDArray[np.float64]
    label: NDArray[np.str_]

    @classmethod
    def of(cls, boxes: ArrayLike, score: ArrayLike, label: Sequence[str] | NDArray[np.str_]) -> Detections:
        """Detections from anything array-like; empty input is no detection.

        Raises:
            InputError: lengths differ, boxes are not (M, 4), or a number is not finite.
        """
        box_array = np.asarray(boxes, dtype=np.float64)
        if box_array.size == 0:
            box_array = box_array.reshape(0, 4)
        score_array = np.asarray(score, dtype=np.float64).reshape(-1)
        label_array = np.asarray(label, dtype=np.str_).reshape(-1)
        if box_array.ndim != 2 or box_array.shape[1] != 4:
            raise InputError(f"boxes: expected shape (M, 4), not {box_array.shape}")
        if not len(box_array) == len(score_array) == len(label_array):
            raise InputError(
                f"detections: {len(box_array)} boxes, {len(score_array)} scores and {len(label_array)} labels;"
                " expected as many of each"
            )
        if not (np.isfinite(box_array).all() and np.isfinite(score_array).all()):
            raise InputError("detections: a box or score is not a finite number")
        return cls(box_array, score_array, label_array)

    @classmethod
    def none(cls) -> Detections:
        """No detection."""
        return cls.of([], [], [])

    def __len__(self) -> int:
        return len(self.score)

    def where(self, chosen: NDArray[np.bool_] | NDArray[np.integer]) -> Detections:
        """Those picked by a mask or by indices, in that order."""
        return Detections(self.boxes[chosen], self.score[chosen], self.label[chosen])

    def above(self, score: float) -> Detections:
        """Those with at least this score."""
        return self.where(self.score >= score)

    def best(self, count: int | None = None) -> Detections:
        """Those with the highest scores, at most so many, highest first; in their order where scores are equal.

        Args:
            count: None takes all.
        """
        return self.where(np.argsort(-self.score, kind="stable")[:count])

    def called(self, label: str) -> Detections:
        """Those with this label."""
        return self.where(self.label == label)


class Detector(Protocol):
    """Anything that finds objects in grey images; it may state the words of its labels, as a sequence ``labels``."""

    def detect(self, images: Images) -> list[Detections]:
        """Find objects in each image on its own.

        Args:
            images: images of (H, W), (1, H, W) or (N, 1, H, W), NumPy or torch float in [0, 1], in a sequence; or one
                array of (N, 1, H, W).

        Returns:
            one entry per image, in their order (N for an array of N), highest score first.

        Raises:
            InputError: wrong shape, type or range, or a NaN.
        """
        ...


def each_image(images: Images) -> Iterable[NDArray[np.float32]]:
    """Every image on its own, checked.

    Args:
        images: as for `Detector.detect`.

    Yields:
        (H, W) float32 in [0, 1].

    Raises:
        InputError: with the image that is wrong, and the cause.
    """
    if isinstance(images, np.ndarray) and images.ndim == 2:
        raise InputError("images: expected a sequence; for one picture use [picture]")
    count = 0
    for entry in images:
        if isinstance(entry, np.ma.MaskedArray):
            raise InputError(f"images: image {count} is a masked array; cut it to a rectangle without masked pixels")
        array = np.asarray(as_array(entry))
        if array.dtype.kind != "f":
            raise InputError(
                f"images: image {count} is {array.dtype}, expected floats in [0, 1]; divide 8-bit pictures by 255"
            )
        if array.ndim < 2 or array.ndim > 4 or (array.ndim > 2 and array.shape[-3] != 1) or 0 in array.shape[-2:]:
            raise InputError(f"images: image {count} has shape {array.shape}, expected (H, W) or (N, 1, H, W)")
        for image in array.reshape(-1, *array.shape[-2:]):
            lowest, highest = float(image.min()), float(image.max())
            if not (lowest >= -RANGE_SLACK and highest <= 1.0 + RANGE_SLACK):
                raise InputError(f"images: image {count} spans {lowest:g} .. {highest:g}, expected numbers in [0, 1]")
            yield np.asarray(image, dtype=np.float32)
            count += 1
