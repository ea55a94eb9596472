"""Noise estimation on recorded frames of the paper's datasets: the paper's figure on driving pictures.

`camera-monitor record noise-levels` measures and stores (`pipeline.report.recorded_frames`); the figure and tables are
those of the section of noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pipeline.report.display_names import counted, word
from pipeline.report.frame_records import NOISE_FILE, FrameRecord, joined, records_with
from pipeline.report.inputs import ReportInputs, published
from pipeline.report.ledger import LedgerRow
from pipeline.report.sections import noise
from pipeline.report.spec import Block, Figure, Section
from pipeline.report.tables import Column, Table, named, table

TITLE = "Noise estimation on recorded frames"
TEXT = (
    "The paper's noise figure on frames of its own datasets. These pictures are not part of the project: the numbers "
    "were measured earlier and are kept in reports/recorded with the SHA-256 of every picture and weight file. Whoever "
    "has the pictures repeats them by camera-monitor record noise-levels. The paper prints this figure as a picture "
    "only; beside ours stand medians of its authors' program."
)


def sources(name: str, caption: str, records: Sequence[FrameRecord], count: str, title: str) -> Table:
    """Which frames were recorded, how many, and their source.

    Args:
        name: of the table.
        caption: of the table.
        records: shown.
        count: column of `FrameRecord.frames` with the patches of each.
        title: heading of that column.
    """
    rows = [
        {
            "dataset": one.dataset,
            "frames": len(one.frames),
            "patches": int(one.frames[count].sum()),
            "size": _size(one),
            "source": one.source,
        }
        for one in records
    ]
    columns = [
        named("dataset", "Dataset"),
        Column("frames", "Frames"),
        Column("patches", title),
        Column("size", "Frame", "px"),
        Column("source", "Source", wide=True),
    ]
    return table(name, caption, rows, columns)


def _size(record: FrameRecord) -> str:
    sizes = sorted(
        {(int(w), int(h)) for w, h in zip(record.frames["width_px"], record.frames["height_px"], strict=True)}
    )
    words = [f"{width} x {height}" for width, height in sizes]
    return words[0] if len(words) == 1 else f"{words[0]} to {words[-1]}"


def section(inputs: ReportInputs, ledger: Sequence[LedgerRow] = ()) -> Section | None:
    """Noise estimation on every recorded dataset, or None where nothing was recorded."""
    records = records_with(inputs, NOISE_FILE)
    if not records:
        return None
    summary, datasets = joined(inputs, NOISE_FILE), [one.dataset for one in records]
    caption = (
        "Recorded: noise estimation. Median (line) and range of the inliers (band) of the estimates over the target "
        "level. Thin diagonal: that level. Dashed: the noise present after clipping to 8 bit. "
        + "; ".join(
            f"{word(one.dataset)}: {counted(len(one.frames), 'frame')},"
            f" {counted(int(one.frames['noise_tiles'].sum()), 'tile')} of 128 px"
            for one in records
        )
        + "."
    )
    blocks: list[Block] = [
        sources("recorded_noise_sources", "Recorded: frames with their source.", records, "noise_tiles", "Tiles"),
        Figure("recorded_noise", noise.curves(summary, datasets), caption),
    ]
    reference = published(inputs, "noise_reference.csv")
    for one in records:
        shown = noise.medians(one.dataset, summary, reference)
        words = f"{shown.caption.rstrip('.')} (recorded)."
        blocks.append(replace(shown, name=f"recorded_{shown.name}", caption=words, stage=""))
    return Section("noise_recorded", TITLE, (TEXT,), blocks)
