"""*Sim*: the rendered village and street frames, as the rendering stage writes them.

::

    <root>/<split>/<split>-<number>-<moment>.png     8-bit grey, 896x768, e.g. evaluation/evaluation-0003-2.png
    <root>/<split>/<split>-<number>-<moment>.json    {"boxes": [{"label", "box": [x1, y1, x2, y2], "amodal": [...],
                                                     "visible_fraction", "pixels"}, ...]}, or the list alone

Each viewpoint has four moments, 0 to 3, 0.1 s apart. By default a frame is a viewpoint's last moment, with the
earlier ones as its previous frames; `moments="all"` makes every moment a frame. Boxes are those of the visible part,
exact to the pixel; objects under `min_height_px` high or less visible than `min_visible_fraction` are ignored, as in
the measurements that calibrated the renderer (detectors are not asked to find what people cannot).

Licence: as this project's; the frames are made by it.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, ClassVar

from pipeline.datasets.dataset import DataAbsent, Dataset, pictures_in
from pipeline.datasets.frame import Box, Frame
from pipeline.datasets.labels import BadLabels, numbers, refuse_reversed
from pipeline.errors import InputError

MOMENTS = ("last", "all")
NOTHING_IGNORED: dict[str, Any] = {"min_height_px": 0.0, "min_visible_fraction": 0.0}
"""Options for those who decide by rules of their own which objects count."""
NAME = re.compile(r"^(?P<viewpoint>.+)-(?P<moment>\d+)$")
"""Of a frame: viewpoint and moment."""


class Sim(Dataset):
    """Rendered frames; see the module for the layout.

    Args:
        name: name of the dataset.
        root: the folder the rendering stage writes.
        split: ``"evaluation"`` or ``"train"``: a sub-folder.
        moments: ``"last"`` or ``"all"``.
        min_height_px: lower objects are ignored.
        min_visible_fraction: objects less visible, in [0, 1], are ignored.
        whitelist: see `Dataset`.
        limit: see `Dataset`.
    """

    kind: ClassVar[str] = "sim"
    source: ClassVar[str] = "It is rendered here: dvc repro render_sim."

    def __init__(
        self,
        name: str,
        root: str | Path,
        *,
        split: str = "evaluation",
        moments: str = "last",
        min_height_px: float = 25.0,
        min_visible_fraction: float = 0.3,
        whitelist: str | Path | None = None,
        limit: int | None = None,
    ) -> None:
        super().__init__(name, root, whitelist=whitelist, limit=limit)
        if moments not in MOMENTS:
            raise InputError(f"datasets.{name}.moments={moments!r}: expected one of {', '.join(MOMENTS)}")
        if not (self.root / split).is_dir():
            raise DataAbsent(f"dataset '{name}': no folder {self.root / split}. {self.source}")
        self.split, self.moments = split, moments
        self.min_height_px, self.min_visible_fraction = min_height_px, min_visible_fraction

    @property
    def searched(self) -> Path:
        """The folder that the pictures lie in."""
        return self.root / self.split

    def _read(self) -> Iterable[Frame]:
        viewpoints: dict[str, list[Path]] = {}
        for path in pictures_in(self.root / self.split):
            match = NAME.match(path.stem)
            if match is None:
                raise InputError(f"{path}: expected a name like evaluation-0003-2.png (split, viewpoint, moment)")
            viewpoints.setdefault(match["viewpoint"], []).append(path)
        for moments in viewpoints.values():
            moments.sort(key=lambda path: int(path.stem.rpartition("-")[2]))
            first = 0 if self.moments == "all" else len(moments) - 1
            for index in range(first, len(moments)):
                path = moments[index]
                boxes: list[Box] = []
                defect = ""
                try:
                    boxes = self._boxes(path.with_suffix(".json"))
                except BadLabels as error:
                    defect = str(error)
                previous = moments[max(0, index - 3) : index]
                yield self._frame(path, boxes, previous=previous, split=self.split, defect=defect)

    def scene_of(self, frame: str) -> str:
        """Its viewpoint, which its moments share."""
        match = NAME.match(frame)
        return match["viewpoint"] if match else frame

    def _boxes(self, path: Path) -> list[Box]:
        try:
            content: Any = json.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            raise BadLabels(f"{path}: missing label file") from None
        except (json.JSONDecodeError, UnicodeDecodeError, RecursionError) as error:
            raise BadLabels(f"{path}: not valid JSON ({error})") from None
        except OSError as error:
            raise BadLabels(f"{path}: label file cannot be read ({error.strerror})") from None
        rows = content.get("boxes") if isinstance(content, dict) else content
        if not isinstance(rows, list):
            raise BadLabels(f"{path}: expected a list of boxes, or an object with the key 'boxes'")
        return [self._box(row, f"{path}, box {index}") for index, row in enumerate(rows)]

    def _box(self, row: Any, where: str) -> Box:
        try:
            label, corners, visible = str(row["label"]), row["box"], row.get("visible_fraction", 1.0)
            if not isinstance(corners, list):
                raise TypeError("corners")
            x1, y1, x2, y2 = numbers(corners, where)
            (fraction,) = numbers([visible], where)
        except (KeyError, TypeError, ValueError, AttributeError):
            raise BadLabels(f"{where}: expected label, box [x1, y1, x2, y2] and visible_fraction") from None
        refuse_reversed((x1, y1, x2, y2), where)
        ignored = y2 - y1 < self.min_height_px or fraction < self.min_visible_fraction
        return Box(label, x1, y1, x2, y2, ignored, fraction)
