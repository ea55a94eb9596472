"""Udacity's annotated driving frames (2016): 1920x1200, 2 Hz, Mountain View, in both original label layouts.

``autti`` (15,000 frames; occlusion flags, traffic lights)::

    <root>/object-dataset/labels.csv          frame xmin ymin xmax ymax occluded "label" ["attribute"]
    <root>/object-dataset/<nanoseconds>.jpg

``crowdai`` (9,423 frames)::

    <root>/object-detection-crowdai/labels.csv   xmin,ymin,xmax,ymax,Frame,Label,Preview URL
    <root>/object-detection-crowdai/<nanoseconds>.jpg

The first is separated by spaces and has no header. The second has one, which in some copies names the columns
``xmin,xmax,ymin,ymax`` although the values come in the order above: the header is not believed, the order is.
Class words are made lower case, so that both layouts speak of ``car``, ``truck`` and ``pedestrian``. Frames without
any label are frames without objects. File names are times in nanoseconds: the up to three frames before one, each
at most `max_gap_s` earlier than the next, are its previous frames. Pictures may be converted: their suffix need not be
the table's.

Licence: MIT. https://github.com/udacity/self-driving-car/tree/master/annotations
"""

from __future__ import annotations

import csv
import shlex
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import ClassVar

from pipeline.datasets.dataset import DataAbsent, Dataset, pictures_in
from pipeline.datasets.frame import Box, Frame
from pipeline.datasets.labels import NO_ROW, BadLabels, numbers, read_lines, refuse_fractions, refuse_reversed
from pipeline.errors import InputError

FOLDERS = {"autti": "object-dataset", "crowdai": "object-detection-crowdai"}
DRIVE_SCENE_S = 10
"""Seconds of a drive that count as one scene: some 100 m in a town."""
_MEMORY = 3  # previous frames at most


class Udacity(Dataset):
    """Udacity frames; see the module for layouts and licence.

    Args:
        name: name of the dataset.
        root: the folder that holds the layout's own folder, or that folder itself.
        layout: ``"autti"`` or ``"crowdai"``.
        images: where the pictures are, if not beside the labels.
        max_gap_s: longest time between two consecutive frames.
        whitelist: see `Dataset`.
        limit: see `Dataset`.
    """

    kind: ClassVar[str] = "udacity"
    source: ClassVar[str] = (
        "'camera-monitor download udacity' gets both archives. Or get one of annotated frames (autti: 3.3 GB, or "
        "crowdai: 1.5 GB) from https://github.com/udacity/self-driving-car/tree/master/annotations and unpack it "
        "there."
    )
    classes: ClassVar[frozenset[str] | None] = frozenset({"car", "truck", "pedestrian", "biker", "trafficlight"})

    def __init__(
        self,
        name: str,
        root: str | Path,
        *,
        layout: str = "autti",
        images: str | Path | None = None,
        max_gap_s: float = 1.0,
        whitelist: str | Path | None = None,
        limit: int | None = None,
    ) -> None:
        super().__init__(name, root, whitelist=whitelist, limit=limit)
        if layout not in FOLDERS:
            raise InputError(f"datasets.{name}.layout={layout!r}: expected one of {', '.join(FOLDERS)}")
        self.layout, self.max_gap_s = layout, max_gap_s
        below = self.root / FOLDERS[layout]
        self.folder = below if below.is_dir() else self.root
        self.images = self.folder if images is None else Path(images)
        if not (self.folder / "labels.csv").is_file():
            raise DataAbsent(
                f"dataset '{name}': no {FOLDERS[layout]}/labels.csv below {self.root}. {self.source} "
                f"Then name the folder by the setting datasets.{name}.root"
            )
        if not self.images.is_dir():
            raise DataAbsent(f"dataset '{name}': no folder {self.images}; see the setting datasets.{name}.images")

    @property
    def searched(self) -> Path:
        """The folder that the pictures lie in."""
        return self.images

    def _read(self) -> Iterable[Frame]:
        reader = read_autti_labels if self.layout == "autti" else read_crowdai_labels
        boxes, defects = reader(self.folder / "labels.csv")
        pictures = pictures_in(self.images)
        before = previous_by_time(pictures, self.max_gap_s)
        named = boxes.keys() | defects.keys()
        name_of_stem = {Path(name).stem: name for name in sorted(named)}
        used = set()
        for path in pictures:
            name = path.name if path.name in named else name_of_stem.get(path.stem, path.name)
            used.add(name)
            defect = defects.get(name, "")
            notes = () if defect or name in boxes else (NO_ROW,)
            usable = () if defect else boxes.get(name, ())
            yield self._frame(path, usable, previous=before[path], defect=defect, notes=notes)
        for name in named - used:
            path = self.images / name
            yield self._frame(path, defect=f"{path}: labelled, but there is no such picture")

    def scene_of(self, frame: str) -> str:
        """The `DRIVE_SCENE_S` by the clock that it belongs to; a name that is no time in nanoseconds is its own scene.

        That neighbours on either side of their end, or frames of a long halt, show the same is not recognised.
        """
        return str(int(frame) // (DRIVE_SCENE_S * 1_000_000_000)) if frame.isdecimal() else frame


Labels = tuple[dict[str, list[Box]], dict[str, str]]


def read_autti_labels(path: Path) -> Labels:
    """Boxes of a space-separated ``object-dataset`` file.

    Returns:
        boxes by picture file name, not yet clipped; and, by picture file name, what is wrong with a line of its.

    Raises:
        BadLabels: the file is missing, or has too few fields: it is not in this layout.
    """
    rows = []
    for line, where in read_lines(path):
        try:
            words = shlex.split(line)
        except ValueError as error:
            raise BadLabels(f"{where}: {error}") from None
        if len(words) < 7:
            raise BadLabels(f"{where}: {len(words)} fields, expected at least 7; is this the autti layout?")
        rows.append((words[0], words[6], words[1:5], where))
    return _gather(rows, path)


def read_crowdai_labels(path: Path) -> Labels:
    """Boxes of a comma-separated ``object-detection-crowdai`` file; see `read_autti_labels`."""
    rows = []
    for index, (line, where) in enumerate(read_lines(path)):
        words = [word.strip() for word in next(csv.reader([line]))]
        if len(words) < 6:
            raise BadLabels(f"{where}: {len(words)} fields, expected at least 6; is this the crowdai layout?")
        if index == 0 and words[0].lower() == "xmin":
            continue
        rows.append((words[4], words[5], words[:4], where))
    return _gather(rows, path)


def _gather(rows: Sequence[tuple[str, str, list[str], str]], path: Path) -> Labels:
    if not rows:
        raise BadLabels(f"{path}: label table without a row; restore it from the archive of the dataset")
    boxes: dict[str, list[Box]] = {}
    defects: dict[str, str] = {}
    for name, label, corners, where in rows:
        try:
            x1, y1, x2, y2 = numbers(corners, where)
            refuse_fractions((x1, y1, x2, y2), where)
            refuse_reversed((x1, y1, x2, y2), where)
        except BadLabels as error:
            defects[name] = str(error)
            continue
        boxes.setdefault(name, []).append(Box(label.lower(), x1, y1, x2, y2))
    return boxes, defects


def previous_by_time(pictures: list[Path], max_gap_s: float) -> dict[Path, tuple[Path, ...]]:
    """For each picture the up to three before it, oldest first, by the nanoseconds in their names.

    Pictures whose name is no number have none.
    """
    timed = sorted((int(path.stem), path) for path in pictures if path.stem.isdigit())
    before: dict[Path, tuple[Path, ...]] = dict.fromkeys(pictures, ())
    run: list[Path] = []
    last_ns = 0
    for time_ns, path in timed:
        if run and time_ns - last_ns > max_gap_s * 1e9:
            run = []
        before[path] = tuple(run[-_MEMORY:])
        run.append(path)
        last_ns = time_ns
    return before
