"""The page: one self-contained HTML file with figures, tables, ledger and provenance inside.

Nothing is loaded from elsewhere, and nothing in it depends on the time, the machine or the place of the files:
the bytes follow from the inputs. It reads without JavaScript; with it, tables sort and series switch off.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from pipeline.report import style, svg, templates
from pipeline.report.display_names import DATASETS, in_order, listing, word
from pipeline.report.ledger.items import ITEMS, NO_REAL_FRAMES, PICTURES_ONLY, TITLES
from pipeline.report.ledger.rows import VERDICTS, LedgerRow, score, summary_table, to_table
from pipeline.report.provenance import Provenance
from pipeline.report.spec import Figure, Section
from pipeline.report.table_formats import to_html

FOLDED_ROWS = 40
"""Tables of more rows open by a click on the number of their rows."""

# The figures' neutral colours, and the blue that is too dark on a dark page, become the page's own.
_COLOURS = {
    style.INK: "var(--ink)",
    style.MUTED: "var(--muted)",
    style.GRID: "var(--rule)",
    style.PAPER: "var(--page)",
    style.PALETTE[0]: "var(--blue)",
}


def themed(colours: str) -> str:
    """Text with the figures' colours replaced by the page's, which follow light or dark."""
    for colour, variable in _COLOURS.items():
        colours = colours.replace(colour, variable)
    return colours


def _ledger_parts(rows: Sequence[LedgerRow]) -> list[dict[str, Any]]:
    """The ledger item by item: its table, its counts, and the lines that would run what is missing."""
    parts = []
    for item in ITEMS:
        selected = [row for row in rows if row.item == item.name]
        if selected:
            result, table = score(selected), to_table(selected, f"ledger_{item.name}", f"{item.title}.")
            missing = sorted({(row.why, row.line) for row in selected if row.verdict == "not run"})
            # The files are those of the whole ledger.
            shown = to_html(replace(table, footnotes=()), files=False)
            any_ran = result.total > result.counts["not run"]
            part = {"title": item.title, "score": result, "any": any_ran, "missing": missing, "table": shown}
            parts.append(part)
    return parts


def render(
    sections: Sequence[Section],
    rows: Sequence[LedgerRow],
    origins: Sequence[Provenance],
    svgs: Mapping[str, str],
    profile: str,
    code_version: str,
) -> str:
    """The whole page.

    Returns:
        HTML.
    """
    runs = [run for section in sections for run in section.runs]
    figures = [block for section in sections for block in section.blocks if isinstance(block, Figure)]
    shared, drawn = svg.inline(svgs, {figure.name: figure.drawing.alt for figure in figures})
    return templates.environment().get_template("page.html.j2").render(
        sections=sections, score=score(rows), verdicts=VERDICTS, ledger=_ledger_parts(rows), runs=runs, origins=origins,
        ledger_summary=to_html(summary_table(rows, TITLES, NO_REAL_FRAMES)), pictures_only=PICTURES_ONLY,
        states=Counter(run.state for run in runs), profile=profile, code_version=code_version, listing=listing,
        css=templates.text("style.css"), script=templates.text("script.js"), shared=themed(shared),
        svg=lambda figure: themed(drawn[figure.name]), word=word, themed=themed,
        table=lambda table: to_html(table, folded=len(table.rows) > FOLDED_ROWS),
        width=lambda figure: round(100 * figure.drawing.figure.get_figwidth() / style.TWO_COLUMNS_IN),
        datasets=in_order((run.dataset for run in runs if run.dataset), DATASETS),
    )  # fmt: skip
