"""Noise estimation on recorded frames of the paper's datasets: the paper's figure on driving pictures.

`camera-monitor record noise-levels` measures and stores (`pipeline.recording.frames`); the figure and tables are
those of the section of noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pipeline.report.display_names import counted, word
from pipeline.report.frame_records import NOISE_FILE, FrameRecord, joined, records_with
from pipeline.report.inputs import ReportInputs, published
from pipeline.report.ledger import LedgerRow
from pipeline.report.sections import noise
from pipeline.report.sections.noise import PAGE
from pipeline.report.spec import Block, Section
from pipeline.report.tables import as_recorded

TITLE = "Noise estimation on recorded frames"


def sources(records: Sequence[FrameRecord], count: str) -> list[dict[str, Any]]:
    """Which frames were recorded, how many, and their source, as rows of a table.

    Args:
        records: shown.
        count: column of `FrameRecord.frames` with the patches of each.
    """
    return [
        {
            "dataset": one.dataset,
            "frames": len(one.frames),
            "patches": int(one.frames[count].sum()),
            "size": _size(one),
            "source": one.source,
        }
        for one in records
    ]


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
    counts = [
        f"{word(one.dataset)}: {counted(len(one.frames), 'frame')},"
        f" {counted(int(one.frames['noise_tiles'].sum()), 'tile')} of 128 px"
        for one in records
    ]
    blocks: list[Block] = [
        PAGE.table("recorded_noise_sources", sources(records, "noise_tiles")),
        PAGE.figure("recorded_noise", noise.curves(summary, datasets), after=f"{'; '.join(counts)}."),
    ]
    reference = published(inputs, "noise_reference.csv")
    blocks += [as_recorded(noise.medians(one.dataset, summary, reference)) for one in records]
    return Section("noise_recorded", TITLE, (PAGE.text("recorded"),), blocks)
