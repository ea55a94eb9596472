"""What all label files have in common: numbers, boxes that must lie in the image, words that must be known.

Mended and noted: a box that reaches past the image is clipped; one that is wholly outside, or has no area, is
dropped, and so is one that is listed a second time; one of a class the dataset does not define becomes an ignored
region. Noted: a label file without a box. Not mended: text where a number belongs, a second corner left of or above the
first, or corners given as fractions of the image, make the whole frame defective.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path

from pipeline.datasets.frame import Box
from pipeline.errors import InputError

CLIPPED = "box clipped at the image border"
OUTSIDE = "box outside the image dropped"
EMPTY = "box without area dropped"
UNKNOWN = "box of an unknown class ignored"
TWICE = "box listed twice dropped"
NO_BOX = "label file without a box"
NO_ROW = "picture without a row in the label table"


class BadLabels(InputError):
    """A label file that cannot be read; the message names the file and line."""


def numbers(words: Sequence[str | float], where: str) -> tuple[float, ...]:
    """Words as finite numbers.

    Args:
        words: each number, or its text.
        where: file and line, for the message.

    Raises:
        BadLabels: a word is not a finite number.
    """
    values = []
    for word in words:
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise BadLabels(f"{where}: {word!r} is not a number")
        values.append(value)
    return tuple(values)


def refuse_fractions(corners: Sequence[float], where: str) -> None:
    """Refuse corners that are fractions of the image, as YOLO's labels have them: pixels are expected.

    Args:
        corners: four numbers of one box.
        where: file and line, for the message.

    Raises:
        BadLabels: all four lie in [0, 1] and not all are whole, so the box would be smaller than a pixel.
    """
    if all(0 <= value <= 1 for value in corners) and not all(float(value).is_integer() for value in corners):
        raise BadLabels(
            f"{where}: {' '.join(f'{value:g}' for value in corners)} look like fractions of the image (YOLO: centre and"
            " size); expected corners x1 y1 x2 y2 in pixels: x1 = (xc - w / 2) * width, and so on"
        )


def refuse_reversed(corners: Sequence[float], where: str) -> None:
    """Refuse corners in another order than left, top, right, bottom, as centre or corner with a size often read.

    Args:
        corners: x1, y1, x2, y2 of one box, pixels.
        where: file and line, for the message.

    Raises:
        BadLabels: x2 < x1 or y2 < y1. A side of exactly 0 is none of it: such a box is dropped by `tidy`.
    """
    x1, y1, x2, y2 = corners
    if x2 < x1 or y2 < y1:
        wrong = " and ".join(name for name, holds in (("x2 < x1", x2 < x1), ("y2 < y1", y2 < y1)) if holds)
        raise BadLabels(
            f"{where}: {' '.join(f'{value:g}' for value in corners)} has {wrong}; expected corners x1 y1 x2 y2 (left,"
            " top, right, bottom), not x y width height"
        )


def refuse_not_finite(box: Box, where: str) -> None:
    """Refuse a corner that is NaN, infinite or no number, as the reader of a third party may give.

    Args:
        box: as read.
        where: file, for the message.

    Raises:
        BadLabels: there is one.
    """
    if not box.finite:
        corners = " ".join(map(repr, box.corners))
        raise BadLabels(f"{where}: {corners} are no finite numbers; expected corners x1 y1 x2 y2 in pixels")


def read_lines(path: Path) -> list[tuple[str, str]]:
    """The non-empty lines of a text file, each with ``"file, line n"`` for messages.

    Raises:
        BadLabels: the file is missing or not text.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")  # some editors put a byte order mark before it
    except FileNotFoundError:
        raise BadLabels(f"{path}: missing label file") from None
    except (OSError, UnicodeDecodeError):
        raise BadLabels(f"{path}: label file cannot be read as text") from None
    return [(line.strip(), f"{path}, line {row}") for row, line in enumerate(text.splitlines(), 1) if line.strip()]


def tidy(
    boxes: Iterable[Box], size_px: tuple[int, int] | None, classes: Collection[str] | None
) -> tuple[tuple[Box, ...], tuple[str, ...]]:
    """Boxes that lie in the image and have a known class.

    Args:
        boxes: as read from the label file.
        size_px: width and height of the image, or None where its header cannot be read (nothing is clipped then:
            the frame is left out for its picture anyway).
        classes: words the dataset defines, or None if any word will do.

    Returns:
        the boxes, in their order, and one note per change.
    """
    kept: list[Box] = []
    notes: list[str] = []
    listed: set[tuple[str, float, float, float, float]] = set()
    for box in boxes:
        if box.width_px <= 0 or box.height_px <= 0:
            notes.append(EMPTY)
            continue
        inside = box.clipped(*size_px) if size_px else box
        if inside is None:
            notes.append(OUTSIDE)
            continue
        key = (inside.label, *inside.corners)
        if key in listed:
            notes.append(TWICE)
            continue
        listed.add(key)
        if inside.corners != box.corners:
            notes.append(CLIPPED)
        if classes is not None and inside.label not in classes:
            notes.append(UNKNOWN)
            inside = dataclasses.replace(inside, ignore=True)
        kept.append(inside)
    return tuple(kept), tuple(notes)
