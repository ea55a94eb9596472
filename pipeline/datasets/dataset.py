"""What every dataset does the same way: finding its folder, ordering, choosing and checking its frames."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import ClassVar

from pipeline.datasets.decoding.pictures import SUFFIXES, picture_size
from pipeline.datasets.frame import Box, Frame
from pipeline.datasets.labels import BadLabels, refuse_not_finite, refuse_reversed, tidy
from pipeline.datasets.passed_over import what_lies_there
from pipeline.datasets.whitelist import read_whitelist, select
from pipeline.errors import InputError


class DataAbsent(InputError):
    """The dataset's folder is not there; the message names where to get the data and which setting names the folder."""


class Dataset(ABC):
    """A folder of pictures with their labels.

    `frames` reads names, labels and picture headers, but decodes nothing.

    Args:
        name: how tables and figures call this dataset; also part of the keys of random streams.
        root: the folder.
        whitelist: text file with one frame name a line; None takes every frame.
        limit: at most this many frames, evenly spread over the sorted names; None takes every frame.

    Attributes:
        kind: the registry's name for the layout.
        source: where the data can be had.
        classes: the words its labels may use, or None if any.
        detector_classes: word of a label -> class that detectors call it (``car``, ``person``); a layout of a third
            party without any cannot be used for detection (those of this package are in `pipeline.detection.classes`).
        detector_neighbours: word of a label -> classes for which its objects are neither right nor wrong.
        labelled: whether frames come with boxes at all; without, patches are taken from the whole frame.
    """

    kind: ClassVar[str]
    source: ClassVar[str]
    classes: ClassVar[frozenset[str] | None] = None
    detector_classes: ClassVar[Mapping[str, str]] = {}
    detector_neighbours: ClassVar[Mapping[str, tuple[str, ...]]] = {}

    def __init__(
        self, name: str, root: str | Path, *, whitelist: str | Path | None = None, limit: int | None = None
    ) -> None:
        if not name:
            raise InputError(f"a dataset of kind '{self.kind}' needs a name")
        if limit is not None and limit < 1:
            raise InputError(f"datasets.{name}.limit={limit}: expected at least 1, or null for every frame")
        self.name, self.root = name, Path(root)
        self.whitelist = None if whitelist is None else Path(whitelist)
        self.limit = limit
        self.labelled = True
        if not self.root.is_dir():
            raise DataAbsent(
                f"dataset '{name}': no folder {self.root}. {self.source} "
                f"Then name the folder by the setting datasets.{name}.root"
            )

    @property
    def searched(self) -> Path:
        """The folder that the pictures lie in, for messages."""
        return self.root

    @abstractmethod
    def _read(self) -> Iterable[Frame]:
        """Every frame, in any order."""

    def frames(self) -> list[Frame]:
        """The frames, sorted by name.

        Frames with a `Frame.defect` are among them; `pipeline.datasets.quarantine.scan` separates them.

        Raises:
            InputError: no frame at all, two of the same name, or a whitelist that names one that is not there.
        """
        frames = sorted(self._read(), key=lambda frame: frame.name)
        if not frames:
            there = what_lies_there(self.root, self.searched)
            raise InputError(f"dataset '{self.name}': no pictures in {self.searched}{there}. {self.source}")
        twice = [name for name, count in Counter(frame.name for frame in frames).items() if count > 1]
        if twice:
            raise InputError(f"dataset '{self.name}': two pictures are called '{twice[0]}' in {self.root}; rename one")
        if self.whitelist is not None:
            frames = select(frames, read_whitelist(self.whitelist), str(self.whitelist))
        if self.limit is not None and len(frames) > self.limit:
            frames = [frames[(index * len(frames)) // self.limit] for index in range(self.limit)]
        return frames

    def scene_of(self, frame: str) -> str:
        """The scene that a frame shows: frames of one scene are no independent samples (`Frame.scene`).

        Args:
            frame: its name.

        Returns:
            the name of the scene; here that of the frame, which is the only one of its scene.
        """
        return frame

    def _part(self, *names: str) -> Path:
        """A folder below the root that must exist."""
        folder = self.root.joinpath(*names)
        if not folder.is_dir():
            raise DataAbsent(
                f"dataset '{self.name}': no folder {folder}. {self.source} "
                f"The folder that holds {'/'.join(names)} belongs in the setting datasets.{self.name}.root"
            )
        return folder

    def _frame(
        self,
        path: Path,
        boxes: Sequence[Box] = (),
        *,
        previous: Sequence[Path] = (),
        split: str = "",
        defect: str = "",
        notes: Sequence[str] = (),
    ) -> Frame:
        """A frame whose boxes are clipped to its picture and checked against the dataset's classes."""
        try:
            for box in () if defect else boxes:  # a third party's reader may not have looked
                refuse_not_finite(box, f"labels of {path}")
                refuse_reversed(box.corners, f"labels of {path}")
        except BadLabels as error:
            boxes, defect = (), str(error)
        size_px = picture_size(path) if boxes else None
        kept, changes = tidy(boxes, size_px, self.classes)
        scene = "" if defect else self.scene_of(path.stem)
        return Frame(self.name, path.stem, path, kept, tuple(previous), split, defect, (*notes, *changes), scene)

    def _without_picture(self, labels: Path, pictures: Collection[Path]) -> Iterator[Frame]:
        """A defective frame for each label file that is not hidden and has no picture; none without any picture."""
        stems = {path.stem for path in pictures}
        for path in sorted(labels.glob("[!.]*.txt")) if stems else ():
            if path.stem not in stems:
                yield self._frame(path, defect=f"{path}: labelled, but there is no such picture")


def pictures_in(folder: Path) -> list[Path]:
    """The picture files directly in a folder, sorted by name; hidden files are passed over."""
    return sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES and path.name[0] != ".")
