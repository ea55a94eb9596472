"""The index of a dataset: which frames and patches an experiment uses, and what was left out.

Every later stage takes its frames and patches from these tables, so that all of them use the same.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from pipeline.datasets import image_statistics
from pipeline.datasets.dataset import Dataset
from pipeline.datasets.frame import Frame
from pipeline.datasets.patches import BLUR_PX, NOISE_PX, Patch, object_patches, tiles
from pipeline.datasets.quarantine import MAX_REJECTED_FRACTION, Inspection, gather, inspect
from pipeline.datasets.selection import evenly_spread
from pipeline.errors import InputError
from pipeline.executor import run_map
from pipeline.store import Schema, read_table
from pipeline.tables import FRAMES, PATCHES, QUARANTINE

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.datasets.settings import DatasetSettings

PATCHES_FROM = ("auto", "objects", "frame")


class Index(NamedTuple):
    """The tables of one dataset.

    Attributes:
        frames: schema `FRAMES`, sorted by frame.
        patches: schema `PATCHES`, numbered from 0 within each frame and purpose (``"blur"``, ``"noise"``).
        quarantine: schema `QUARANTINE`.
        usable: the frames themselves, in the table's order.
        notes: what was mended or is worth knowing -> how often (`pipeline.datasets.quarantine`).
    """

    frames: pd.DataFrame
    patches: pd.DataFrame
    quarantine: pd.DataFrame
    usable: list[Frame]
    notes: dict[str, int]

    def patches_for(self, purpose: str, per_frame: int | None = None) -> dict[str, list[Patch]]:
        """Frame name -> its patches for ``"blur"`` or ``"noise"``; see `indexed_patches`."""
        return patches_of(self.patches, purpose, per_frame)


@dataclasses.dataclass(frozen=True)
class _Entry:
    found: Inspection
    row: dict[str, Any]
    patches: dict[str, list[Patch]]


def index(
    dataset: Dataset,
    *,
    patch_px: int = BLUR_PX,
    tile_px: int = NOISE_PX,
    patches_from: str = "auto",
    max_rejected_fraction: float = MAX_REJECTED_FRACTION,
    run_map: Callable[..., list[Any]] = run_map,
) -> Index:
    """Look at every frame, measure it and list its patches.

    Args:
        dataset: an opened dataset.
        patch_px: side of a blur patch, pixels.
        tile_px: side of a noise tile, pixels.
        patches_from: ``"objects"``: blur patches over labelled objects; ``"frame"``: whole tiles over the frame;
            ``"auto"``: objects where the dataset has labels, else the frame.
        max_rejected_fraction: largest share of frames, in [0, 1], that may be left out.
        run_map: ``run_map(function, items, label=...)``, as `pipeline.executor.run_map`; by default in this process.
            The tables do not depend on the number of workers.

    Returns:
        the tables.

    Raises:
        InputError: more than the stated share of frames is bad, or an option is out of range.
    """
    if patches_from not in PATCHES_FROM:
        raise InputError(f"patches_from={patches_from!r}: expected one of {', '.join(PATCHES_FROM)}")
    enter = partial(
        _enter,
        patch_px=patch_px,
        tile_px=tile_px,
        from_objects=dataset.labelled if patches_from == "auto" else patches_from == "objects",
    )
    entries = run_map(enter, dataset.frames(), label=f"index of {dataset.name}")
    scan = gather(dataset, [entry.found for entry in entries], max_rejected_fraction)
    return Index(
        _table([entry.row for entry in entries if entry.row], FRAMES),
        _table(_patch_rows(entries), PATCHES),
        _table([row._asdict() for row in scan.quarantined], QUARANTINE),
        scan.usable,
        scan.notes,
    )


def usable_frames(dataset: Dataset, frames: pd.DataFrame) -> list[Frame]:
    """The frames of an index table, opened again, in the table's order.

    Args:
        dataset: the same dataset, opened with the same options.
        frames: table of schema `FRAMES`.

    Raises:
        InputError: the table names a frame that the dataset no longer has.
    """
    known = {frame.name: frame for frame in dataset.frames() if not frame.defect}
    chosen = []
    for name, count in zip(frames["frame"], frames["previous_frames"], strict=True):
        if name not in known:
            raise InputError(f"dataset '{dataset.name}' has no frame '{name}' any more; run dvc repro index")
        frame = known[name]
        previous = frame.previous[len(frame.previous) - int(count) :]
        chosen.append(dataclasses.replace(frame, previous=previous))
    return chosen


def indexed_frames(folder: str | Path, name: str, section: DatasetSettings) -> list[Frame]:
    """The frames of a stored index, ready to be read.

    Args:
        folder: where the stage `index` wrote ``frames.parquet``.
        name: the dataset's name.
        section: its section of the configuration (`pipeline.datasets.open.open_section`).
    """
    from pipeline.datasets.open import open_section

    every = section.model_copy(update={"limit": None, "whitelist": None})  # the index has chosen already
    return usable_frames(open_section(name, every), read_table(Path(folder) / "frames.parquet", FRAMES))


def indexed_patches(folder: str | Path, purpose: str, per_frame: int | None = None) -> dict[str, list[Patch]]:
    """The patches of a stored index.

    Args:
        folder: where the stage `index` wrote ``patches.parquet``.
        purpose: ``"blur"`` or ``"noise"``.
        per_frame: at most this many of each frame, evenly spread over them; None takes all.

    Returns:
        frame name -> its patches; frames without any are not in it.
    """
    return patches_of(read_table(Path(folder) / "patches.parquet", PATCHES), purpose, per_frame)


def patches_of(table: pd.DataFrame, purpose: str, per_frame: int | None = None) -> dict[str, list[Patch]]:
    """The patches of an index table; see `indexed_patches`.

    Args:
        table: schema `PATCHES`.
        purpose: ``"blur"`` or ``"noise"``.
        per_frame: at most this many of each frame, evenly spread over them; None takes all.
    """
    patches: dict[str, list[Patch]] = {}
    for frame, rows in table[table["purpose"] == purpose].groupby("frame", sort=True):
        columns = (rows["x_px"], rows["y_px"], rows["size_px"], rows["label"])
        of_frame = [Patch(int(x), int(y), int(size), str(label)) for x, y, size, label in zip(*columns, strict=True)]
        patches[str(frame)] = evenly_spread(of_frame, per_frame)
    return patches


def _enter(frame: Frame, patch_px: int, tile_px: int, from_objects: bool) -> _Entry:
    result = inspect(frame, smallest_px=max(patch_px, tile_px))
    grey, frame = result.grey, result.frame
    if grey is None:
        return _Entry(result, {}, {})
    shape = (grey.shape[0], grey.shape[1])
    blur = object_patches(shape, frame.boxes, patch_px) if from_objects else tiles(shape, patch_px)
    row = {
        "dataset": frame.dataset,
        "frame": frame.name,
        "split": frame.split,
        "width_px": shape[1],
        "height_px": shape[0],
        "objects": sum(not box.ignore for box in frame.boxes),
        "objects_ignored": sum(box.ignore for box in frame.boxes),
        "previous_frames": len(frame.previous),
        **dataclasses.asdict(image_statistics.measure(grey)),
    }
    noise = tiles(shape, tile_px)
    return _Entry(dataclasses.replace(result, grey=None), row, {"blur": blur, "noise": noise})


def _patch_rows(entries: Sequence[_Entry]) -> list[dict[str, Any]]:
    return [
        {
            "dataset": entry.found.frame.dataset,
            "frame": entry.found.frame.name,
            "purpose": purpose,
            "patch": number,
            **dataclasses.asdict(patch),
        }
        for entry in entries
        for purpose, patches in entry.patches.items()
        for number, patch in enumerate(patches)
    ]


def _table(rows: Sequence[dict[str, Any]], schema: Schema) -> pd.DataFrame:
    import pandas as pd

    return schema.conform(pd.DataFrame(list(rows), columns=list(schema.columns)))
