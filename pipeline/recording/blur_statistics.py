"""Statistics of a record of blur computed again from estimates of every patch: nothing is measured.

Where the statistics of an experiment change, for example its intervals, the measurements behind a record stay what they
are. They are the estimates that the record keeps, or finished frames that ``--keep`` stored while it was measured. They
belong to the record where they give its AMAE; else nothing is written.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pipeline import store
from pipeline.camera.mtf import FREQUENCIES, SYSTEM
from pipeline.datasets.selection import evenly_spread
from pipeline.errors import InputError
from pipeline.experiments import table_one
from pipeline.experiments.metrics import table_one_metrics
from pipeline.experiments.recorded.blur import (
    ESTIMATES_FILE,
    KEYS,
    METRICS_FILE,
    PATCHES_FILE,
    SHARP_FILE,
    SUMMARISED,
    SUMMARY_FILE,
    BlurRecord,
    estimates_of,
    read_folder,
)
from pipeline.experiments.recorded.frames import PROVENANCE_FILE, provenance_of
from pipeline.experiments.sharp_curves import sharp_curves
from pipeline.experiments.tables import BLUR_ESTIMATES, MEASUREMENTS, measurements_of, rounded, written
from pipeline.recording.kept_results import kept_tables
from pipeline.recording.provenance import csv_text, write_csv

if TYPE_CHECKING:
    import pandas as pd

CELL = ["blur_kind", "kernel_size_px", "calibrated"]
TOLERANCE_PERCENT = 1e-3
"""Between an AMAE and that of estimates with five decimals, percentage points."""


def summarise_again(folder: Path, kept: Path | None = None) -> list[str]:
    """Compute the statistics of a record again: its tables of cells and of sharp frames, and its metrics.

    Args:
        folder: of the record; its files are replaced.
        kept: folder of finished frames (`pipeline.recording.kept_results`); their estimates join those of the record.

    Returns:
        the estimators whose statistics differ from those recorded before; the provenance names them as well.

    Raises:
        InputError: the record is broken, there are no estimates, or they are not those behind the record.
    """
    import pandas as pd

    if not (folder / SUMMARY_FILE).is_file():
        raise InputError(f"{folder}: no record of blur there; camera-monitor blur record makes one")
    record, metadata, estimates = read_folder(folder), provenance_of(folder, KEYS), estimates_of(folder)
    if kept is not None:
        more = _kept_estimates(kept, record, folder)
        estimates = pd.concat([estimates[~estimates["estimator"].isin(more["estimator"])], more], ignore_index=True)
    if estimates.empty:
        raise InputError(
            f"{folder}: no {ESTIMATES_FILE} to compute statistics from; measure it again (camera-monitor blur record), "
            "or give the finished frames that --keep stored with --kept"
        )
    seed, draws = int(metadata["seed"]), int(metadata["blur"]["bootstrap_draws"])
    summary, sharp, metrics = record.summary, record.sharp, store.read_json(folder / METRICS_FILE)
    changed = []
    for name in dict.fromkeys(estimates["estimator"].astype(str)):
        rows = estimates[estimates["estimator"] == name]
        cells = table_one.raw_and_divided(measurements_of(rows, "mtf"), seed, draws)
        _refuse_others(record, name, cells, folder)
        curves = sharp_curves(rows[rows["relative_to"] == SYSTEM], seed)[list(sharp.columns)]
        if any(_text(table, name) != _text(anew, name) for table, anew in ((summary, cells), (sharp, curves))):
            changed.append(name)
        summary, sharp = _exchanged(summary, cells, name), _exchanged(sharp, curves, name)
        metrics[name] = table_one_metrics(cells)
    if changed:
        metadata[SUMMARISED] = sorted({*metadata.get(SUMMARISED, ()), *changed})
    with store.replacing_folder(folder) as anew:
        shutil.copytree(folder, anew, dirs_exist_ok=True)
        write_csv(anew / SUMMARY_FILE, summary)
        write_csv(anew / SHARP_FILE, sharp)
        store.write_table(anew / ESTIMATES_FILE, estimates, BLUR_ESTIMATES)
        store.write_json(anew / METRICS_FILE, metrics)
        store.write_json(anew / PROVENANCE_FILE, metadata)
    return changed


def _exchanged(table: pd.DataFrame, anew: pd.DataFrame, estimator: str) -> pd.DataFrame:
    """The table with the rows of an estimator in the position of its earlier ones, or last."""
    import pandas as pd

    known = (table["estimator"] == estimator).to_numpy(bool)
    first = int(np.argmax(known)) if known.any() else len(table)
    parts = (table[:first][~known[:first]], anew, table[first:][~known[first:]])
    return pd.concat([part for part in parts if len(part)], ignore_index=True)


def _text(table: pd.DataFrame, estimator: str) -> str:
    """The rows of an estimator as they are written."""
    return csv_text(table[table["estimator"] == estimator])


def _refuse_others(record: BlurRecord, estimator: str, cells: pd.DataFrame, folder: Path) -> None:
    """Raises InputError where estimates do not give the AMAE and the counts recorded of an estimator."""
    columns = ["amae_percent", "count", "abstained"]
    before = record.summary[record.summary["estimator"] == estimator].set_index(CELL)[columns].sort_index()
    after = cells.set_index(CELL)[columns].sort_index()
    # The AMAE of a cell in which every estimate abstained is NaN, before and after.
    same = before.index.equals(after.index) and np.allclose(
        before.to_numpy(float), after.to_numpy(float), rtol=0.0, atol=TOLERANCE_PERCENT, equal_nan=True
    )
    if not same:
        raise InputError(
            f"{folder}: estimates of '{estimator}' give another AMAE than that recorded, so they are not those behind "
            "it; measure it again (camera-monitor blur record --join)"
        )


def _kept_estimates(kept: Path, record: BlurRecord, folder: Path) -> pd.DataFrame:
    """Estimates of the patches behind a record, from finished frames.

    Returns:
        `BLUR_ESTIMATES` of the estimators that every frame is there of.

    Raises:
        InputError: there are none of this record.
    """
    import pandas as pd

    parts = [pd.DataFrame(columns) for columns in kept_tables(kept) if set(columns) == set(MEASUREMENTS.columns)]
    table = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=list(MEASUREMENTS.columns))
    of_record = (table["dataset"] == record.dataset) & (table["quantity"] == "mtf")
    table = MEASUREMENTS.conform(table[of_record].drop_duplicates(), str(kept))
    in_record = store.read_csv(folder / PATCHES_FILE, "restore it from git", {"frame": "str"})
    with_patches = list(dict.fromkeys(in_record["frame"]))
    whole = []
    for name in record.estimators:
        frames, patches = record.measured_on(name)
        rows = table[(table["estimator"] == name) & table["frame"].isin(evenly_spread(with_patches, frames))]
        conditions = len(record.provenance["kernels"]) + 1  # and the sharp frame
        if len(rows) == patches * conditions * 2 * len(FREQUENCIES):
            whole.append(rows)
    if not whole:
        raise InputError(
            f"{kept}: no estimator of {folder} with all its frames and kernels, so nothing to compute statistics from; "
            "give the folder that --keep named when it was measured"
        )
    return written(rounded(pd.concat(whole, ignore_index=True)), "mtf", BLUR_ESTIMATES)
