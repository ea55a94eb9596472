"""Build the report: every figure, table, the ledger and the page, from the files the stages left."""

from __future__ import annotations

from pathlib import Path

from pipeline.report import page, provenance, style, table_formats
from pipeline.report.inputs import ReportInputs
from pipeline.report.ledger import LedgerRow, Score, score, summary_table, to_table
from pipeline.report.ledger_items import ITEMS, all_rows
from pipeline.report.provenance import Provenance
from pipeline.report.sections import (
    blur,
    blur_recorded,
    combined,
    datasets,
    detection,
    formation,
    noise,
    optics,
    published,
    runtime,
    training,
)
from pipeline.report.sections.base import Section, ShownFigure
from pipeline.report.tables import Table
from pipeline.store import replacing_folder, write_text

__all__ = ["ReportInputs", "build"]

OWN = {"combined": combined.section, "detection": detection.section}
"""Chapters that show more than the paper's published numbers."""


def _sections(inputs: ReportInputs, rows: list[LedgerRow]) -> list[Section]:
    """Every section, in the paper's order."""
    recorded = blur_recorded.section(inputs)
    return [
        datasets.section(inputs),
        formation.section(inputs),
        optics.section(inputs),
        blur.section(inputs),
        *([] if recorded is None else [recorded]),
        noise.section(inputs),
        *(OWN.get(chapter.key, published.section)(chapter, rows, inputs) for chapter in published.AFTER_NOISE),
        training.section(inputs),
        runtime.section(inputs),
    ]


def _origins(sections: list[Section], inputs: ReportInputs) -> list[Provenance]:
    """The origin of each figure, which between them name every stage shown."""
    stages = provenance.read_lock(inputs.lock)
    return [
        provenance.origin(block.name, stage, stages, inputs)
        for section in sections
        for block in section.blocks
        if isinstance(block, ShownFigure)
        for stage in block.stages
    ]


def build(inputs: ReportInputs, out_dir: str | Path) -> Score:
    """Write the report into a folder; what an earlier run left in its sub-folders is replaced.

    Writes ``index.html``, ``figures/`` (SVG, PNG, values as CSV), ``tables/`` (CSV, Markdown, LaTeX; the whole ledger
    among them). The bytes depend on the inputs only.

    Args:
        inputs: where the stages left their files.
        out_dir: usually ``reports``.

    Returns:
        the ledger's score, whose `Score.metrics` suit a metrics file.

    Raises:
        InputError: a stage's file is broken or incomplete. A stage that has not run is no error: it is shown as such.
    """
    out = Path(out_dir)
    rows = all_rows(inputs)
    sections = _sections(inputs, rows)
    blocks = [block for section in sections for block in section.blocks]
    svgs = {}
    with replacing_folder(out / "figures") as folder:
        for block in blocks:
            if isinstance(block, ShownFigure):
                written = style.save(block.drawing.figure, folder / block.name, block.drawing.values)
                svgs[block.name] = written[0].read_text(encoding="utf-8")
    titles = {item.name: item.title for item in ITEMS}
    with replacing_folder(out / "tables") as folder:
        for block in [*blocks, to_table(rows), summary_table(rows, titles)]:
            if isinstance(block, Table):
                table_formats.save(block, folder)
    text = page.render(sections, rows, _origins(sections, inputs), svgs, inputs.profile, inputs.code_version)
    write_text(out / "index.html", text)
    return score(rows)
