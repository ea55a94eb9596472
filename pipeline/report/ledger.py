"""The ledger: every published number beside ours, with a tolerance, a verdict and, where they part, a cause.

A row is never left out. A number we have not produced is *not run* and says what would run it; a number that
cannot be compared (other hardware, other pictures) is *not comparable* and says why. The score counts rows
within tolerance among those compared.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from pipeline.report.tables import Cell, Column, Table, format_number

MATCH, CLOSE, DIFFERS, NOT_COMPARABLE, NOT_RUN = "match", "close", "differs", "not comparable", "not run"
VERDICTS = (MATCH, CLOSE, DIFFERS, NOT_COMPARABLE, NOT_RUN)
CLOSE_WITHIN = 2.0  # "close" is within this many tolerances


@dataclass(frozen=True)
class Tolerance:
    """How far ours may lie from the published value: the larger of an absolute and a relative bound.

    Attributes:
        absolute: in the row's unit, at least 0.
        relative: fraction of the published value's magnitude, at least 0.
    """

    absolute: float = 0.0
    relative: float = 0.0

    def around(self, published: float) -> float:
        """The bound for one published value, in its unit."""
        return max(self.absolute, self.relative * abs(published))


@dataclass(frozen=True)
class LedgerRow:
    """One published number.

    Attributes:
        item: name of the published table or figure it belongs to.
        quantity: which of its numbers, in words.
        unit: of the number.
        paper: the published value.
        ours: ours; NaN where there is none.
        tolerance: bound on the difference, in the unit.
        why: cause of a difference, of an impossible comparison, or of an absence.
        comparable: False where the two must not be set against each other.
        line: the command that would produce ours.
    """

    item: str
    quantity: str
    unit: str
    paper: float
    ours: float = math.nan
    tolerance: float = 0.0
    why: str = ""
    comparable: bool = True
    line: str = ""

    @property
    def difference(self) -> float:
        """Ours minus the paper's; NaN without ours."""
        return self.ours - self.paper

    @property
    def verdict(self) -> str:
        """One of `VERDICTS`."""
        if not math.isfinite(self.ours):
            return NOT_RUN
        if not self.comparable:
            return NOT_COMPARABLE
        # Published values are decimal fractions: a difference equal to the bound must not fail by rounding.
        bound = self.tolerance * (1 + 1e-9) + 1e-12 * abs(self.paper)
        if abs(self.difference) <= bound:
            return MATCH
        return CLOSE if abs(self.difference) <= CLOSE_WITHIN * bound else DIFFERS


@dataclass(frozen=True)
class Score:
    """How many rows have each verdict.

    Attributes:
        counts: verdict -> rows, in the order of `VERDICTS`.
    """

    counts: dict[str, int]

    @property
    def total(self) -> int:
        return sum(self.counts.values())

    @property
    def compared(self) -> int:
        """Rows where ours and the paper's number can be set against each other."""
        return self.counts[MATCH] + self.counts[CLOSE] + self.counts[DIFFERS]

    @property
    def metrics(self) -> dict[str, int]:
        """The counts under names that suit a metrics file."""
        found = {verdict.replace(" ", "_"): count for verdict, count in self.counts.items()}
        return {**found, "total": self.total, "compared": self.compared}

    @property
    def sentence(self) -> str:
        """The top line of the report."""
        if not self.compared:
            return f"None of {self.total:,} published numbers has been compared yet."
        return (
            f"{self.counts[MATCH]:,} of {self.compared:,} numbers compared lie within tolerance"
            f" ({self.counts[CLOSE]:,} close, {self.counts[DIFFERS]:,} differ)."
        )

    @property
    def rest(self) -> str:
        """What the top line leaves out."""
        return (
            f"{self.total:,} published numbers in all: {self.counts[NOT_RUN]:,} not run, "
            f"{self.counts[NOT_COMPARABLE]:,} not comparable."
        )


def score(rows: Iterable[LedgerRow]) -> Score:
    """Count the verdicts of rows."""
    found = Counter(row.verdict for row in rows)
    return Score({verdict: found[verdict] for verdict in VERDICTS})


def to_table(rows: Sequence[LedgerRow], name: str = "ledger", caption: str = "") -> Table:
    """The ledger's rows as a table: paper, ours, difference, tolerance, verdict, cause.

    Args:
        rows: in the order shown.
        name: of the table; ``item`` is a column of its own only where rows have several.
        caption: of the table.
    """
    items = {row.item for row in rows}
    columns = [
        Column("quantity", "Quantity", wide=True),
        *([Column("unit", "Unit")] if any(row.unit for row in rows) else []),
        Column("paper", "Paper"),
        Column("ours", "Ours"),
        Column("difference", "Difference"),
        Column("tolerance", "Tolerance"),
        Column("verdict", "Verdict"),
        Column("why", "Why", wide=True),
    ]
    if len(items) > 1:
        columns.insert(0, Column("item", "Item"))
    lines: list[dict[str, Cell]] = []
    for row in rows:
        line: dict[str, Cell] = {
            "item": row.item,
            "quantity": row.quantity,
            "unit": row.unit,
            "paper": row.paper,
            "ours": row.ours,
            "difference": _rounded(row.difference),
            "tolerance": row.tolerance,
            "verdict": row.verdict,
            "why": row.why,
        }
        lines.append({column.name: line[column.name] for column in columns})
    notes = (
        f"match: within the tolerance; close: within {format_number(CLOSE_WITHIN)} tolerances; differs: beyond. "
        "Difference is ours minus the paper's.",
    )
    return Table(name, caption or "Published numbers beside ours.", columns, lines, notes)


def _rounded(value: float) -> float:
    """Three significant digits: more would be digits of the subtraction, not of the numbers."""
    return float(f"{value:.3g}") if math.isfinite(value) else value


def summary_table(rows: Sequence[LedgerRow], titles: dict[str, str]) -> Table:
    """How many rows of each item have each verdict.

    Args:
        rows: of all items.
        titles: item -> what the paper calls it, in the order shown.
    """
    columns = [Column("item", "Published item"), Column("numbers", "Numbers")]
    columns += [Column(verdict, verdict.capitalize()) for verdict in VERDICTS]
    lines: list[dict[str, Cell]] = []
    for item, title in titles.items():
        counts = score(row for row in rows if row.item == item)
        lines.append({"item": title, "numbers": counts.total, **counts.counts})
    return Table("ledger_summary", "The ledger at a glance: numbers per published item and verdict.", columns, lines)
