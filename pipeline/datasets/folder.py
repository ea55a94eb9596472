"""A plain folder of pictures, labelled or not: the way to a user's own images, and to the authors' *Sim* frames.

::

    <root>/<stem>.png                  or <root>/images/<stem>.png
    <root>/labels/<stem>.txt           optional: class x1 y1 x2 y2 [difficult]

One object a line, absolute pixel corners. The class may hold spaces (``traffic light``); a last word ``difficult``
(or 1; 0 for none) makes the box ignored, as in the Pascal VOC rules. Other columns, such as a score, are refused, and
so are fractions of the image. Without a folder ``labels`` the frames have no boxes; with it, each picture needs a file,
which may be empty (noted), and each file a picture. The authors' *Sim* frames (MIT licence,
https://github.com/MaikWischow/Camera-Condition-Monitoring) come in this layout.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import ClassVar

from pipeline.datasets.dataset import Dataset, pictures_in
from pipeline.datasets.frame import Box, Frame
from pipeline.datasets.labels import NO_BOX, BadLabels, numbers, read_lines, refuse_fractions, refuse_reversed
from pipeline.errors import InputError

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_DIFFICULT = {"difficult": True, "1": True, "0": False}


class Folder(Dataset):
    """A folder of pictures; see the module for the layout.

    Args:
        name: name of the dataset.
        root: the folder.
        scene: regular expression (`re`) that matches the beginning of a frame's name: frames for which it matches the
            same text, or its first group does, show one scene. ``".+_"`` is the text up to the last ``_``. None: every
            frame is a scene of its own.
        whitelist: see `Dataset`.
        limit: see `Dataset`.

    Raises:
        InputError: `scene` is no regular expression; in `frames`, a frame for whose name it has no match.
    """

    kind: ClassVar[str] = "folder"
    source: ClassVar[str] = "Any folder of PNG, JPEG, TIFF, BMP, WebP or PGM pictures will do."

    def __init__(
        self,
        name: str,
        root: str | Path,
        *,
        scene: str | None = None,
        whitelist: str | Path | None = None,
        limit: int | None = None,
    ) -> None:
        super().__init__(name, root, whitelist=whitelist, limit=limit)
        try:
            self.scene = None if scene is None else re.compile(scene)
        except (re.error, TypeError) as error:
            raise InputError(
                f"datasets.{name}.options.scene={scene!r}: expected a regular expression, such as '.+_' for the text up"
                f" to the last _ of a frame's name ({error})"
            ) from None
        below = self.root / "images"
        self.images = below if below.is_dir() else self.root
        self.labelled = (self.root / "labels").is_dir()

    @property
    def searched(self) -> Path:
        """The folder that the pictures lie in."""
        return self.images

    def _read(self) -> Iterable[Frame]:
        pictures = pictures_in(self.images)
        for path in pictures:
            boxes: list[Box] = []
            defect = ""
            if self.labelled:
                try:
                    boxes = read_box_labels(self.root / "labels" / f"{path.stem}.txt")
                except BadLabels as error:
                    defect = str(error)
            notes = (NO_BOX,) if self.labelled and not boxes and not defect else ()
            yield self._frame(path, boxes, defect=defect, notes=notes)
        if self.labelled:
            yield from self._without_picture(self.root / "labels", pictures)

    def scene_of(self, frame: str) -> str:
        """What the option `scene` matches of its name; without the option, its name."""
        if self.scene is None:
            return frame
        match = self.scene.match(frame)
        if match is None or not match[0]:
            raise InputError(
                f"datasets.{self.name}.options.scene={self.scene.pattern!r} matches nothing at the beginning of the"
                f" frame's name '{frame}'; with '|.+' at its end such a frame is a scene of its own"
            )
        group = match[1] if self.scene.groups else None
        return str(group or match[0])


def read_box_labels(path: Path) -> list[Box]:
    """The boxes of one label file, not yet clipped.

    Raises:
        BadLabels: the file is missing, or a line is not ``class x1 y1 x2 y2 [difficult]`` in pixels with x1 <= x2 and
            y1 <= y2.
    """
    boxes = []
    for line, where in read_lines(path):
        words = line.split()
        # with a flag there are six words; a class of two words and no flag also has six, so ask the last one
        flagged = len(words) > 5 and words[-1] in _DIFFICULT and _is_number(words[-5:-1])
        corners = words[-5:-1] if flagged else words[-4:]
        label = words[: -5 if flagged else -4]
        if not label or (len(label) > 1 and any(_NUMBER.fullmatch(word) for word in label)):
            raise BadLabels(
                f"{where}: expected 'class x1 y1 x2 y2 [difficult]', four numbers and no further column, got {line!r}"
            )
        x1, y1, x2, y2 = numbers(corners, where)
        refuse_fractions((x1, y1, x2, y2), where)
        refuse_reversed((x1, y1, x2, y2), where)
        boxes.append(Box(" ".join(label), x1, y1, x2, y2, flagged and _DIFFICULT[words[-1]]))
    return boxes


def _is_number(words: Sequence[str]) -> bool:
    try:
        [float(word) for word in words]
    except ValueError:
        return False
    return True
