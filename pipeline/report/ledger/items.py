"""The published tables and figures that the ledger follows, in the paper's order, and their merge with our results.

An item is data (``ledger.yaml``): kind of evidence, a file of published numbers, the columns that identify its rows,
the columns of numbers with their units, the stage and the table that give ours, a tolerance, and the reasons why rows
cannot be compared or differ.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from importlib import resources
from typing import Any

import numpy as np
import pandas as pd
from pydantic import TypeAdapter

from pipeline.errors import InputError
from pipeline.report.display_names import PAPER_NAMES, word
from pipeline.report.inputs import PUBLISHED_COLUMNS, ReportInputs, published_table
from pipeline.report.ledger import causes as ledger_causes
from pipeline.report.ledger import sources as ledger_sources
from pipeline.report.ledger.rows import (
    BETTER,
    CLOSE,
    DIFFERS,
    EXPERIMENT,
    NOT_RUN,
    LedgerRow,
    Tolerance,
    to_table,
    tolerance_of_both,
)
from pipeline.report.spec import STAGE_ABSENT, Block, Run
from pipeline.report.tables import Row, records, where
from pipeline.report.yaml_files import content

UNEXPLAINED = "not explained yet"
UNITS = {
    "target_sigma_dn": "DN",
    "sigma_dn": "DN",
    "kernel_size_px": "px",
    "angle_deg": "°",
    "time_ms": "ms",
    "exposure_ms": "ms",
}
SYMBOLS = {"sigma_dn": "σ", "target_sigma_dn": "σ", "frequency": "f", "iso": "ISO", "d1_px": "d₁", "d2_px": "d₂"}
PICTURES_ONLY = (
    "The paper prints its noise curves, its object-detection (IOPC) curves and heat maps and its defocus with "
    "dark-current-noise table as pictures only: no numbers exist to compare."
)


Condition = Mapping[str, Any]
"""Column of a row -> the value, or list of values, that it must have."""


def _holds(condition: Condition, row: Row) -> bool:
    return all(
        row.get(column) in (values if isinstance(values, list) else [values]) for column, values in condition.items()
    )


def _matching(conditions: Mapping[str, Condition], row: Row, otherwise: str) -> str:
    """The first name whose condition a row meets."""
    return next((name for name, condition in conditions.items() if _holds(condition, row)), otherwise)


Reason = Mapping[str, Any]
"""``why`` rows cannot be compared, or differ, in words (``{profile}`` is filled in), and ``where``: of which rows.

A condition is on columns of the published file, ``measured_on``, ``column`` (of the number) or ``profile``.
"""


def _why(reasons: Sequence[Reason], row: Row) -> str:
    return next((str(one["why"]) for one in reasons if _holds(one.get("where", {}), row)), "")


@dataclass(frozen=True)
class Source:
    """Where our side of an item is: a function of `pipeline.report.ledger.sources`, or a file of a stage.

    ``on_udacity``: one of `pipeline.report.inputs.RESULTS`, of blur and noise at once.

    ``where``: of its rows that count; ``columns``: a column of it -> as the published file calls it.
    """

    table: str = ""
    file: str = ""
    on_udacity: str = ""
    where: Condition = field(default_factory=dict)
    columns: Mapping[str, str] = field(default_factory=dict)

    def read(self, inputs: ReportInputs) -> pd.DataFrame | None:
        """The table with the published file's names; None, or empty, where nothing has run."""
        if self.on_udacity:
            table = ledger_sources.on_udacity(inputs, self.on_udacity)
        else:
            table = getattr(ledger_sources, self.table)(inputs) if self.table else inputs.read(self.file)
        if table is None or table.empty:
            return None
        selected: pd.DataFrame = where(table, **self.where).rename(columns=self.columns)
        return selected.rename(columns=PUBLISHED_COLUMNS) if self.file else selected


@dataclass(frozen=True)
class Item:
    """One published table or figure.

    Attributes:
        name: of the item.
        title: the paper's name of it.
        keys: columns that identify rows, shown as the quantity.
        values: column of numbers -> unit.
        stage: the stage that makes ours; ``{dataset}`` and other keys are filled in.
        file: in the folder of published numbers; empty where `published` makes them.
        stages: another stage -> condition of the rows that it makes.
        tolerance: how far ours may lie from the published value where ours has no interval (`Tolerance`).
        ours: where our side is.
        published: function of `pipeline.report.ledger.sources` that makes the published side, where it is a rule.
        dataset: of all rows, where the file has no such column.
        better: ``"lower"`` or ``"higher"`` where one side is the better one; stated in the cause.
        whys: causes shown where ours differ; the first that applies counts.
        causes: function of `pipeline.report.ledger.causes` that gives a function of the row, in place of `whys`.
        barriers: which rows cannot be compared; the first that applies counts.
        kind: of evidence, one of `pipeline.report.ledger.KINDS`.
        kinds: another kind -> condition of its rows.
        intervals: column of a number -> columns of our 95 % interval of it.
        printed: whether the paper prints the numbers, or condition of the rows that it prints.
        no_real_frames: why ours are of no real frames, where they are not.
    """

    name: str
    title: str
    keys: Sequence[str]
    values: Mapping[str, str]
    stage: str
    file: str = ""
    stages: Mapping[str, Condition] = field(default_factory=dict)
    tolerance: Tolerance = field(default_factory=Tolerance)
    ours: Source = Source()
    published: str = ""
    dataset: str = ""
    better: str = ""
    whys: Sequence[Reason] = ()
    causes: str = ""
    barriers: Sequence[Reason] = ()
    kind: str = EXPERIMENT
    kinds: Mapping[str, Condition] = field(default_factory=dict)
    intervals: Mapping[str, Sequence[str]] = field(default_factory=dict)
    printed: bool | Condition = True
    no_real_frames: str = ""


ITEMS = TypeAdapter(tuple[Item, ...]).validate_python(content(resources.files(__package__), "ledger.yaml"))
TITLES = {item.name: item.title for item in ITEMS}
NO_REAL_FRAMES = {item.name: item.no_real_frames for item in ITEMS}
"""Item -> why ours are of no real frames."""


def _text(value: Any) -> str:
    """A key as text, so that 5, 5.0 and an integer column's 5 are the same."""
    return f"{value:g}" if isinstance(value, (int, float)) else str(value)


def _long(item: Item, table: pd.DataFrame, number: str) -> pd.DataFrame:
    """One row per number: the table's columns, ``key`` (text), ``column`` (of the number) and the number."""
    rows = [
        {**row, "key": "\t".join(_text(row[name]) for name in item.keys), "column": column, number: row[column]}
        for row in records(table)
        for column in item.values
        if column in row
    ]
    return pd.DataFrame(rows, columns=[*dict.fromkeys([*table.columns, "key", "column", number])])


def _ours(item: Item, inputs: ReportInputs) -> pd.DataFrame:
    """Ours by key and column of the number, with ``low``, ``high`` and ``measured_on``; empty where nothing has run.

    Which of a stage's run and a record counts is a rule of each source (`pipeline.report.ledger.sources`). Of what is
    left, results on the paper's frames (`PAPER_NAMES`) win over those on the Sim rendered here, and rows that are alike
    in all of these columns are one.
    """
    columns = ["key", "column", "ours", "low", "high", "measured_on"]
    table = item.ours.read(inputs)
    if table is None:
        return pd.DataFrame({name: [] for name in columns})
    absent = [name for name in item.keys if name not in table]
    if absent:
        expected = f"expected the keys {list(item.keys)}"
        raise InputError(f"results of '{item.name}': column '{absent[0]}' is missing; {expected}")
    if "measured_on" not in table:
        table = table.assign(measured_on=table.get("dataset", item.dataset))
    long = _long(item, table, "ours")
    for number, end in enumerate(("low", "high")):
        sources = {column: ends[number] for column, ends in item.intervals.items()}
        long[end] = [row.get(sources.get(row["column"], ""), math.nan) for row in records(long)]
    numbers = pd.MultiIndex.from_frame(long[["key", "column"]])
    on_papers = long["measured_on"].isin(list(PAPER_NAMES)).to_numpy()
    beaten = ~on_papers & numbers.isin(numbers[on_papers])
    return long.loc[~beaten, columns].drop_duplicates()


def _refuse_ambiguous(item: Item, ours: pd.DataFrame) -> None:
    """Refuse differing results for one published number: none of them is to be preferred.

    Raises:
        InputError: names the item, the first such number and its results.
    """
    repeated = ours[ours.duplicated(["key", "column"], keep=False)]
    if repeated.empty:
        return
    first = repeated.iloc[0]
    results = where(repeated, key=first["key"], column=first["column"])
    quantity = ", ".join(f"{name} {value}" for name, value in zip(item.keys, first["key"].split("\t"), strict=True))
    numbers = " and ".join(f"{result['ours']:g} ({result['measured_on']})" for result in records(results))
    raise InputError(
        f"results of '{item.name}': {first['column']} at {quantity} has {len(results)} differing results: {numbers}; "
        "expected one: keep one of the runs or records that they are from"
    )


def rows_of(item: Item, inputs: ReportInputs) -> list[LedgerRow]:
    """The ledger's rows of one item: one per published number, merged with ours.

    Raises:
        InputError: the published file is absent, or ours lacks a key or has differing results for a published number.
    """
    if item.published:
        table = getattr(ledger_sources, item.published)(inputs)
    else:
        table = published_table(inputs.paper / item.file)
    paper = _long(item, table.assign(dataset=item.dataset) if item.dataset else table, "paper")
    paper = paper[np.isfinite(paper["paper"].to_numpy(float))]
    if paper.empty:
        return []
    ours = _ours(item, inputs)
    _refuse_ambiguous(item, ours.merge(paper[["key", "column"]].drop_duplicates()))
    merged = paper.merge(ours, how="left", on=["key", "column"], suffixes=("_of_paper", ""))
    merged["decimals"] = merged.groupby("column")["paper"].transform(lambda column: max(map(_decimals, column)))
    causes = getattr(ledger_causes, item.causes)(inputs) if item.causes and len(ours) else None
    return [_row(item, row, len(ours) > 0, causes, inputs) for row in records(merged)]


def _decimals(value: float) -> int:
    """Digits after the point of a printed number; a column has the most of any of its numbers."""
    exponent = Decimal(f"{value:.10g}").as_tuple().exponent
    return max(0, -exponent) if isinstance(exponent, int) else 0


def _row(item: Item, row: Row, has_run: bool, causes: Callable[[Row], str] | None, inputs: ReportInputs) -> LedgerRow:
    paper, dataset = float(row["paper"]), str(row.get("dataset", "sim"))
    unit = item.values[row["column"]]
    if not unit and isinstance(row.get("unit"), str) and "unit" not in item.keys:
        unit = row["unit"]
    about = {**row, "profile": inputs.profile}
    barrier = _why(item.barriers, about).format(profile=inputs.profile)
    ours, low, high = (float(row[name]) for name in ("ours", "low", "high"))
    bound = item.tolerance.around(paper, row.get("std_dev", math.nan))
    tolerance = float(row["tolerance"]) if "tolerance" in row else bound
    has_interval = math.isfinite(low) and math.isfinite(high)
    if has_interval:
        known_error = row.get("paper_error", math.nan)
        error = 0.5 * 10.0 ** -int(row["decimals"]) + (known_error if math.isfinite(known_error) else 0.0)
        tolerance = tolerance_of_both(paper, error, ours, low, high)
    stage = _matching(item.stages, row, item.stage).format_map(
        {**{name: str(row[name]) for name in item.keys}, "dataset": dataset}
    )
    measured_on = row["measured_on"] if isinstance(row["measured_on"], str) and math.isfinite(ours) else ""
    result = LedgerRow(
        item.name, _quantity(item, row), unit, paper, ours, tolerance, why=barrier, comparable=not barrier,
        line=inputs.line(stage), kind=_matching(item.kinds, row, item.kind), dataset=measured_on, low=low, high=high,
        better=item.better if has_interval else "",
        printed=item.printed if isinstance(item.printed, bool) else _holds(item.printed, row),
    )  # fmt: skip
    if result.verdict == NOT_RUN:
        if dataset in inputs.absent and "dataset" in row:
            return replace(result, why="data absent", line=inputs.absent[dataset])
        return replace(result, why="not among our results" if has_run else "stage absent")
    if result.verdict in (BETTER, CLOSE, DIFFERS):
        known = causes(row) if causes is not None else _why(item.whys, row)
        parts = [row["why"] if isinstance(row.get("why"), str) else known]
        if result.verdict != BETTER and item.better and (result.ours < paper) == (item.better == "lower"):
            parts.insert(0, f"ours is {item.better}, which is better")
        return replace(result, why="; ".join(part for part in parts if part) or UNEXPLAINED)
    return result


def _quantity(item: Item, row: Row) -> str:
    """Which number of the item a row is, in words; the published file may give them itself as ``label``."""
    if isinstance(row.get("label"), str):
        return (f"{word(str(row['dataset']))}, " if "dataset" in row else "") + row["label"]
    words = []
    for key in item.keys:
        cell = row[key]
        if not isinstance(cell, (int, float)):
            words.append(word(str(cell)))
        elif math.isfinite(cell):
            words.append(" ".join(part for part in (SYMBOLS.get(key, ""), f"{cell:g}", UNITS.get(key, "")) if part))
    if len(item.values) > 1:
        words.append(word(str(row["column"]).rsplit("_percent", 1)[0]))
    return ", ".join(words)


def all_rows(inputs: ReportInputs) -> list[LedgerRow]:
    """The whole ledger, in the paper's order."""
    return [row for item in ITEMS for row in rows_of(item, inputs)]


def beside_ours(names: Sequence[str], inputs: ReportInputs) -> tuple[list[Block], list[Run]]:
    """Of each ledger item ours beside the paper's as a table, and its line of the overview."""
    items = {item.name: item for item in ITEMS}
    blocks: list[Block] = []
    runs: list[Run] = []
    for item in (items[name] for name in names):
        rows = rows_of(item, inputs)
        done, missing = ([row for row in rows if (row.verdict == NOT_RUN) == absent] for absent in (False, True))
        why, line = STAGE_ABSENT, inputs.line(item.stage.replace("{", "<").replace("}", ">"))
        if missing and missing[0].why:  # of all, the first stands for the item
            why, line = missing[0].why, missing[0].line or line
        if done:
            blocks.append(to_table(done, f"published_{item.name}", f"{item.title}: the paper's numbers beside ours."))
        partly = f"{len(done):,} of {len(rows):,} numbers" if done and missing else ""
        measured_on = {row.dataset for row in done if row.dataset}
        recorded = bool(measured_on) and measured_on <= set(inputs.absent)  # data that no stage had
        runs.append(Run(item.title, "", bool(done) and not recorded, partly or ("" if done else why), line, recorded))
    return blocks, runs
