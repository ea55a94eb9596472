"""The published tables and figures that the ledger follows, in the paper's order, and their merge with our results.

An item is data: its kind of evidence, a file of published numbers, the columns that identify its rows, the columns of
numbers with their units, the stage and the function that give ours, a tolerance, and the reason why some rows cannot
be compared. A new experiment enters the ledger by one more `Item`; ours may also be a table with the same key and value
columns, given as ``ReportInputs.results[item]``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from decimal import Decimal
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.errors import InputError
from pipeline.report import ledger_causes, ledger_sources
from pipeline.report.display_names import word
from pipeline.report.inputs import ReportInputs, existing, published_table
from pipeline.report.ledger import (
    BETTER,
    CLOSE,
    CONSISTENCY,
    DEFINITION,
    DIFFERS,
    EXPERIMENT,
    NOT_RUN,
    REFERENCE,
    LedgerRow,
    Tolerance,
    tolerance_of_both,
)
from pipeline.report.tables import Row, records

if TYPE_CHECKING:
    import pandas as pd

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


@dataclass(frozen=True)
class Barrier:
    """A reason why rows cannot be compared.

    Attributes:
        why: in words; ``{profile}`` is filled in.
        applies: whether it holds for a published row; to all rows by default.
    """

    why: str
    applies: Callable[[Row, ReportInputs], bool] = lambda row, inputs: True


@dataclass(frozen=True)
class Item:
    """One published table or figure.

    Attributes:
        name: of the item, and of its entry in ``ReportInputs.results``.
        title: the paper's name of it.
        file: in the folder of published numbers; empty where `published` makes them.
        keys: columns that identify rows, shown as the quantity.
        values: column of numbers -> unit.
        stage: the stage that makes ours, or a function of the row; ``{dataset}`` and other keys are filled in.
        tolerance: how far ours may lie from the published value where ours has no interval.
        ours: makes ours from the inputs, beside ``ReportInputs.results[name]``.
        published: makes the published side, where it is a rule rather than a file.
        dataset: of all rows, where the file has no such column.
        better: ``"lower"`` or ``"higher"`` where one side is the better one; stated in the cause.
        why: cause shown where ours differ, or a function of the inputs that gives a function of the row.
        barriers: which rows cannot be compared; the first that applies counts.
        kind: of evidence, one of `pipeline.report.ledger.KINDS`, or a function of the row.
        intervals: column of a number -> columns of our 95 % interval of it.
        printed: whether the paper prints the number of a row; all by default.
    """

    name: str
    title: str
    file: str
    keys: tuple[str, ...]
    values: Mapping[str, str]
    stage: str | Callable[[Row], str]
    tolerance: Tolerance = field(default_factory=Tolerance)
    ours: Callable[[ReportInputs], pd.DataFrame | None] | None = None
    published: Callable[[ReportInputs], pd.DataFrame] | None = None
    dataset: str = ""
    better: str = ""
    why: str | Callable[[ReportInputs], Callable[[Row], str]] = ""
    barriers: tuple[Barrier, ...] = ()
    kind: str | Callable[[Row], str] = EXPERIMENT
    intervals: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    printed: Callable[[Row], bool] = lambda row: True


def _of_authors(row: Row, inputs: ReportInputs) -> bool:
    return row["dataset"] == "sim" and not ledger_sources.is_of_authors("sim", row["estimator"], inputs)


def _rendered(row: Row, inputs: ReportInputs) -> bool:
    return row["dataset"] == "sim" and row["measured_on"] not in ledger_sources.PAPER_NAMES


RENDERED = "the reference was measured on the authors' Sim frames; ours are rendered here"
AMAE_INTERVAL = {"amae_percent": ("low_percent", "high_percent")}
ITEMS: tuple[Item, ...] = (
    Item(
        "image_formation", "Image formation: sensor constants and moments", "image_formation.csv", ("quantity",),
        {"value": ""}, "sensor", Tolerance(relative=0.02), ledger_sources.formation, kind=DEFINITION,
        printed=lambda row: row["source"] == "parameter table",
    ),
    Item(
        "noise_levels", "Image formation: largest miss of a noise level", "", ("dataset", "noise_source"),
        {"miss_percent": "%"}, "corrupt@{dataset}", Tolerance(absolute=2.0), ledger_sources.levels,
        ledger_sources.expected_levels, kind=DEFINITION, printed=lambda row: False,
    ),
    Item(
        "dataset_sizes", "Datasets: sizes", "dataset_sizes.csv", ("dataset", "quantity"), {"value": ""},
        "index@{dataset}", Tolerance(), ledger_sources.sizes, why="another frame size is configured",
        kind=DEFINITION,
        barriers=(
            Barrier(
                "a size that profile '{profile}' chooses, not a result",
                lambda row, inputs: str(row["quantity"]).startswith("frames_") and inputs.profile != "paper",
            ),
        ),
    ),
    Item(
        "noise_reference", "Fig. noise estimation: PCA and B+F by the authors' code", "noise_reference.csv",
        ("dataset", "noise_source", "target_sigma_dn", "estimator"), {"sigma_dn": "DN"}, "noise@{dataset}-{estimator}",
        Tolerance(absolute=1.0), ledger_sources.noise_medians, why="other frames than the reference's",
        barriers=(Barrier(RENDERED, _rendered),), kind=REFERENCE,
        printed=lambda row: False,
    ),
    Item(
        "uncorrupted_mtf", "Fig. uncorrupted datasets", "uncorrupted_mtf.csv",
        ("dataset", "estimator", "statistic", "frequency"), {"mtf": ""},
        lambda row: "star" if row["estimator"] == "ground_truth" else "blur@{dataset}-{estimator}",
        Tolerance(absolute=0.05), ledger_sources.uncorrupted, ledger_sources.published_uncorrupted,
        why=ledger_causes.uncorrupted, intervals={"mtf": ("low", "high")},
        kind=lambda row: DEFINITION if row["estimator"] == "ground_truth" else EXPERIMENT,
        barriers=(
            Barrier(RENDERED, lambda row, inputs: row["estimator"] != "ground_truth" and _of_authors(row, inputs)),
            Barrier(
                "an extreme widens with the number of patches, which is not the paper's",
                lambda row, inputs: row["statistic"] in ("min", "max"),
            ),
        ),
    ),
    Item(
        "runtime", "Table: run times", "runtime.csv", ("estimator", "unit"), {"seconds": "s"}, "runtime",
        Tolerance(), ledger_sources.run_times, better="lower",
        barriers=(Barrier("the published run times are of other hardware (Xeon W-2145, Quadro RTX 6000)"),),
    ),
    Item(
        "blur_amae", "Table I: AMAE of blur estimators", "blur_amae.csv", ("dataset", "estimator", "blur_kind",
        "kernel_size_px"),
        {"amae_percent": "%"}, "blur@{dataset}-{estimator}", Tolerance(absolute=2.0), ledger_sources.blur_amae,
        better="lower", why=ledger_causes.blur_amae, barriers=(Barrier(RENDERED, _of_authors),),
        intervals=AMAE_INTERVAL,
    ),
    Item(
        "photon_defocus_amae", "Fig. defocus in presence of photon noise", "photon_defocus_amae.csv",
        ("sigma_dn", "kernel_size_px"), {"amae_percent": "%"}, "combined@{dataset}", Tolerance(absolute=2.0),
        ledger_sources.photon_defocus, dataset=ledger_sources.COMBINED_DATASET, better="lower",
        why=ledger_causes.combined, intervals=AMAE_INTERVAL,
    ),
    Item(
        "photon_linear_motion_mtf", "Fig. linear motion in presence of photon noise", "photon_linear_motion_mtf.csv",
        ("series", "sigma_dn", "frequency"), {"mtf": ""}, "combined@{dataset}", Tolerance(absolute=0.05),
        ledger_sources.photon_linear, dataset=ledger_sources.COMBINED_DATASET,
        why=ledger_causes.combined,
    ),
    Item(
        "improved_blur", "Supplement: improved blur estimation", "improved_blur.csv", ("d2_px", "d1_px", "sigma_dn"),
        {"mae_h_percent": "%", "mae_v_percent": "%", "amae_percent": "%", "expected_amae_percent": "%"},
        "denoised_blur@{dataset}", Tolerance(absolute=2.0), ledger_sources.improved,
        dataset=ledger_sources.COMBINED_DATASET, better="lower", intervals=AMAE_INTERVAL,
        why=ledger_causes.combined,
    ),
    Item(
        "yolov7_direction_ap", "Supplement: AP by blur direction", "yolov7_direction_ap.csv",
        ("sigma_dn", "angle_deg", "kernel_size_px"), {"ap_percent": "%"}, "direction", Tolerance(absolute=2.0),
        ledger_sources.direction_ap, better="higher",
        barriers=(Barrier("another detector on other frames than the paper's YOLOv7 on Udacity"),),
        intervals={"ap_percent": ("low_percent", "high_percent")},
    ),
    Item(
        "regression_coefficients", "Supplement: fit of AP over ISO and exposure", "regression_coefficients.csv",
        ("detector", "object", "parameter"), {"value": "", "std_dev": ""}, "refit", Tolerance(relative=0.02),
        published=ledger_sources.published_coefficients, kind=CONSISTENCY,
        barriers=(
            Barrier(
                "ours is of the printed grid, which is the paper's fit itself; its data are not published",
                lambda row, inputs: row["parameter"] in ("chi2", "r2"),
            ),
        ),
    ),
    Item(
        "fitted_ap_grid", "Supplement: fitted AP over ISO and exposure", "fitted_ap_grid.csv",
        ("detector", "object", "iso", "exposure_ms"), {"ap_percent": "%"}, "refit", Tolerance(absolute=0.1),
        kind=CONSISTENCY,
    ),
    Item(
        "worked_examples", "Examples 1 and 2: operating points", "worked_examples.csv", ("example", "step"),
        {"exposure_ms": "ms", "iso": "", "sigma_dn": "DN", "mtf_at_0.1": "", "blur_px": "px", "detection_score": ""},
        "worked_examples", Tolerance(relative=0.05), why=ledger_causes.worked_examples,
        kind=lambda row: DEFINITION if row["column"] in ("exposure_ms", "iso", "blur_px") else EXPERIMENT,
    ),
    Item(
        "controller_ap", "Fig. built-in control and framework: AP", "controller_ap.csv", ("controller",),
        {"car_ap_percent": "%"}, "worked_examples", Tolerance(absolute=2.0), better="higher",
        barriers=(Barrier("three drives of a robot, another detector; ours are the same rendered views each time"),),
    ),
    Item(
        "controller_response", "Fig. built-in control and framework: response", "controller_response.csv",
        ("controller", "quantity", "time_ms"), {"value": ""}, "worked_examples", Tolerance(relative=0.05),
        kind=CONSISTENCY,
    ),
)  # fmt: skip
TITLES = {item.name: item.title for item in ITEMS}


def _text(value: Any) -> str:
    """A key as text, so that 5, 5.0 and an integer column's 5 are the same."""
    return f"{value:g}" if isinstance(value, (int, float)) else str(value)


def _long(item: Item, table: pd.DataFrame, number: str) -> pd.DataFrame:
    """One row per number: the table's columns, ``key`` (text), ``column`` (of the number) and the number."""
    import pandas as pd

    rows = [
        {**row, "key": "\t".join(_text(row[name]) for name in item.keys), "column": column, number: row[column]}
        for row in records(table)
        for column in item.values
        if column in row
    ]
    return pd.DataFrame(rows, columns=[*dict.fromkeys([*table.columns, "key", "column", number])])


def _ours(item: Item, inputs: ReportInputs) -> pd.DataFrame:
    """Ours by key and column of the number, with ``low``, ``high`` and ``measured_on``; empty where nothing has run."""
    import pandas as pd

    columns = ["key", "column", "ours", "low", "high", "measured_on"]
    path = existing(inputs.results.get(item.name))
    tables = [item.ours(inputs) if item.ours is not None else None, published_table(path) if path is not None else None]
    parts = []
    for table in tables:
        absent = [name for name in item.keys if table is not None and name not in table.columns]
        if absent:
            raise InputError(
                f"results of '{item.name}': column '{absent[0]}' is missing; expected the keys {list(item.keys)}"
            )
        if table is not None:
            if "measured_on" not in table:
                table = table.assign(measured_on=table.get("dataset", item.dataset))
            long = _long(item, table, "ours")
            ends = [item.intervals.get(column, ("", "")) for column in long["column"]]
            for number, name in enumerate(("low", "high")):
                long[name] = [row.get(end[number], math.nan) for row, end in zip(records(long), ends, strict=True)]
            parts.append(long[columns])
    known = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame({name: [] for name in columns})
    return known.drop_duplicates(["key", "column"], keep="last")


def _published(item: Item, inputs: ReportInputs) -> pd.DataFrame:
    if item.published is not None:
        return item.published(inputs)
    path = inputs.paper / item.file
    if not path.exists():
        raise InputError(f"{path}: no such file of published numbers; restore data/paper from git")
    return published_table(path).assign(**({"dataset": item.dataset} if item.dataset else {}))


def rows_of(item: Item, inputs: ReportInputs) -> list[LedgerRow]:
    """The ledger's rows of one item: one per published number, merged with ours.

    Raises:
        InputError: the published file is absent, or ours lacks a key.
    """
    paper = _long(item, _published(item, inputs), "paper")
    paper = paper[np.isfinite(paper["paper"].to_numpy(float))]
    if paper.empty:
        return []
    ours = _ours(item, inputs)
    merged = paper.merge(ours, how="left", on=["key", "column"], suffixes=("_of_paper", ""))
    merged["decimals"] = merged.groupby("column")["paper"].transform(lambda column: max(map(_decimals, column)))
    causes = item.why(inputs) if callable(item.why) and len(ours) else None
    return [_row(item, row, len(ours) > 0, causes, inputs) for row in records(merged)]


def _decimals(value: float) -> int:
    """Digits after the point of a printed number; a column has the most of any of its numbers."""
    exponent = Decimal(f"{value:.10g}").as_tuple().exponent
    return max(0, -exponent) if isinstance(exponent, int) else 0


def _row(item: Item, row: Row, has_run: bool, causes: Callable[[Row], str] | None, inputs: ReportInputs) -> LedgerRow:
    paper, dataset = float(row["paper"]), str(row.get("dataset", "sim"))
    stage = item.stage(row) if callable(item.stage) else item.stage
    unit = item.values[row["column"]]
    if not unit and isinstance(row.get("unit"), str) and "unit" not in item.keys:
        unit = row["unit"]
    barrier = next((one.why for one in item.barriers if one.applies(row, inputs)), "").format(profile=inputs.profile)
    ours, low, high = (float(row[name]) for name in ("ours", "low", "high"))
    tolerance = float(row["tolerance"]) if "tolerance" in row else item.tolerance.around(paper)
    has_interval = math.isfinite(low) and math.isfinite(high)
    if has_interval:
        known_error = row.get("paper_error", math.nan)
        error = 0.5 * 10.0 ** -int(row["decimals"]) + (known_error if math.isfinite(known_error) else 0.0)
        tolerance = tolerance_of_both(paper, error, ours, low, high)
    result = LedgerRow(
        item=item.name,
        quantity=_quantity(item, row),
        unit=unit,
        paper=paper,
        ours=ours,
        tolerance=tolerance,
        why=barrier,
        comparable=not barrier,
        line=inputs.line(stage.format_map({**{name: str(row[name]) for name in item.keys}, "dataset": dataset})),
        kind=item.kind(row) if callable(item.kind) else item.kind,
        dataset=row["measured_on"] if isinstance(row["measured_on"], str) and math.isfinite(ours) else "",
        low=low,
        high=high,
        better=item.better if has_interval else "",
        printed=item.printed(row),
    )
    if result.verdict == NOT_RUN:
        if dataset in inputs.absent and "dataset" in row:
            return replace(result, why="data absent", line=inputs.absent[dataset])
        return replace(result, why="not among our results" if has_run else "stage absent")
    if result.verdict in (BETTER, CLOSE, DIFFERS):
        known = causes(row) if causes is not None else str(item.why)
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
        words.append(str(row["column"]).rsplit("_percent", 1)[0].replace("_", " "))
    return ", ".join(words)


def all_rows(inputs: ReportInputs) -> list[LedgerRow]:
    """The whole ledger, in the paper's order."""
    return [row for item in ITEMS for row in rows_of(item, inputs)]
