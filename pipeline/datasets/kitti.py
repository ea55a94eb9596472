"""KITTI object detection (Geiger, Lenz, Urtasun, CVPR 2012), in its original layout.

::

    <root>/training/image_2/NNNNNN.png        left colour camera, about 1242x375
    <root>/training/label_2/NNNNNN.txt        one object a line, 15 fields
    <root>/training/prev_2/NNNNNN_01.png      the frame just before; _02 and _03 the ones before that (optional)

Each picture needs a label file, which may be empty (noted), and each label file a picture. Pictures may be converted:
their suffixes need not be ``.png``, nor that of a preceding frame that of its frame.

Fields: type, truncated (0 to 1), occluded (0 to 3), alpha, left, top, right, bottom (pixels, 0-based, may reach past
a cropped image), height, width, length, x, y, z, rotation_y. Class words are kept as they are in the file.

What the paper counts as usable: cars under 25 px high, or truncated by more than 0.5, become ignored, as do regions
marked DontCare and Misc. (Found by comparing the authors' labels with the originals: 27 objects, none contradicts.)

Licence: CC BY-NC-SA 3.0 (non-commercial). https://www.cvlibs.net/datasets/kitti/eval_object.php
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import ClassVar

from pipeline.datasets.dataset import Dataset, pictures_in
from pipeline.datasets.frame import Box, Frame
from pipeline.datasets.labels import NO_BOX, BadLabels, numbers, read_lines, refuse_reversed
from pipeline.errors import InputError

FIELDS = 15
LOWEST_CAR_PX = 25.0
MOST_TRUNCATED = 0.5
_ALWAYS_IGNORED = {"DontCare", "Misc"}


class Kitti(Dataset):
    """KITTI object frames; see the module for layout, rules and licence. Arguments as `Dataset`."""

    kind: ClassVar[str] = "kitti"
    source: ClassVar[str] = (
        "'camera-monitor download kitti' gets images and labels. Or get 'left color images of object data set', "
        "'training labels' and, for four-frame estimates, '3 temporally preceding frames (left color)' from "
        "https://www.cvlibs.net/datasets/kitti/eval_object.php and unpack them into one folder (training/image_2, "
        "training/label_2, training/prev_2)."
    )
    classes: ClassVar[frozenset[str] | None] = frozenset(
        {"Car", "Van", "Truck", "Pedestrian", "Person_sitting", "Cyclist", "Tram", "Misc", "DontCare"}
    )

    @property
    def searched(self) -> Path:
        """The folder that the pictures lie in."""
        return self.root / "training" / "image_2"

    def _read(self) -> Iterable[Frame]:
        images, labels = self._part("training", "image_2"), self._part("training", "label_2")
        pictures, before = pictures_in(images), self._preceding(self.root / "training" / "prev_2")
        for path in pictures:
            boxes: list[Box] = []
            defect = ""
            try:
                boxes = read_kitti_labels(labels / f"{path.stem}.txt")
            except BadLabels as error:
                defect = str(error)
            notes = () if boxes or defect else (NO_BOX,)
            previous = _previous(before, path.stem)
            yield self._frame(path, boxes, previous=previous, split="training", defect=defect, notes=notes)
        yield from self._without_picture(labels, pictures)

    def _preceding(self, folder: Path) -> dict[str, Path]:
        """Preceding pictures by name, of any format that is read; none without their folder."""
        pictures = pictures_in(folder) if folder.is_dir() else []
        by_stem = {path.stem: path for path in pictures}
        for path in pictures:
            if by_stem[path.stem] != path:
                raise InputError(f"dataset '{self.name}': two pictures are called '{path.stem}' in {folder}; keep one")
        return by_stem


def read_kitti_labels(path: Path) -> list[Box]:
    """The boxes of one label file, not yet clipped, ignored by the paper's rule.

    Raises:
        BadLabels: the file is missing, or a line does not have 15 fields, numbers where they belong, or left <= right
            and top <= bottom.
    """
    boxes = []
    for line, where in read_lines(path):
        words = line.split()
        if len(words) != FIELDS:
            raise BadLabels(f"{where}: {len(words)} fields, expected {FIELDS}")
        truncated, _, _, x1, y1, x2, y2 = numbers(words[1:8], where)
        refuse_reversed((x1, y1, x2, y2), where)
        ignored = words[0] in _ALWAYS_IGNORED or (
            words[0] == "Car" and (y2 - y1 < LOWEST_CAR_PX or truncated > MOST_TRUNCATED)
        )
        boxes.append(Box(words[0], x1, y1, x2, y2, ignored))
    return boxes


def _previous(before: Mapping[str, Path], stem: str) -> list[Path]:
    """Up to three preceding pictures, oldest first, without a gap before the frame itself."""
    results: list[Path] = []
    for back in (1, 2, 3):
        path = before.get(f"{stem}_{back:02d}")
        if path is None or not path.is_file():
            break
        results.insert(0, path)
    return results
