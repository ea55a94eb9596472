"""One model of a table, which four writers render: CSV, Markdown, LaTeX and HTML.

A cell is a word, a number, or an `Estimate`: a number with its 95 % interval, its sample count and, where there
is one, the value the paper prints. `pipeline.report.table_formats` renders; nothing is rounded in the model.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from pipeline.errors import InputError, did_you_mean


@dataclass(frozen=True)
class Estimate:
    """A number as statistics knows it.

    Attributes:
        value: in the column's unit; NaN where nothing could be said.
        low, high: 95 % interval, NaN where the method has none.
        count: how many samples it rests on; None where that is not known.
        reference: the published value beside it; None where there is none.
    """

    value: float
    low: float = math.nan
    high: float = math.nan
    count: int | None = None
    reference: float | None = None

    @property
    def has_interval(self) -> bool:
        return math.isfinite(self.low) and math.isfinite(self.high)


Cell = str | int | float | bool | Estimate | None


@dataclass(frozen=True)
class Column:
    """One column.

    Attributes:
        name: key in the rows, and the heading in CSV.
        title: heading shown to readers; the name where empty.
        unit: shown in brackets after the title.
        decimals: digits after the point of numbers; None shows up to four significant digits.
        wide: the column holds sentences and may take several lines.
    """

    name: str
    title: str = ""
    unit: str = ""
    decimals: int | None = None
    wide: bool = False

    @property
    def heading(self) -> str:
        """Title with its unit."""
        title = self.title or self.name
        return f"{title} [{self.unit}]" if self.unit else title


@dataclass(frozen=True)
class Table:
    """A table ready to be rendered.

    Attributes:
        name: stem of its files; letters, digits, ``_`` and ``-``.
        caption: what the reader sees, in a sentence or two.
        columns: from left to right.
        rows: each maps column names to cells; a missing one is empty.
        footnotes: shown beneath.
        stage: the DVC stage whose output it shows.
        reference_word: what `Estimate.reference` is called, e.g. ``"paper"``.

    Raises:
        InputError: two columns share a name, or a row holds an unknown column.
    """

    name: str
    caption: str
    columns: Sequence[Column]
    rows: Sequence[Mapping[str, Cell]]
    footnotes: Sequence[str] = field(default=())
    stage: str = ""
    reference_word: str = "paper"

    def __post_init__(self) -> None:
        names = [column.name for column in self.columns]
        if len(set(names)) != len(names):
            raise InputError(f"table '{self.name}': two columns share a name in {names}; give each its own")
        for row in self.rows:
            for key in row:
                if key not in names:
                    raise InputError(
                        f"table '{self.name}': unknown column '{key}' in a row; {did_you_mean(key, names)}"
                    )

    def is_numeric(self, column: Column) -> bool:
        """Whether every filled cell of a column is a number or an estimate."""
        cells = [row.get(column.name) for row in self.rows]
        filled = [cell for cell in cells if cell is not None]
        return bool(filled) and all(isinstance(cell, (int, float, Estimate)) for cell in filled)

    def has_estimates(self, column: Column) -> bool:
        """Whether any cell of a column is an estimate."""
        return any(isinstance(row.get(column.name), Estimate) for row in self.rows)


def format_number(value: float | None, decimals: int | None = None) -> str:
    """A number for readers: fixed decimals, or up to four significant digits; an en dash where there is none.

    Whole numbers get thin-space-free thousands only from 10,000 on; a negative zero loses its sign.
    """
    if value is None or not math.isfinite(value):
        return "–"
    if decimals is not None:
        text = f"{value:.{decimals}f}"
    elif float(value).is_integer() and abs(value) < 1e15:
        text = f"{int(value):,}" if abs(value) >= 10_000 else f"{int(value)}"
    elif abs(value) >= 1000:
        text = f"{value:,.0f}"
    else:
        text = f"{value:.4g}"
    if text.startswith("-") and not any(digit in text for digit in "123456789"):
        text = text[1:]
    return text.replace("-", "−", 1) if text.startswith("-") else text


def format_interval(cell: Estimate, decimals: int | None = None) -> str:
    """``"5.10 to 5.40"``; empty where the estimate has no interval."""
    if not cell.has_interval:
        return ""
    return f"{format_number(cell.low, decimals)} to {format_number(cell.high, decimals)}"


def format_cell(cell: Cell, column: Column, reference_word: str = "paper") -> str:
    """A cell on one line: ``"5.25 [5.10 to 5.40; n 72; paper 5.2]"``."""
    if cell is None:
        return ""
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    if isinstance(cell, str):
        return cell
    if isinstance(cell, Estimate):
        notes = [format_interval(cell, column.decimals)]
        if cell.count is not None:
            notes.append(f"n {cell.count:,}")
        if cell.reference is not None:
            notes.append(f"{reference_word} {format_number(cell.reference, column.decimals)}")
        beside = "; ".join(note for note in notes if note)
        return format_number(cell.value, column.decimals) + (f" [{beside}]" if beside else "")
    return format_number(cell, column.decimals)
