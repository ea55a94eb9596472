"""Build the report: every figure, table, the ledger and the page, from the files of the stages."""

from __future__ import annotations

from pathlib import Path

from pipeline.report import page, provenance, style, table_formats, training_budget
from pipeline.report.display_names import qualified
from pipeline.report.inputs import ReportInputs
from pipeline.report.ledger import Score, score, summary_table, to_table
from pipeline.report.ledger_items import NO_REAL_FRAMES, TITLES, all_rows
from pipeline.report.sections import (
    blur,
    claims,
    combined,
    control,
    datasets,
    detection,
    disclosure,
    factors,
    formation,
    frame_ranking,
    noise,
    optics,
    real_blur,
    real_noise,
    runtime,
    training,
)
from pipeline.report.spec import Figure
from pipeline.report.tables import Table
from pipeline.store import replacing_folder, write_text

SECTIONS = (
    claims.section,
    disclosure.section,
    datasets.section,
    formation.section,
    optics.section,
    blur.section,
    blur.recorded,
    real_blur.section,
    factors.section,
    noise.section,
    noise.recorded,
    real_noise.section,
    combined.section,
    combined.recorded,
    frame_ranking.section,
    detection.section,
    control.section,
    training.section,
    runtime.section,
)
"""Every section in the paper's order: a function of the inputs, None where it has nothing to show."""


@style.styled
def build(inputs: ReportInputs, out_dir: str | Path) -> Score:
    """Write the report into a folder; sub-folders of an earlier run are replaced.

    Writes ``index.html``, ``figures/`` (SVG, PNG, values as CSV), ``tables/`` (CSV, Markdown, LaTeX; the whole ledger
    among them). The bytes depend on the inputs only.

    Args:
        inputs: the files of the stages.
        out_dir: usually ``reports``.

    Returns:
        the ledger's score, whose `Score.metrics` suit a metrics file.

    Raises:
        InputError: a stage's file is broken or incomplete. A stage that has not run is no error: it is shown as such.
    """
    out = Path(out_dir)
    with qualified(training_budget.names(inputs)):
        rows = all_rows(inputs)
        sections = [section for make in SECTIONS if (section := make(inputs)) is not None]
        blocks = [block for section in sections for block in section.blocks]
        svgs = {}
        with replacing_folder(out / "figures") as folder:
            for figure in (block for block in blocks if isinstance(block, Figure)):
                written = style.save(figure.drawing.figure, folder / figure.name, figure.drawing.values)
                svgs[figure.name] = written[0].read_text(encoding="utf-8")
        with replacing_folder(out / "tables") as folder:
            for block in [*blocks, to_table(rows), summary_table(rows, TITLES, NO_REAL_FRAMES)]:
                if isinstance(block, Table):
                    table_formats.save(block, folder)
        origins = provenance.origins([block for block in blocks if isinstance(block, Figure)], inputs)
        text = page.render(sections, rows, origins, svgs, inputs.profile, inputs.code_version)
        write_text(out / "index.html", text)
        return score(rows)
