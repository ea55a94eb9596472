"""The model of a table: columns, and rows of cells; and the making of its rows from data frames.

A cell is text, a number, or an `Estimate`: a number with its 95 % interval, its sample count and, where there is one,
the value the paper prints. `estimate` makes one of a row of a data frame, `pivot` spreads the values of one column over
several columns of the table; `pipeline.report.descriptions` makes tables as a section's YAML file describes them,
`pipeline.report.table_formats` renders. Nothing is rounded here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from pipeline.errors import InputError, did_you_mean
from pipeline.grouped_statistics import weighted_mean
from pipeline.report.display_names import in_order


@dataclass(frozen=True)
class Estimate:
    """A number in the column's unit, its 95 % interval, its sample count, and the published value beside it.

    NaN stands for no result and for no interval, None for an unknown count and for nothing published. ``mark`` is a
    sign behind the number, which a footnote explains.
    """

    value: float
    low: float = math.nan
    high: float = math.nan
    count: int | None = None
    reference: float | None = None
    mark: str = ""

    @property
    def has_interval(self) -> bool:
        return math.isfinite(self.low) and math.isfinite(self.high)


NEARLY_0 = 1e-9
"""Rounding of sums: smaller numbers are 0."""

Cell = str | int | float | bool | Estimate | None
Row = Mapping[str, Any]


@dataclass(frozen=True)
class Column:
    """One column.

    Attributes:
        name: key in the rows, and the heading in CSV.
        title: heading shown to readers; the name where empty.
        unit: shown in brackets after the title.
        decimals: digits after the point of numbers; None shows up to four significant digits.
        wide: the column holds sentences and may take several lines.
        signed: the sign of an interval's end decides, so that it shows where an end rounds to 0 (`format_end`).
    """

    name: str
    title: str = ""
    unit: str = ""
    decimals: int | None = None
    wide: bool = False
    signed: bool = False

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
        stage: the DVC stage whose output it shows, or the command of the benchmark whose record it shows.
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
        for key in {key: None for row in self.rows for key in row}:
            if key not in names:
                raise InputError(f"table '{self.name}': unknown column '{key}' in a row; {did_you_mean(key, names)}")

    def is_numeric(self, column: Column) -> bool:
        """Whether every filled cell of a column is a number or an estimate."""
        cells = [row.get(column.name) for row in self.rows]
        filled = [cell for cell in cells if cell is not None]
        return bool(filled) and all(isinstance(cell, (int, float, Estimate)) for cell in filled)

    def has_estimates(self, column: Column) -> bool:
        """Whether any cell of a column is an estimate."""
        return any(isinstance(row.get(column.name), Estimate) for row in self.rows)


def records(frame: pd.DataFrame | Iterable[Row]) -> list[dict[str, Any]]:
    """The rows of a data frame, or of any iterable of mappings, as dictionaries with text keys."""
    rows = frame if not hasattr(frame, "to_dict") else frame.to_dict("records")
    return [{str(name): cell for name, cell in row.items()} for row in rows]


def estimate(value: str, low: str, high: str, count: str = "", reference: str = "") -> Callable[[Row], Cell]:
    """A function from a row to an `Estimate`; None for a row without the value's column.

    Args:
        value: column of the number.
        low: column of the lower end of its interval; an absent one gives no interval.
        high: column of the upper end.
        count: column of the sample count; none where empty.
        reference: column of the published value; an absent one gives none.
    """

    def cell(row: Row) -> Cell:
        if value not in row:
            return None
        number, beside = (
            known if known is not None and math.isfinite(known) else None
            for known in (row[count] if count else None, row.get(reference))
        )
        ends = row.get(low, math.nan), row.get(high, math.nan)
        return Estimate(row[value], *ends, None if number is None else int(number), beside)

    return cell


amae = estimate("amae_percent", "low_percent", "high_percent", "count", "paper_percent")
"""AMAE in percent with its bootstrap interval, patches with an estimate, and the paper's value (`paper_percent`)."""


def pivot(
    frame: pd.DataFrame, index: Sequence[str], across: str, cell: Callable[[Row], Cell], key: Callable[[Any], str] = str
) -> list[dict[str, Any]]:
    """Rows of a wide table: one per combination of the index columns of a long one, in order of appearance.

    Args:
        frame: long table.
        index: columns that identify a row; they are columns of the wide table, too.
        across: column whose values become columns, named by ``key``.
        cell: makes the cell from a row of the frame.
        key: name of the column of one value.
    """
    wide: dict[str, dict[str, Any]] = {}
    for row in records(frame):
        head = {name: row[name] for name in index}
        wide.setdefault(repr(head), head)[key(row[across])] = cell(row)
    return list(wide.values())


def where(frame: pd.DataFrame, /, **values: Any) -> pd.DataFrame:
    """Rows of a data frame whose columns have these values, or one of a list of them."""
    for name, value in values.items():
        frame = frame[frame[name].isin(value if isinstance(value, list) else [value])]
    return frame


def ordered(frame: pd.DataFrame, **orders: Iterable[Any]) -> pd.DataFrame:
    """A data frame sorted by several columns, each in an order of its own (`display_names.in_order`)."""
    ranks = {}
    for number, (name, order) in enumerate(orders.items()):
        values = in_order(frame[name], order)
        ranks[f"__{number}"] = frame[name].map({value: rank for rank, value in enumerate(values)})
    return frame.assign(**ranks).sort_values(list(ranks), kind="stable").drop(columns=list(ranks))


def totals(cells: pd.DataFrame, by: Sequence[str], *means: str) -> pd.DataFrame:
    """Sums of the counts of patches of each group of cells, and means of columns weighted by ``count``."""
    groups = cells.groupby(list(by), sort=False)
    sums = groups[[name for name in ("count", "abstained", "rejected") if name in cells]].sum()
    averages = {name: [weighted_mean(group, name) for _, group in groups] for name in means}
    return sums.assign(**averages).reset_index()


def reasons_of(estimates: pd.DataFrame) -> Callable[[Row], str]:
    """A function from a row (dataset, estimator) to the reasons of its abstentions with their counts, in words.

    ``estimates`` has dataset, estimator, abstained and reason, a row for each patch.
    """
    groups = estimates[estimates["abstained"]].groupby(["dataset", "estimator"])["reason"]
    counts = {key: reasons.value_counts().sort_index() for key, reasons in groups}

    def words(row: Row) -> str:
        known = counts.get((row["dataset"], row["estimator"]))
        return "" if known is None else ", ".join(f"{reason}: {count:,}" for reason, count in known.items())

    return words


def mean_cell(cells: Sequence[Cell], *, complete: bool = True) -> Cell:
    """The mean of cells, beside the mean of the paper's values where every averaged cell has one.

    None where a cell is no finite number, unless `complete` is off: then it is the mean of those that are.
    """
    estimates = [cell if isinstance(cell, Estimate) else Estimate(_number(cell)) for cell in cells]
    finite = [cell for cell in estimates if math.isfinite(cell.value)]
    if not cells or (complete and len(finite) < len(cells)):
        return None
    value = float(np.mean([cell.value for cell in finite])) if finite else math.nan
    if not any(isinstance(cell, Estimate) for cell in cells):
        return value
    paper = [cell.reference for cell in finite or estimates]
    known = [number for number in paper if number is not None]
    return Estimate(value, reference=float(np.mean(known)) if known and len(known) == len(paper) else None)


def _number(cell: Cell) -> float:
    return float(cell) if isinstance(cell, (int, float)) else math.nan


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


def format_end(value: float, decimals: int | None = None) -> str:
    """An end of an interval whose sign decides: as `format_number`, but an end that rounds to 0 with its first digit.

    0 itself, up to rounding, stays 0.
    """
    rounds_to_0 = decimals is not None and NEARLY_0 < abs(value) < 0.5 * 10.0**-decimals
    return format_number(value, math.ceil(-math.log10(abs(value))) if rounds_to_0 else decimals)


def format_interval(cell: Estimate, decimals: int | None = None, *, signed: bool = False) -> str:
    """``"5.10 to 5.40"``; empty where the estimate has no interval. ``signed``: see `format_end`."""
    if not cell.has_interval:
        return ""
    end = format_end if signed else format_number
    return f"{end(cell.low, decimals)} to {end(cell.high, decimals)}"


def format_cell(cell: Cell, column: Column, reference_word: str = "paper") -> str:
    """A cell on one line: ``"5.25 ↑ [5.10 to 5.40; n 72; paper 5.2]"``."""
    if cell is None:
        return ""
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    if isinstance(cell, str):
        return cell
    if isinstance(cell, Estimate):
        notes = [format_interval(cell, column.decimals, signed=column.signed)]
        if cell.count is not None:
            notes.append(f"n {cell.count:,}")
        if cell.reference is not None:
            notes.append(f"{reference_word} {format_number(cell.reference, column.decimals)}")
        beside = "; ".join(note for note in notes if note)
        marked = f" {cell.mark}" if cell.mark else ""
        return format_number(cell.value, column.decimals) + marked + (f" [{beside}]" if beside else "")
    return format_number(cell, column.decimals)
