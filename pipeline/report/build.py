"""Build the report: every figure, table, the ledger and the page, from the files of the stages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.executor import run_map
from pipeline.report import page, provenance, style, table_formats, training_budget
from pipeline.report.inputs import ReportInputs
from pipeline.report.ledger.items import NO_REAL_FRAMES, TITLES, all_rows
from pipeline.report.ledger.rows import Score, score, summary_table, to_table
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
    noise_budget,
    optics,
    real_blur,
    real_noise,
    runtime,
    training,
)
from pipeline.report.spec import Figure, Section
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
    noise_budget.section,
    combined.section,
    combined.recorded,
    frame_ranking.section,
    detection.section,
    control.section,
    training.section,
    runtime.section,
)
"""Every section in the paper's order: a function of the inputs, None where it has nothing to show."""

BLUR, NOISE = ("blur",), ("noise",)
TASKS: Mapping[Callable[..., Any], tuple[str, ...]] = {
    blur.section: BLUR,
    blur.recorded: BLUR,
    real_blur.section: BLUR,
    factors.section: BLUR,
    combined.section: BLUR,
    combined.recorded: BLUR,
    noise.section: NOISE,
    noise.recorded: NOISE,
    real_noise.section: NOISE,
}
"""Section -> task of the paper's network that it shows; sections of both, or of neither, are not named."""


@dataclass(frozen=True)
class Drawn:
    """Makes a section and writes its figures, in whatever process it is called.

    Attributes:
        inputs: the files of the stages.
        folder: where figures are written.
    """

    inputs: ReportInputs
    folder: Path

    @style.styled
    def __call__(self, make: Callable[[ReportInputs], Section | None]) -> Section | None:
        """The section, its figures emptied: what they show is in their files. None where there is nothing to show."""
        with training_budget.named(self.inputs, *TASKS.get(make, ())):
            section = make(self.inputs)
        figures = [] if section is None else [block for block in section.blocks if isinstance(block, Figure)]
        for figure in figures:
            style.save(figure.drawing.figure, self.folder / figure.name, figure.drawing.values)
        for figure in figures:
            figure.drawing.figure.clear()  # of no use any more, and slow to hand to another process
        return section


@style.styled
def build(inputs: ReportInputs, out_dir: str | Path, workers: int = 1) -> Score:
    """Write the report into a folder; sub-folders of an earlier run are replaced.

    Writes ``index.html``, ``figures/`` (SVG, PNG, values as CSV), ``tables/`` (CSV, Markdown, LaTeX; the whole ledger
    among them). The bytes depend on the inputs only.

    Args:
        inputs: the files of the stages.
        out_dir: usually ``reports``.
        workers: processes that sections are drawn by; changes no byte.

    Returns:
        the ledger's score, whose `Score.metrics` suit a metrics file.

    Raises:
        InputError: a stage's file is broken or incomplete. A stage that has not run is no error: it is shown as such.
    """
    out = Path(out_dir)
    with training_budget.named(inputs):
        rows = all_rows(inputs)
        with replacing_folder(out / "figures") as folder:
            made = run_map(Drawn(inputs, folder), SECTIONS, workers=workers, label="sections of the report")
            sections = [section for section in made if section is not None]
            blocks = [block for section in sections for block in section.blocks]
            figures = [block for block in blocks if isinstance(block, Figure)]
            svgs = {item.name: (folder / f"{item.name}.svg").read_text(encoding="utf-8") for item in figures}
        with replacing_folder(out / "tables") as folder:
            for block in [*blocks, to_table(rows), summary_table(rows, TITLES, NO_REAL_FRAMES)]:
                if isinstance(block, Table):
                    table_formats.save(block, folder)
        origins = provenance.origins(figures, inputs)
        text = page.render(sections, rows, origins, svgs, inputs.profile, inputs.code_version)
        write_text(out / "index.html", text)
        return score(rows)
