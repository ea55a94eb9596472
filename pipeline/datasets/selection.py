"""Which frames of a dataset an experiment uses, and which of them are independent samples."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from pipeline.datasets.frame import Frame
    from pipeline.datasets.settings import DatasetSettings

Item = TypeVar("Item")


def evenly_spread(items: Sequence[Item], count: int | None) -> list[Item]:
    """At most so many of them, evenly spread; None takes all."""
    if count is None or len(items) <= count:
        return list(items)
    return [items[number * len(items) // count] for number in range(count)]


def with_options(name: str, section: DatasetSettings, options: dict[str, Any]) -> list[Frame]:
    """Every frame without a defect that a dataset's reader gives with options beside those of its section."""
    from pipeline.datasets.open import open_section

    changed = section.model_copy(update={"options": {**section.options, **options}, "limit": None})
    return [frame for frame in open_section(name, changed).frames() if not frame.defect]


def scenes_of(frames: Iterable[Frame]) -> dict[str, str]:
    """Frame name -> the scene it shows, by `Frame.scene`; frames of one scene are no independent samples.

    A frame that states none is a scene by itself.
    """
    return {frame.name: frame.scene or frame.name for frame in frames}
