"""Writers of a `Table`: CSV for programs, Markdown for repositories, LaTeX (booktabs) for papers, HTML for the page."""

from __future__ import annotations

import csv
import io
import math
import re
from pathlib import Path

from pipeline.report.tables import Cell, Column, Estimate, Table, format_cell, format_interval, format_number
from pipeline.store import write_text

_TEX = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{", "}": r"\}",
    "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "−": r"$-$", "–": "--", "×": r"$\times$", "σ": r"$\sigma$",
    "±": r"$\pm$", "≥": r"$\geq$", "≤": r"$\leq$", "°": r"\textdegree{}", "α": r"$\alpha$", "χ": r"$\chi$",
    "→": r"$\to$", "↑": r"$\uparrow$", "µ": r"\textmu{}", "·": r"$\cdot$", "✓": r"\checkmark{}",
    "²": r"\textsuperscript{2}", "₁": r"$_1$", "₂": r"$_2$", "λ": r"$\lambda$", "<": r"\textless{}",
    ">": r"\textgreater{}", "|": r"\textbar{}", "\xa0": "~",
}  # fmt: skip
_TEX_PATTERN = re.compile("|".join(re.escape(sign) for sign in _TEX))


def _exact(value: float | None) -> str:
    """A number for programs: every digit that matters, empty for NaN."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    return repr(int(value)) if float(value).is_integer() and abs(value) < 1e15 else f"{value:.8g}"


def to_csv(table: Table) -> str:
    """Comma-separated values; an estimate ``x`` also fills ``x_low``, ``x_high``, ``x_count`` and ``x_reference``.

    Where estimates of a column have marks, ``x_mark`` holds them.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    split = {column.name for column in table.columns if table.has_estimates(column)}
    marked = {name for name in split if any(isinstance(c := row.get(name), Estimate) and c.mark for row in table.rows)}
    ends = ("", "_low", "_high", "_count", "_reference")
    heads = {name: (*ends, "_mark") if name in marked else ends for name in split}
    writer.writerow([column.name + end for column in table.columns for end in heads.get(column.name, ("",))])
    for row in table.rows:
        line: list[str] = []
        for column in table.columns:
            cell = row.get(column.name)
            if column.name in split:
                if not isinstance(cell, Estimate):
                    cell = Estimate(cell if isinstance(cell, (int, float)) else math.nan)
                parts = (cell.value, cell.low, cell.high, cell.count, cell.reference)
                line += [_exact(part) for part in parts]
                line += [cell.mark] if column.name in marked else []
            elif isinstance(cell, (int, float)) and not isinstance(cell, bool):
                line.append(_exact(cell))
            else:
                line.append(format_cell(cell, column))
        writer.writerow(line)
    return out.getvalue()


def to_markdown(table: Table) -> str:
    """A GitHub table: caption in bold, numbers set right, footnotes beneath."""

    def safe(text: str) -> str:
        return text.replace("|", "\\|").replace("\n", " ")

    lines = [f"**{safe(table.caption)}**", ""]
    lines.append("| " + " | ".join(safe(column.heading) for column in table.columns) + " |")
    lines.append("|" + "|".join("---:" if table.is_numeric(column) else "---" for column in table.columns) + "|")
    for row in table.rows:
        cells = (safe(format_cell(row.get(column.name), column, table.reference_word)) for column in table.columns)
        lines.append("| " + " | ".join(cells) + " |")
    lines += [f"\n{safe(note)}" for note in table.footnotes]
    if table.stage:
        lines.append(f"\nMade by `{table.stage}`.")
    return "\n".join(lines) + "\n"


def tex(text: str) -> str:
    """Text with LaTeX's special characters escaped."""
    return _TEX_PATTERN.sub(lambda match: _TEX[match.group(0)], text)


def _tex_cell(cell: Cell, column: Column, reference_word: str) -> str:
    if isinstance(cell, Estimate):
        text = tex(f"{format_number(cell.value, column.decimals)} {cell.mark}".rstrip())
        notes = [tex(format_interval(cell, column.decimals, signed=column.signed))]
        if cell.count is not None:
            notes.append(f"$n={cell.count}$")
        if cell.reference is not None:
            notes.append(tex(f"{reference_word} {format_number(cell.reference, column.decimals)}"))
        beside = "; ".join(note for note in notes if note)
        return text + (f" {{\\footnotesize [{beside}]}}" if beside else "")
    return tex(format_cell(cell, column))


def to_latex(table: Table) -> str:
    """A ``table`` environment with rules of the LaTeX package booktabs."""
    align = "".join("r" if table.is_numeric(column) else "p{5cm}" if column.wide else "l" for column in table.columns)
    heading = " & ".join(tex(column.heading) for column in table.columns) + r" \\"
    lines = [r"\begin{table}", r"\centering", rf"\caption{{{tex(table.caption)}}}", rf"\label{{tab:{table.name}}}"]
    lines += [rf"\begin{{tabular}}{{{align}}}", r"\toprule", heading, r"\midrule"]
    for row in table.rows:
        cells = (_tex_cell(row.get(column.name), column, table.reference_word) for column in table.columns)
        lines.append(" & ".join(cells) + r" \\")
    lines += [r"\bottomrule", r"\end{tabular}"]
    lines += [rf"\par\smallskip\footnotesize {tex(note)}" for note in table.footnotes]
    lines.append(r"\end{table}")
    return "\n".join(lines) + "\n"


def to_html(table: Table, folded: bool = False, files: bool = True) -> str:
    """A ``<figure>`` with a sortable table, for the page; every text is escaped by the template engine.

    Args:
        table: what it shows.
        folded: the rows open by a click on their number.
        files: name the files that `save` writes.
    """
    from pipeline.report.templates import environment

    def sort_key(cell: Cell) -> str | None:  # of a number; text is its own key
        value = cell.value if isinstance(cell, Estimate) else cell
        if isinstance(value, (int, float)):
            return f"{value:.10g}" if math.isfinite(value) else ""
        return None

    return environment().get_template("table.html.j2").render(
        table=table, numeric={column.name: table.is_numeric(column) for column in table.columns}, sort_key=sort_key,
        is_estimate=lambda cell: isinstance(cell, Estimate), number=format_number, interval=format_interval,
        line=format_cell, folded=folded, files=files,
    )  # fmt: skip


def save(table: Table, folder: str | Path) -> list[Path]:
    """Write ``<name>.csv``, ``<name>.md`` and ``<name>.tex`` into a folder."""
    written = []
    for suffix, render in (("csv", to_csv), ("md", to_markdown), ("tex", to_latex)):
        path = Path(folder) / f"{table.name}.{suffix}"
        write_text(path, render(table))
        written.append(path)
    return written
