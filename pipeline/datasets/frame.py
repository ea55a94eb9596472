"""The one contract of every dataset: a frame with its boxes."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

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
    def width_px(self) -> float:
        return self.x2 - self.x1

    @property
    def height_px(self) -> float:
        return self.y2 - self.y1


@dataclass(frozen=True)
class Frame:
    """One frame: where its picture is, its boxes, and the frames just before it.

    Attributes:
        dataset: name of the dataset.
        name: unique within the dataset, stable, fit for a file name; keys the random streams.
        path: the picture.
        boxes: labelled objects.
        previous: pictures of the preceding frames, oldest first (for estimators that average four frames).
    """

    dataset: str
    name: str
    path: Path
    boxes: tuple[Box, ...] = ()
    previous: tuple[Path, ...] = field(default=())

    def image(self) -> np.ndarray:
        """The picture as grey levels: (H, W) float32 in [0, 1]. See `pipeline.datasets.pictures.read_grey`."""
        from pipeline.datasets.pictures import read_grey

        return read_grey(self.path)
