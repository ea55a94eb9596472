"""Quarantine: every frame is looked at once before anything is measured, and what cannot be used is set apart.

| what is found | what happens |
|---|---|
| picture missing, empty, truncated, not a picture, several pages | frame left out |
| float values that are NaN or outside [0, 1], integers of 32 bits | frame left out |
| picture smaller than one blur patch (192 px) on either side | frame left out |
| label file missing, text where a number belongs, further columns, fractions of the image | frame left out |
| box with x2 < x1 or y2 < y1, as of x y width height | frame left out |
| labelled picture that is not there | frame left out |
| more than 8 bits a channel | used, divided by their white (`Picture.white`); noted |
| colour | used, BT.601 luma; noted |
| alpha channel | used, alpha dropped; noted |
| odd width or height | used as it is; noted (the authors' maps leave the last row or column empty) |
| box that reaches past the image | clipped; noted |
| box outside the image, or without area | dropped; noted |
| box of a class the dataset does not define | kept as an ignored region; noted |
| box listed a second time | dropped; noted |
| label file without a box, picture without a row in the label table | used; noted |
| previous frame that cannot be used, or is smaller than the frame | it and those before it are not used; noted |

A frame left out is a row of the quarantine table with its reason; notes are counted. More than a stated share of
frames left out is an error: then it is not a few bad files but the wrong folder or a broken download.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pipeline.datasets.dataset import Dataset
from pipeline.datasets.decoding.pictures import BadPicture, Picture, read_picture
from pipeline.datasets.frame import Frame
from pipeline.datasets.patches import BLUR_PX
from pipeline.errors import InputError
from pipeline.executor import run_map

MAX_REJECTED_FRACTION = 0.05
DEEP = "{bits} bits a channel: divided by {white}"
COLOUR = "colour: luma taken"
ALPHA = "alpha channel dropped"
ODD_SIZE = "odd width or height"
PREVIOUS = "previous frame not usable"


class LeftOut(NamedTuple):
    """One frame in quarantine: columns of `pipeline.tables.QUARANTINE`. The file is relative to the dataset's root."""

    dataset: str
    file: str
    reason: str


class Scan(NamedTuple):
    """What looking at a dataset gave.

    Attributes:
        usable: frames that can be used, their previous frames checked too.
        quarantined: one row for each frame left out.
        notes: what was mended or is worth knowing -> how often.
    """

    usable: list[Frame]
    quarantined: list[LeftOut]
    notes: dict[str, int]


@dataclasses.dataclass(frozen=True)
class Inspection:
    """One frame, looked at.

    Attributes:
        frame: as given, without previous frames that cannot be used.
        reason: why it is left out, or empty.
        notes: what is worth knowing, one entry per occurrence.
        grey: (H, W) float32 in [0, 1]; None where the frame is left out.
    """

    frame: Frame
    reason: str
    notes: tuple[str, ...]
    grey: np.ndarray | None


def inspect(frame: Frame, smallest_px: int = BLUR_PX) -> Inspection:
    """Decode a frame and its previous frames, and judge them by the table above."""
    if frame.defect:
        return Inspection(frame, frame.defect, (), None)
    try:
        picture = read_picture(frame.path, smallest_px=smallest_px)
    except BadPicture as error:
        return Inspection(frame, error.reason, (), None)
    previous = _usable_previous(frame.previous, picture)
    notes = [*frame.notes, *_remarks(picture)]
    if len(previous) < len(frame.previous):
        notes.append(PREVIOUS)
        frame = dataclasses.replace(frame, previous=previous)
    return Inspection(frame, "", tuple(notes), picture.grey())


def _remarks(picture: Picture) -> list[str]:
    height, width = picture.pixels.shape[:2]
    values = {
        DEEP.format(bits=picture.white.bit_length(), white=picture.white): picture.pixels.dtype == np.uint16,
        COLOUR: picture.colour,
        ALPHA: picture.alpha,
        ODD_SIZE: height % 2 == 1 or width % 2 == 1,
    }
    return [note for note, holds in values.items() if holds]


def _usable_previous(paths: Sequence[Path], picture: Picture) -> tuple[Path, ...]:
    """The previous frames from the newest back to the first that cannot be used, oldest first."""
    height, width = picture.pixels.shape[:2]
    kept: list[Path] = []
    for path in reversed(paths):
        try:
            before = read_picture(path).pixels.shape
        except BadPicture:
            break
        if before[0] < height or before[1] < width:
            break
        kept.insert(0, path)
    return tuple(kept)


def gather(
    dataset: Dataset, inspections: Sequence[Inspection], max_rejected_fraction: float = MAX_REJECTED_FRACTION
) -> Scan:
    """Sort inspected frames into usable ones and quarantine.

    Raises:
        InputError: more than `max_rejected_fraction` of the frames are left out; names the first few.
    """
    setting = f"datasets.{dataset.name}.max_rejected_fraction"
    if not 0 <= max_rejected_fraction <= 1:
        raise InputError(f"{setting}={max_rejected_fraction}: expected a share between 0 and 1")
    left_out = [
        LeftOut(
            dataset.name, *(_relative(text, result.frame, dataset) for text in (str(result.frame.path), result.reason))
        )
        for result in inspections
        if result.reason
    ]
    if len(left_out) > max_rejected_fraction * len(inspections):
        first = "; ".join(f"{row.file} ({row.reason})" for row in left_out[:3])
        raise InputError(
            f"dataset '{dataset.name}': {len(left_out)} of {len(inspections)} frames cannot be used, more than the "
            f"{max_rejected_fraction:.0%} allowed by {setting} (of camera-monitor dataset: --max-rejected-fraction): "
            f"{first}{'; ...' if len(left_out) > 3 else ''}"
        )
    notes = Counter(note for result in inspections for note in result.notes)
    usable = [result.frame for result in inspections if not result.reason]
    return Scan(usable, left_out, dict(sorted(notes.items())))


def scan(
    dataset: Dataset,
    max_rejected_fraction: float = MAX_REJECTED_FRACTION,
    *,
    smallest_px: int = BLUR_PX,
    run_map: Callable[..., list[Any]] = run_map,
) -> Scan:
    """Look at every frame of a dataset.

    Args:
        dataset: an opened dataset.
        max_rejected_fraction: largest share of frames, in [0, 1], that may be left out.
        smallest_px: both sides of a picture must be at least this long.
        run_map: ``run_map(function, items, label=...)``, as `pipeline.executor.run_map`; by default in this process.

    Returns:
        usable frames, quarantine rows and counted notes.

    Raises:
        InputError: more than the stated share is bad, or the dataset itself is wrong.
    """
    look = partial(_without_pixels, smallest_px=smallest_px)
    result = run_map(look, dataset.frames(), label=f"scan of {dataset.name}")
    return gather(dataset, result, max_rejected_fraction)


def _without_pixels(frame: Frame, smallest_px: int) -> Inspection:
    return dataclasses.replace(inspect(frame, smallest_px), grey=None)  # pixels stay in the worker


def _relative(text: str, frame: Frame, dataset: Dataset) -> str:
    """Paths in a text without the folders of this machine: below the dataset's root, else beside the picture."""
    return text.replace(f"{dataset.root}/", "").replace(f"{frame.path.parent}/", "")
