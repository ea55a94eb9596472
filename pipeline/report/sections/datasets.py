"""The section of the datasets: frames shown, pixel statistics, sizes, and what was put in quarantine."""

from __future__ import annotations

from pathlib import PurePath
from typing import TYPE_CHECKING

from pipeline import tables
from pipeline.report import datasets_figure
from pipeline.report.datasets_figure import DatasetSample
from pipeline.report.inputs import ReportInputs, existing, optional_arrays, optional_json, optional_table
from pipeline.report.sections.base import Block, Section, ShownFigure, missing, overview
from pipeline.report.tables import Cell, Column, Estimate, Table
from pipeline.report.wording import word
from pipeline.statistics import robust
from pipeline.streams import stream

if TYPE_CHECKING:
    import pandas as pd

STAGE = "index@{dataset}"
PREFIX = "frame_"
# Column of the frames table -> heading, unit, decimals.
STATISTICS = {
    "mean_dn": ("Mean", "DN", 1),
    "std_dn": ("Std. dev.", "DN", 1),
    "spectrum_slope": ("Spectral slope", "log/log", 2),
    "gradient_mean_dn": ("Gradient, mean", "DN", 1),
    "gradient_p99_dn": ("Gradient, 99 %", "DN", 0),
    "flat_fraction": ("Flat", "share", 3),
    "saturated_fraction": ("Saturated", "share", 3),
}


def _samples(inputs: ReportInputs) -> list[DatasetSample]:
    found = []
    for dataset in inputs.datasets:
        folder = inputs.index.get(dataset)
        arrays = optional_arrays(folder, "samples.npz")
        frames = {name.removeprefix(PREFIX): array for name, array in arrays.items() if name.startswith(PREFIX)}
        if frames:
            boxes = optional_json(folder, "samples.json") or {}
            patches = optional_table(folder, "patches.parquet", tables.PATCHES)
            found.append(DatasetSample(dataset, frames, boxes, patches))
    return found


def _sizes(frames: dict[str, pd.DataFrame], inputs: ReportInputs) -> Table:
    rows: list[dict[str, Cell]] = []
    for dataset, table in frames.items():
        patches = optional_table(inputs.index[dataset], "patches.parquet", tables.PATCHES)
        quarantine = optional_table(inputs.index[dataset], "quarantine.parquet", tables.QUARANTINE)
        purposes = patches["purpose"].value_counts().to_dict() if patches is not None else {}
        sizes = table.groupby(["width_px", "height_px"]).size().sort_values(ascending=False, kind="stable")
        size = "\u00a0×\u00a0".join(str(side) for side in sizes.index[0]) if len(sizes) else ""
        rows.append(
            {
                "dataset": word(dataset),
                "frames": len(table),
                "size_px": size + (" and others" if len(sizes) > 1 else ""),
                "objects": int(table["objects"].sum()),
                "ignored": int(table["objects_ignored"].sum()),
                "blur_patches": int(purposes.get("blur", 0)),
                "noise_patches": int(purposes.get("noise", 0)),
                "quarantined": len(quarantine) if quarantine is not None else None,
            }
        )
    columns = [
        Column("dataset", "Dataset"),
        Column("frames", "Frames"),
        Column("size_px", "Size", "px"),
        Column("objects", "Objects"),
        Column("ignored", "of them ignored"),
        Column("blur_patches", "Blur patches"),
        Column("noise_patches", "Noise patches"),
        Column("quarantined", "In quarantine"),
    ]
    notes = ("An ignored object counts neither way in average precision, and no patch is taken from it.",)
    return Table("dataset_sizes", "What was used of each dataset.", columns, rows, notes, "index@<dataset>")


def _statistics(frames: dict[str, pd.DataFrame]) -> Table:
    rows: list[dict[str, Cell]] = []
    for dataset, table in frames.items():
        row: dict[str, Cell] = {"dataset": word(dataset)}
        for name in STATISTICS:
            found = robust(table[name], stream(0, "report", "frames", dataset, name))
            row[name] = Estimate(found.median, found.low, found.high, found.count)
        rows.append(row)
    columns = [Column("dataset", "Dataset")]
    columns += [Column(name, title, unit, decimals) for name, (title, unit, decimals) in STATISTICS.items()]
    notes = (
        "Median over frames after rejecting outliers (3.5 MAD), with its bootstrap 95 % interval and number of frames. "
        "Gradient: magnitude of finite differences. Flat: share of pixels whose gradient is below 1.5 DN.",
    )
    caption = "Pixel statistics: how alike the datasets are."
    return Table("dataset_statistics", caption, columns, rows, notes, "index@<dataset>")


def _quarantine(inputs: ReportInputs) -> Table | None:
    rows: list[dict[str, Cell]] = []
    for dataset in inputs.datasets:
        table = optional_table(inputs.index.get(dataset), "quarantine.parquet", tables.QUARANTINE)
        if table is None or table.empty:
            continue
        for reason, files in table.groupby("reason", sort=True)["file"]:
            names = sorted(PurePath(str(name)).name for name in files)
            rows.append(
                {
                    "dataset": word(dataset),
                    "reason": str(reason),
                    "files": len(names),
                    "examples": ", ".join(names[:3]) + (" …" if len(names) > 3 else ""),
                }
            )
    if not rows:
        return None
    columns = [
        Column("dataset", "Dataset"),
        Column("reason", "Reason", wide=True),
        Column("files", "Files"),
        Column("examples", "Examples", wide=True),
    ]
    return Table("quarantine", "Files set aside, and why.", columns, rows, (), "index@<dataset>")


def section(inputs: ReportInputs) -> Section:
    """Datasets: figure, sizes, statistics, quarantine; what is absent is said."""
    frames: dict[str, pd.DataFrame] = {}
    for dataset in inputs.datasets:
        table = optional_table(inputs.index.get(dataset), "frames.parquet", tables.FRAMES)
        if table is not None:
            frames[dataset] = table
    runs = overview("Datasets", STAGE, list(frames), inputs)
    blocks: list[Block] = []
    samples = _samples(inputs)
    if samples:
        caption = (
            "Datasets. Sample frames with object boxes (solid; dotted where ignored) and the patches on which blur is "
            "estimated (dashed). Below: power spectrum and histogram of the frames shown."
        )
        stages = tuple(STAGE.format(dataset=sample.name) for sample in samples)
        blocks.append(ShownFigure("datasets", datasets_figure.draw(samples), caption, stages))
    if frames:
        blocks += [_sizes(frames, inputs), _statistics(frames)]
    quarantine = _quarantine(inputs)
    if quarantine is not None:
        blocks.append(quarantine)
    text = []
    scanned = [name for name in inputs.index if existing(inputs.index[name] / "quarantine.parquet") is not None]
    if scanned and quarantine is None:
        text.append("Every file of the datasets used was readable and well labelled; none is in quarantine.")
    return Section("datasets", "Datasets", text, [*blocks, *missing("Dataset figure and statistics", runs)], runs)
