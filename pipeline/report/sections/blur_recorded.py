"""The section of blur estimation on recorded pictures: the paper's own datasets, measured by hand with its own kernels.

It is drawn from what `camera-monitor blur record` kept (`pipeline.report.recorded_blur`), as the section of blur is
from the outputs of the stage.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pipeline.report import blur_records, blur_tables, sharp_curves_figure
from pipeline.report.blur_records import BlurRecord
from pipeline.report.inputs import ReportInputs
from pipeline.report.sections import blur_amae
from pipeline.report.sections.base import Block, Section, ShownFigure
from pipeline.report.tables import Cell, Column, Table
from pipeline.report.wording import ESTIMATORS, in_order, word

TITLE = "Blur estimation on recorded pictures"
TEXT = (
    "Table I as above, on frames of the paper's own datasets and with the kernels its authors publish. These pictures "
    "are not part of the project: the numbers were measured earlier and are kept in reports/recorded with the SHA-256 "
    "of every picture, kernel and weight file. Whoever has the pictures repeats them by camera-monitor blur record."
)
FRAMES = "Frames are a few of each dataset; the paper takes 150."


def _sources(found: Sequence[BlurRecord]) -> Table:
    rows: list[dict[str, Cell]] = [
        {
            "dataset": word(one.dataset),
            "frames": len(one.said["frames"]),
            "patches": one.patches,
            "kernels": len(one.said["kernels"]),
            "estimators": "; ".join(map(word, in_order(one.estimators, ESTIMATORS))),
            "source": one.said["source"],
        }
        for one in found
    ]
    columns = [
        Column("dataset", "Dataset"),
        Column("frames", "Frames"),
        Column("patches", "Patches"),
        Column("kernels", "Kernels"),
        Column("estimators", "Estimators", wide=True),
        Column("source", "Source", wide=True),
    ]
    return Table("recorded_blur_sources", "Recorded: pictures, kernels and where they come from.", columns, rows)


def _recorded(table: Table, notes: Sequence[str]) -> Table:
    """A table of the section of blur as one of recorded pictures, which no stage makes."""
    caption = f"{table.caption.rstrip('.')} (recorded)."
    return replace(table, name=f"recorded_{table.name}", caption=caption, footnotes=tuple(notes), stage="")


def section(inputs: ReportInputs) -> Section | None:
    """Blur estimation on every recorded dataset, or None where nothing was recorded."""
    import pandas as pd

    found = blur_records.read(inputs)
    if not found:
        return None
    datasets = [one.dataset for one in found]
    summary = pd.concat([one.summary for one in found], ignore_index=True)
    paper = blur_tables.paper_table(inputs, "blur_amae.csv")
    published = blur_tables.published_amae(paper)
    figures: list[Block] = []
    tables: list[Block] = []
    sharp = [one.sharp for one in found if len(one.sharp)]
    if sharp:
        drawing = sharp_curves_figure.draw(
            pd.concat(sharp, ignore_index=True), datasets, blur_tables.paper_table(inputs, "uncorrupted_mtf.csv")
        )
        caption = (
            "Recorded: uncorrupted datasets. Median (line) and range of the inliers (band) of the MTF over patches of "
            "sharp frames. Dashed: the paper's medians, which it publishes for the horizontal direction."
        )
        figures.append(ShownFigure("recorded_uncorrupted_mtf", drawing, caption))
    figures += blur_amae.figures(summary, datasets, paper, lambda _: (), "recorded")
    for one in found:
        for is_calibrated in (False, True):
            if (one.summary["calibrated"] == is_calibrated).any():
                table = blur_tables.amae(one.dataset, one.summary, published, is_calibrated)
                tables.append(_recorded(table, [*table.footnotes, FRAMES]))
    beside = blur_tables.beside_the_best(summary, published)
    extra = [] if beside is None else [_recorded(beside, [blur_tables.NOT_COUNTED, FRAMES])]
    return Section("blur_recorded", TITLE, (TEXT,), [_sources(found), *figures, *tables, *extra])
