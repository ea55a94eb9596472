"""The ledger: every published number beside ours, both sides' uncertainty, a verdict and, where they differ, a cause.

A row is never left out. A number that has not been produced is *not run* and names the command that would produce it; a
number that cannot be compared (other hardware, other pictures) is *not comparable*, with the reason. Rows are evidence
of four kinds; the headline counts experiments only: what the paper measured and we measured again.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field

from pipeline.report.descriptions import Descriptions
from pipeline.report.display_names import word
from pipeline.report.tables import Table, format_number

MATCH, CLOSE, BETTER, DIFFERS = "match", "close", "better", "differs"
NOT_COMPARABLE, NOT_RUN = "not comparable", "not run"
COMPARED = (MATCH, CLOSE, BETTER, DIFFERS)
VERDICTS = (*COMPARED, NOT_COMPARABLE, NOT_RUN)
EXPERIMENT, CONSISTENCY, DEFINITION, REFERENCE = "experiment", "consistency", "definition", "reference"
KINDS = {
    EXPERIMENT: "measured by the paper and by us",
    CONSISTENCY: "the paper's own numbers, evaluated again",
    DEFINITION: "constants, closed forms and configured sizes",
    REFERENCE: "the authors' program, run by us",
}
RENDERED = {"sim", "sim_authors"}  # datasets whose frames no camera took
ALL_ITEMS = "All items"
PAGE = Descriptions("ledger")
CLOSE_WITHIN = 2.0  # "close" is within this many tolerances
FAR_FRACTION = 0.25  # of the published value: a match further away is owed to a wide interval


@dataclass(frozen=True)
class Tolerance:
    """How far ours may lie from the published value where ours has no interval: the largest of the bounds.

    They are in the row's unit, as a fraction of the published value's magnitude, and as a number of the standard
    deviations that the paper prints beside the value.
    """

    absolute: float = 0.0
    relative: float = 0.0
    std_devs: float = 0.0

    def around(self, published: float, std_dev: float = math.nan) -> float:
        """The bound for one published value and its printed standard deviation, in its unit."""
        bounds = (self.absolute, self.relative * abs(published), self.std_devs * std_dev)
        return max(bound for bound in bounds if math.isfinite(bound))


def tolerance_of_both(paper: float, paper_error: float, ours: float, low: float, high: float) -> float:
    """Tolerance from both sides' uncertainty: a difference within it means that the two intervals overlap.

    Our 95 % interval's reach towards the published value, plus the published value's error: half a unit of its last
    digit, and half its 95 % interval where one is known.
    """
    return max(high - ours if paper > ours else ours - low, 0.0) + paper_error


@dataclass(frozen=True)
class LedgerRow:
    """One number of the ledger: of which published item, which quantity in words, the published value and ours.

    Attributes:
        ours: NaN where there is none.
        tolerance: bound on the difference, in the unit.
        why: cause of a difference, of an impossible comparison, or of an absence.
        line: the command that would produce ours.
        kind: one of `KINDS`.
        dataset: on which ours was measured; empty where there is none.
        low, high: our 95 % interval; NaN where ours has none.
        better: ``"lower"`` or ``"higher"`` where that side is the better one and intervals can show it, else empty.
        printed: whether the paper prints the number.
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
    kind: str = EXPERIMENT
    dataset: str = ""
    low: float = math.nan
    high: float = math.nan
    better: str = ""
    printed: bool = True

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
        if self.better and (self.difference < 0) == (self.better == "lower"):
            return BETTER
        return CLOSE if abs(self.difference) <= CLOSE_WITHIN * bound else DIFFERS

    @property
    def far_match(self) -> bool:
        """Whether ours agrees with the published value by the width of an interval only."""
        return self.verdict == MATCH and abs(self.difference) > FAR_FRACTION * abs(self.paper)


@dataclass(frozen=True)
class Score:
    """How many rows have each verdict, over all and by kind; rows whose number the paper prints.

    ``far_matches`` are experiments that agree although ours is more than a quarter of the published value away.
    """

    counts: Mapping[str, int]
    kinds: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    printed: int = 0
    far_matches: int = 0

    @property
    def total(self) -> int:
        return sum(self.counts.values())

    @property
    def compared(self) -> int:
        """Rows where ours and the paper's number can be compared."""
        return _compared(self.counts)

    @property
    def experiments(self) -> Mapping[str, int]:
        """Counts of the experiments, which the headline is about."""
        return self.kinds.get(EXPERIMENT, dict.fromkeys(VERDICTS, 0))

    @property
    def metrics(self) -> dict[str, int]:
        """The counts under names that suit a metrics file."""
        groups = {"": self.counts} | {f"{kind}_": counts for kind, counts in self.kinds.items()}
        named = {of + name.replace(" ", "_"): n for of, counts in groups.items() for name, n in counts.items()}
        return {**named, "total": self.total, "compared": self.compared, "printed": self.printed}

    @property
    def sentence(self) -> str:
        """The headline: experiments only."""
        counts = self.experiments
        if not _compared(counts):
            return f"None of {sum(counts.values()):,} published measurements has been compared yet."
        numbers = {verdict: f"{counts[verdict]:,}" for verdict in COMPARED}
        headline = PAGE.text("headline", compared=f"{_compared(counts):,}", **numbers)
        far = {"far": f"{self.far_matches:,}", "percent": 100 * FAR_FRACTION}
        return f"{headline} {PAGE.text('far_matches', **far)}" if self.far_matches else headline

    @property
    def rest(self) -> str:
        """What the headline leaves out: measurements not compared, and rows of the other kinds."""
        counts = self.experiments
        others = [
            f"{group[MATCH]:,} of {_compared(group):,} of kind {kind} ({KINDS[kind]})"
            for kind, group in self.kinds.items()
            if kind != EXPERIMENT and _compared(group)
        ]
        rest = PAGE.text(
            "rest", total=f"{self.total:,}", printed=f"{self.printed:,}", not_run=f"{counts[NOT_RUN]:,}",
            not_comparable=f"{counts[NOT_COMPARABLE]:,}",
        )  # fmt: skip
        return rest + (f" Not counted as evidence, but in agreement: {', '.join(others)}." if others else "")


def _compared(counts: Mapping[str, int]) -> int:
    return sum(counts.get(verdict, 0) for verdict in COMPARED)


def score(rows: Iterable[LedgerRow]) -> Score:
    """Count the verdicts of rows, over all and by kind."""
    rows = list(rows)
    pairs = Counter((row.kind, row.verdict) for row in rows)
    present = {kind for kind, _ in pairs}
    kinds = {kind: {verdict: pairs[kind, verdict] for verdict in VERDICTS} for kind in KINDS if kind in present}
    counts = {verdict: sum(group[verdict] for group in kinds.values()) for verdict in VERDICTS}
    far_matches = sum(row.far_match and row.kind == EXPERIMENT for row in rows)
    return Score(counts, kinds, sum(row.printed for row in rows), far_matches)


def to_table(rows: Sequence[LedgerRow], name: str = "ledger", caption: str = "") -> Table:
    """The ledger's rows as a table: paper, ours with its interval, difference, tolerance, verdict, cause, dataset.

    Columns ``item`` and ``kind`` are shown only where rows have several.
    """
    lines = [
        {**asdict(row), "difference": _rounded(row.difference), "tolerance": _rounded(row.tolerance),
         "verdict": row.verdict, "dataset": word(row.dataset) if row.dataset else ""}
        for row in rows
    ]  # fmt: skip
    without = [name for name in ("item", "kind") if len({line[name] for line in lines}) < 2]
    without += [] if any(row.unit for row in rows) else ["unit"]
    without += [] if any(math.isfinite(row.low) for row in rows) else ["low", "high"]
    title, close = caption or PAGE.text("caption"), format_number(CLOSE_WITHIN)
    return PAGE.table("ledger", lines, without=without, name=name, title=title, close_within=close)


def _rounded(value: float) -> float:
    """Three significant digits: more would be digits of the subtraction, not of the numbers."""
    return float(f"{value:.3g}") if math.isfinite(value) else value


def _frames(rows: Sequence[LedgerRow], no_real_frames: Mapping[str, str]) -> str:
    """Datasets of real frames that measured numbers of one item are of, or why there are none."""
    if rows[0].kind not in (EXPERIMENT, REFERENCE):
        return ""
    names = {row.dataset for row in rows if row.dataset and math.isfinite(row.ours)} - RENDERED
    return ", ".join(sorted(map(word, names))) or no_real_frames.get(rows[0].item, "")


def summary_table(rows: Sequence[LedgerRow], titles: Mapping[str, str], no_real_frames: Mapping[str, str]) -> Table:
    """How many rows of each item, and of each kind of evidence, have each verdict.

    ``titles``: item -> the paper's name of it, in the order shown; ``no_real_frames``: item -> why ours are of no real
    frames.
    """
    groups = [
        (title, kind, [row for row in rows if row.item == item and row.kind == kind])
        for item, title in titles.items()
        for kind in KINDS
    ]
    groups += [(ALL_ITEMS, kind, [row for row in rows if row.kind == kind]) for kind in KINDS]
    lines = [
        {"item": title, "kind": kind, "numbers": len(group), **score(group).counts,
         "frames": "" if title == ALL_ITEMS else _frames(group, no_real_frames)}
        for title, kind, group in groups if group
    ]  # fmt: skip
    verdicts = {verdict: verdict.capitalize() for verdict in VERDICTS}
    notes = [f"{kind}: {is_of}." for kind, is_of in KINDS.items()]
    return PAGE.table("ledger_summary", lines, across=verdicts, notes=notes)
