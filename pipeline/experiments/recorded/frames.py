"""Experiments recorded earlier on frames that are not kept, as `pipeline.recording.frames` wrote them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Set
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline import tables
from pipeline.errors import InputError
from pipeline.experiments.factors import EFFECTS, FACTOR_CELLS
from pipeline.experiments.tables import BLUR_CELLS, CHANGES, CURVES, NOISE_CELLS
from pipeline.stage_files import any_table, existing
from pipeline.store import Schema, read_json

if TYPE_CHECKING:
    import pandas as pd

NOISE_FILE = "noise_levels.csv"
COMBINED_FILES = ("combined_blur.csv", "combined_noise.csv", "combined_curves.csv")
DENOISED_FILE = "denoised_blur.csv"
FACTOR_FILES = ("factor_cells.csv", "factor_effects.csv")
FRAMES_FILE, PROVENANCE_FILE = "frames.csv", "provenance.json"
SCHEMAS: Mapping[str, Schema] = {
    NOISE_FILE: tables.NOISE_SUMMARY,
    **dict(zip(COMBINED_FILES, (BLUR_CELLS, NOISE_CELLS, CURVES), strict=True)),
    DENOISED_FILE: BLUR_CELLS,
    **dict(zip(FACTOR_FILES, (FACTOR_CELLS, EFFECTS), strict=True)),
}
KEYS = {"source", "dataset", "frames", "settings"}
PAPERS_ORDER = ("sim", "photos", "kitti", "udacity", "sim_authors")
"""Datasets in the order in which they are listed; others follow alphabetically."""


@dataclass(frozen=True)
class FrameRecord:
    """One record.

    Attributes:
        folder: where it is.
        provenance: `pipeline.recording.provenance`.
    """

    folder: Path
    provenance: Mapping[str, Any]

    @property
    def dataset(self) -> str:
        """Its name."""
        return str(self.provenance["dataset"])

    @property
    def source(self) -> str:
        """Of the pictures, in words."""
        return str(self.provenance["source"])

    @cached_property
    def frames(self) -> pd.DataFrame:
        """frame, width_px, height_px, blur_patches, noise_tiles."""
        return any_table(self.folder / FRAMES_FILE)

    def described(self, count: str) -> dict[str, Any]:
        """A row of the table of sources: frames, patches (of the column ``count`` of `frames`), sizes and source."""
        widths, heights = self.frames["width_px"], self.frames["height_px"]
        sizes = [f"{w} x {h}" for w, h in sorted({(int(w), int(h)) for w, h in zip(widths, heights, strict=True)})]
        return {
            "dataset": self.dataset,
            "frames": len(self.frames),
            "patches": int(self.frames[count].sum()),
            "size": sizes[0] if len(sizes) == 1 else f"{sizes[0]} to {sizes[-1]}",
            "source": self.source,
        }

    def table(self, name: str) -> pd.DataFrame:
        """A table of the record.

        Args:
            name: of the file, one of `SCHEMAS`.

        Raises:
            InputError: it is missing, or has other columns.
        """
        schema, read = SCHEMAS[name], any_table(self.folder / name)
        if schema is CURVES:  # of records from before these were kept
            read = read.assign(**{column: math.nan for column in CHANGES if column not in read})
        text = [column for column, kind in schema.columns.items() if kind == "string" and column in read]
        filled = read.assign(**{column: read[column].astype("string").fillna("") for column in text})
        return schema.conform(filled, str(self.folder / name))


def provenance_of(folder: Path, keys: Set[str]) -> dict[str, Any]:
    """The provenance of a record.

    Args:
        folder: of the record.
        keys: that it must have.

    Raises:
        InputError: it is missing, or of something else.
    """
    about = read_json(folder / PROVENANCE_FILE)
    if not isinstance(about, dict) or not set(about) >= keys:
        raise InputError(f"{folder / PROVENANCE_FILE}: expected the keys {sorted(keys)}; record it again")
    return about


def folders_with(recorded: Path | None, file: str, keys: Set[str] = KEYS) -> dict[str, Path]:
    """Dataset -> folder of the record that holds a file, in the paper's order of datasets.

    Args:
        recorded: folder whose sub-folders are records; None without any.
        file: of the record.
        keys: of its provenance.

    Raises:
        InputError: a provenance is missing or of something else, or two records are of one dataset.
    """
    location = existing(recorded)
    known: dict[str, Path] = {}
    for path in sorted(location.glob(f"[!.]*/{file}")) if location is not None else []:
        dataset = str(provenance_of(path.parent, keys)["dataset"])
        if dataset in known:
            raise InputError(f"{known[dataset]} and {path.parent}: both hold {file} of '{dataset}'; keep one")
        known[dataset] = path.parent
    order = [name for name in PAPERS_ORDER if name in known] + sorted(set(known) - set(PAPERS_ORDER))
    return {dataset: known[dataset] for dataset in order}


def records_with(recorded: Path | None, file: str) -> list[FrameRecord]:
    """Every record that holds one of the files of `SCHEMAS`, see `folders_with`."""
    return [FrameRecord(folder, provenance_of(folder, KEYS)) for folder in folders_with(recorded, file).values()]


def joined(recorded: Path | None, file: str) -> pd.DataFrame:
    """One table of all records that hold a file; empty, with its columns, where none does."""
    import pandas as pd

    parts = [record.table(file) for record in records_with(recorded, file)]
    if not parts:
        schema = SCHEMAS[file]
        return schema.conform(pd.DataFrame({column: [] for column in schema.columns}))
    return pd.concat(parts, ignore_index=True)


def not_run(recorded: pd.DataFrame, ran: pd.DataFrame) -> pd.DataFrame:
    """The rows of records on datasets that no stage has run on: a run wins over a record.

    Args:
        recorded: a table of records, with a column ``dataset``.
        ran: the same table of stages.
    """
    return recorded[~recorded["dataset"].isin(ran["dataset"])].reset_index(drop=True)


def with_records(ran: pd.DataFrame, recorded: Path | None, file: str) -> pd.DataFrame:
    """A table of stages with what was recorded on other datasets.

    Args:
        ran: of the stages, with a column ``dataset``.
        recorded: folder whose sub-folders are records; None without any.
        file: of the record, one of `SCHEMAS`.
    """
    import pandas as pd

    parts = [part for part in (ran, not_run(joined(recorded, file), ran)) if len(part)]
    return pd.concat(parts, ignore_index=True) if parts else ran
