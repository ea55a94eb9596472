"""Detections as text, one file per image: ``class score x1 y1 x2 y2`` a line, as Cartucho's mAP program reads them.

A class may hold spaces (``traffic light``): the last five words of a line are numbers, the rest is the class. An empty
file is an image in which nothing was found.
"""

from __future__ import annotations

import math
from pathlib import Path

from pipeline.detection.base import Detections
from pipeline.errors import InputError
from pipeline.store import write_text


def read_detections(path: str | Path) -> Detections:
    """Read one file.

    Raises:
        InputError: the file is missing, or a line is not ``class score x1 y1 x2 y2``.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read as text ({type(error).__name__})") from error
    boxes, scores, labels = [], [], []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if not words:
            continue
        try:
            score, *corners = (float(word) for word in words[-5:])
        except ValueError:
            corners = []
        if len(words) < 6 or not all(map(math.isfinite, [*corners, score if corners else math.nan])):
            raise InputError(f"{path}, line {number}: expected 'class score x1 y1 x2 y2', got {line.strip()!r}")
        boxes.append(corners)
        scores.append(score)
        labels.append(" ".join(words[:-5]))
    return Detections.of(boxes, scores, labels)


def write_detections(path: str | Path, found: Detections) -> None:
    """Write one file; `read_detections` gives the same numbers back."""
    rows = [
        " ".join([str(label), *(repr(float(value)) for value in (score, *box))])
        for label, score, box in zip(found.label, found.score, found.boxes, strict=True)
    ]
    write_text(Path(path), "".join(f"{row}\n" for row in rows))
