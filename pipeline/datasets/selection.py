"""Which frames of a dataset an experiment uses, and which of them are independent samples."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from pipeline.datasets.frame import Frame
    from pipeline.datasets.settings import DatasetSettings

Item = TypeVar("Item")

DRIVE_SCENE_S = 10
"""Seconds of a drive that count as one scene: some 100 m in a town."""


def evenly_spread(items: Sequence[Item], count: int | None) -> list[Item]:
    """At most so many of them, evenly spread; None takes all."""
    if count is None or len(items) <= count:
        return list(items)
    return [items[number * len(items) // count] for number in range(count)]


def evaluation_frames(
    folder: Any, name: str, section: DatasetSettings, options: dict[str, Any], count: int | None = None
) -> list[Frame]:
    """Frames to judge detectors on: those of the stored index, or more of the same dataset with other options.

    Args:
        folder: where the stage `index` wrote.
        name: the dataset's name.
        section: its section of the configuration.
        options: options of its reader that differ, e.g. ``{"moments": "all"}``; with any, every frame of the dataset is
            taken that has no defect.
        count: at most this many, evenly spread; None takes all.
    """
    from pipeline.datasets.index import indexed_frames

    frames = with_options(name, section, options) if options else indexed_frames(folder, name, section)
    return evenly_spread(frames, count)


def with_options(name: str, section: DatasetSettings, options: dict[str, Any]) -> list[Frame]:
    """Every frame without a defect that a dataset's reader gives with options beside those of its section."""
    from pipeline.datasets.open import open_section

    changed = section.model_copy(update={"options": {**section.options, **options}, "limit": None})
    return [frame for frame in open_section(name, changed).frames() if not frame.defect]


def scene_of(kind: str, frame: str) -> str:
    """The scene that a frame shows: frames of one scene are no independent samples.

    Moments of Sim share their viewpoint, the pictures of a stereo pair among the photographs their scene. Of Udacity,
    whose names are times in nanoseconds and whose drives have 2 frames a second, frames of the same `DRIVE_SCENE_S` by
    the clock are one scene; that neighbours on either side of its end, or frames of a long halt, show the same is not
    recognised.

    Args:
        kind: of the dataset, see `pipeline.datasets.settings.DatasetSettings`.
        frame: its name in the dataset.

    Returns:
        the name of the scene; that of the frame where it is the only one.
    """
    if kind == "sim":
        return frame.rpartition("-")[0] or frame
    if kind == "photos":
        return frame.removesuffix("_left").removesuffix("_right")
    if kind == "udacity" and frame.isdecimal():
        return str(int(frame) // (DRIVE_SCENE_S * 1_000_000_000))
    return frame
