"""What a data set's words mean to a detector: which objects it must find, and which it may find or not.

A detector that calls a van a car is not wrong enough to be punished, nor right enough to be rewarded: such neighbours
are ignored for that class. Boxes that the data set itself marks as ignored are ignored for their own class, or for
every class if their word has none (KITTI's ``DontCare``).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from pipeline.datasets.frame import Box
from pipeline.detection.matching import GroundTruth


@dataclass(frozen=True)
class ClassMap:
    """Words of a data set and classes of a detector.

    Attributes:
        wanted: data set's word -> class.
        neighbours: data set's word -> classes for which it is ignored.
    """

    wanted: Mapping[str, str]
    neighbours: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def classes(self) -> list[str]:
        """The classes that are judged, sorted."""
        return sorted(set(self.wanted.values()))

    def truth(self, boxes: Iterable[Box], min_height_px: float = 0.0, min_visible_fraction: float = 0.0) -> GroundTruth:
        """What is to be found in a frame.

        Args:
            boxes: of the frame.
            min_height_px: objects less high are ignored.
            min_visible_fraction: objects less visible, in [0, 1], are ignored; an unknown visible share is enough.
        """
        corners: list[tuple[float, float, float, float]] = []
        words: list[str] = []
        ignored: list[bool] = []
        for box in boxes:
            label = self.wanted.get(box.label)
            if label is not None:
                small = box.height_px < min_height_px or box.visible_fraction < min_visible_fraction
                entries = [(label, box.ignore or small)]
            elif box.label in self.neighbours:
                entries = [(label, True) for label in self.neighbours[box.label]]
            else:
                entries = [(label, True) for label in self.classes] if box.ignore else []
            for label, ignore in entries:
                corners.append((box.x1, box.y1, box.x2, box.y2))
                words.append(label)
                ignored.append(ignore)
        return GroundTruth(
            np.asarray(corners, dtype=np.float64).reshape(-1, 4),
            np.asarray(words, dtype=np.str_),
            np.asarray(ignored, dtype=bool),
        )


def bare(word: str) -> str:
    """A word without case and plural, as those that differ in nothing else are mistaken for one another."""
    return word.casefold().removesuffix("s")


CLASS_MAPS: Mapping[str, ClassMap] = {
    "sim": ClassMap({"car": "car", "person": "person"}),
    "kitti": ClassMap(
        {"Car": "car", "Pedestrian": "person"},
        {"Van": ("car",), "Truck": ("car",), "Tram": ("car",), "Cyclist": ("person",), "Person_sitting": ("person",)},
    ),
    "udacity": ClassMap({"car": "car", "pedestrian": "person"}, {"truck": ("car",), "biker": ("person",)}),
}
"""By data set. Folders of a user's own images use ``sim``: words as COCO has them."""
