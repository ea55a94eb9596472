"""Frames of a dataset that a detection sweep looks at: those of its index, or those its reader gives with options.

With ``detection.sweep.options`` a reader may give other frames than the index holds, as all moments of *Sim*. The same
limit, whitelist and largest share of unusable frames hold for them; what the index has set aside stays aside, and a
frame that is not in the index, as any where there is none, is set aside where its picture cannot be read.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.datasets.frame import Frame
from pipeline.datasets.index import indexed_frames
from pipeline.datasets.open import open_section
from pipeline.datasets.quarantine import Inspection, gather, inspect
from pipeline.datasets.selection import evenly_spread
from pipeline.executor import run_map
from pipeline.store import read_table
from pipeline.tables import QUARANTINE

if TYPE_CHECKING:
    from pipeline.datasets.dataset import Dataset
    from pipeline.datasets.settings import DatasetSettings


def sweep_frames(
    name: str,
    section: DatasetSettings,
    options: Mapping[str, Any],
    count: int | None,
    index_folder: Path | None,
    run_map: Callable[..., list[Any]] = run_map,
) -> list[Frame]:
    """The frames that detectors are evaluated on, and that noise and blur are measured in beside them.

    Args:
        name: the dataset's name.
        section: ``datasets.<name>`` of the configuration.
        options: ``detection.sweep.options.<name>``: options of its reader that differ, e.g. ``{"moments": "all"}``.
        count: at most this many frames, evenly spread; None takes all.
        index_folder: where the stage `index` wrote; None where there is no index: the dataset is read anew
            and every picture is decoded.
        run_map: ``run_map(function, items, label=...)``, as `pipeline.executor.run_map`; by default in this process.

    Returns:
        the frames, sorted by name. Those that are set aside without being so in the index are named on stderr.

    Raises:
        InputError: more frames are set aside than ``datasets.<name>.max_rejected_fraction`` allows, or the dataset is
            absent or does not take an option.
    """
    if index_folder is not None and not options:
        return evenly_spread(indexed_frames(index_folder, name, section), count)
    dataset = open_section(name, section.model_copy(update={"options": {**section.options, **options}}))
    frames = dataset.frames()
    indexed: set[Path] = set()
    set_aside: dict[str, str] = {}
    if index_folder is not None:
        indexed = {frame.path for frame in indexed_frames(index_folder, name, section)}
        table = read_table(index_folder / "quarantine.parquet", QUARANTINE)
        set_aside = dict(zip(table["file"], table["reason"], strict=True))
    reasons = {frame.name: frame.defect or set_aside.get(_file(frame, dataset), "") for frame in frames}
    unseen = [frame for frame in frames if not reasons[frame.name] and frame.path not in indexed]
    if unseen:
        unreadable = run_map(_why_unreadable, unseen, label=f"frames of {name}")
        reasons |= {frame.name: reason for frame, reason in zip(unseen, unreadable, strict=True)}
    return evenly_spread(_usable(dataset, frames, reasons, section.max_rejected_fraction, set_aside), count)


def _usable(
    dataset: Dataset,
    frames: Sequence[Frame],
    reasons: Mapping[str, str],
    max_rejected_fraction: float,
    known: Collection[str],
) -> list[Frame]:
    """Frames without a reason against them (by name); the others are named on stderr, but for those named before."""
    inspections = [Inspection(frame, reasons[frame.name], (), None) for frame in frames]
    usable, left_out, _ = gather(dataset, inspections, max_rejected_fraction)
    for row in left_out:
        if row.file not in known:
            print(f"warning: dataset '{dataset.name}': {row.file} is left out: {row.reason}", file=sys.stderr)
    return usable


def _file(frame: Frame, dataset: Dataset) -> str:
    """The picture as the index names it (`pipeline.datasets.quarantine.LeftOut`)."""
    within = frame.path.is_relative_to(dataset.root)
    return str(frame.path.relative_to(dataset.root)) if within else frame.path.name


def _why_unreadable(frame: Frame) -> str:
    """Why its picture cannot be decoded, or empty; of any size, since no patch need fit into it."""
    return inspect(dataclasses.replace(frame, previous=()), smallest_px=1).reason
