"""Experiments recorded earlier on frames that are not kept, as `pipeline.recording.frames` wrote them."""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline import tables
from pipeline.errors import InputError
from pipeline.experiments.factors import EFFECTS, FACTOR_CELLS
from pipeline.experiments.tables import BLUR_CELLS, CURVES, NOISE_CELLS
from pipeline.report.display_names import DATASETS, in_order
from pipeline.report.inputs import ReportInputs, any_table, existing
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

    def table(self, name: str) -> pd.DataFrame:
        """A table of the record.

        Args:
            name: of the file, one of `SCHEMAS`.

        Raises:
            InputError: it is missing, or has other columns.
        """
        schema, read = SCHEMAS[name], any_table(self.folder / name)
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


def folders_with(inputs: ReportInputs, file: str, keys: Set[str] = KEYS) -> dict[str, Path]:
    """Dataset -> folder of the record that holds a file, in the report's order.

    Args:
        inputs: of the report.
        file: of the record.
        keys: of its provenance.

    Raises:
        InputError: a provenance is missing or of something else, or two records are of one dataset.
    """
    location = existing(inputs.recorded)
    known: dict[str, Path] = {}
    for path in sorted(location.glob(f"*/{file}")) if location is not None else []:
        dataset = str(provenance_of(path.parent, keys)["dataset"])
        if dataset in known:
            raise InputError(f"{known[dataset]} and {path.parent}: both hold {file} of '{dataset}'; keep one")
        known[dataset] = path.parent
    return {dataset: known[dataset] for dataset in in_order(known, DATASETS)}


def records_with(inputs: ReportInputs, file: str) -> list[FrameRecord]:
    """Every record that holds one of the files of `SCHEMAS`, see `folders_with`."""
    return [FrameRecord(folder, provenance_of(folder, KEYS)) for folder in folders_with(inputs, file).values()]


def joined(inputs: ReportInputs, file: str) -> pd.DataFrame:
    """One table of all records that hold a file; empty, with its columns, where none does."""
    import pandas as pd

    parts = [record.table(file) for record in records_with(inputs, file)]
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
