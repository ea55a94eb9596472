"""The one contract of every dataset: a frame with its boxes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.errors import InputError

if TYPE_CHECKING:
    import numpy as np


@dataclass(frozen=True)
class Box:
    """One labelled object.

    Attributes:
        label: the dataset's own word for the class (``"car"``, ``"Pedestrian"``).
        x1, y1, x2, y2: corners, pixels, 0-based; the box covers [x1, x2) x [y1, y2), clipped to the image.
        ignore: a detection here counts neither way, and no patch is taken from it.
        visible_fraction: visible share of the object's area in [0, 1]; NaN where the dataset does not say.
    """

    label: str
    x1: float
    y1: float
    x2: float
    y2: float
    ignore: bool = False
    visible_fraction: float = float("nan")

    @property
    def corners(self) -> tuple[float, float, float, float]:
        """x1, y1, x2, y2, pixels."""
        return self.x1, self.y1, self.x2, self.y2

    @property
    def finite(self) -> bool:
        """Whether all corners are finite numbers."""
        return all(isinstance(value, Real) and math.isfinite(value) for value in self.corners)

    @property
    def width_px(self) -> float:
        return self.x2 - self.x1

    @property
    def height_px(self) -> float:
        return self.y2 - self.y1

    def clipped(self, width_px: int, height_px: int) -> Box | None:
        """The part of the box inside an image of this size, or None where there is none."""
        x1, x2 = max(self.x1, 0.0), min(self.x2, float(width_px))
        y1, y2 = max(self.y1, 0.0), min(self.y2, float(height_px))
        if x2 <= x1 or y2 <= y1:
            return None
        return replace(self, x1=x1, y1=y1, x2=x2, y2=y2)


@dataclass(frozen=True)
class Frame:
    """One frame: where its picture is, its boxes, and the frames just before it.

    Attributes:
        dataset: name of the dataset.
        name: unique within the dataset, stable, fit for a file name; keys the random streams.
        path: the picture.
        boxes: labelled objects.
        previous: pictures of the preceding frames, oldest first (for estimators that average four frames).
        split: the dataset's own part the frame belongs to (``"training"``, ``"evaluation"``), or empty.
        defect: why the frame must not be used (broken or missing labels), or empty. `pipeline.datasets.quarantine`
            leaves such a frame out and counts it.
        notes: what was mended while reading its labels, one entry per occurrence.
        scene: which scene it shows: frames of one scene are no independent samples, and intervals are drawn over
            scenes. Empty where the frame is the only one of its scene.

    Raises:
        InputError: a box, as of a third party's reader, has a corner that is no finite number, x2 < x1 or y2 < y1.
    """

    dataset: str
    name: str
    path: Path
    boxes: tuple[Box, ...] = ()
    previous: tuple[Path, ...] = field(default=())
    split: str = ""
    defect: str = ""
    notes: tuple[str, ...] = ()
    scene: str = ""

    def __post_init__(self) -> None:
        for box in self.boxes:
            if not (box.finite and box.x1 <= box.x2 and box.y1 <= box.y2):
                raise InputError(
                    f"dataset '{self.dataset}': frame '{self.name}' has a box '{box.label}' with the corners "
                    f"{' '.join(map(repr, box.corners))}, expected finite pixels x1 y1 x2 y2 with x1 <= x2 and y1 <= y2"
                )

    def image(self) -> np.ndarray:
        """The picture as grey levels: (H, W) float32 in [0, 1]. See `pipeline.datasets.decoding.pictures.read_grey`."""
        from pipeline.datasets.decoding.pictures import read_grey

        return read_grey(self.path)
