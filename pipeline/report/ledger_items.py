"""The published tables and figures that the ledger follows, in the paper's order.

Each item names a file of published numbers, the columns that tell its rows apart, and where ours come from:
either a function of the report's inputs, or a table with the same key and value columns given as
``ReportInputs.results[item]``. A new experiment therefore enters the ledger by writing such a table.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

from pipeline.errors import InputError
from pipeline.report import ledger_combined, ledger_detection, ledger_recorded, ledger_sources
from pipeline.report.inputs import ReportInputs, any_table, existing, records
from pipeline.report.ledger import CLOSE, DIFFERS, NOT_RUN, LedgerRow, Tolerance
from pipeline.report.wording import word

if TYPE_CHECKING:
    import pandas as pd

Key = tuple[str, ...]
UNEXPLAINED = "not explained yet"


@dataclass(frozen=True)
class Item:
    """One published table or figure.

    Attributes:
        name: of the item, and of its entry in ``ReportInputs.results``.
        title: what the paper calls it.
        file: in the folder of published numbers.
        keys: columns that tell rows apart, shown as the quantity.
        values: column of numbers -> unit.
        stage: the stage that makes ours; ``{dataset}`` and other keys are filled in.
        other_stage: makes the name of the stage for rows that another one makes, ``""`` for the rest.
        tolerance: how far ours may lie from the published value.
        better: ``"lower"`` or ``"higher"`` where one side is the better one; said in the cause.
        why: cause shown where ours differ.
        incomparable: key columns -> the reason why such a row cannot be compared, or ``""``.
        ours: makes ours from the inputs, beside what ``ReportInputs.results[name]`` holds.
        published: makes the published side, where it is a rule rather than a file.
    """

    name: str
    title: str
    file: str
    keys: Key
    values: dict[str, str]
    stage: str
    tolerance: Tolerance
    better: str = ""
    why: str = ""
    incomparable: Callable[[dict[str, Any], ReportInputs], str] | None = None
    ours: Callable[[ReportInputs], pd.DataFrame | None] | None = None
    published: Callable[[ReportInputs], pd.DataFrame] | None = None
    other_stage: Callable[[dict[str, Any]], str] | None = None


def _elsewhere(row: dict[str, Any], inputs: ReportInputs) -> str:
    return "the published run times are of other hardware (Xeon W-2145, Quadro RTX 6000)"


def _own_sim(row: dict[str, Any], inputs: ReportInputs) -> str:
    own = row["dataset"] == "sim"
    return "the reference was measured on the authors' Sim frames; ours are rendered here" if own else ""


def _own_sim_but_recorded(row: dict[str, Any], inputs: ReportInputs) -> str:
    own = _own_sim(row, inputs)
    return "" if own and ledger_recorded.authors_frames(row["dataset"], row["estimator"], inputs) else own


def _own_sim_but_star(row: dict[str, Any], inputs: ReportInputs) -> str:
    return "" if row["estimator"] == "ground_truth" else _own_sim_but_recorded(row, inputs)


def _star(row: dict[str, Any]) -> str:
    return "star" if row["estimator"] == "ground_truth" else ""


def _chosen_size(row: dict[str, Any], inputs: ReportInputs) -> str:
    chosen = str(row["quantity"]).startswith("frames_") and inputs.profile != "paper"
    return f"a size that profile '{inputs.profile}' chooses, not a result" if chosen else ""


def _other_detector(row: dict[str, Any], inputs: ReportInputs) -> str:
    return "another detector on other frames than the paper's YOLOv7 on Udacity"


def _of_the_data(row: dict[str, Any], inputs: ReportInputs) -> str:
    of_data = row["parameter"] in ("chi2", "r2")
    return "ours is of the printed grid, which is the paper's fit itself; its data are not published" if of_data else ""


ITEMS: tuple[Item, ...] = (
    Item(
        "image_formation", "Image formation: sensor constants and moments", "image_formation.csv", ("quantity",),
        {"value": ""}, "sensor", Tolerance(relative=0.02), ours=ledger_sources.formation,
    ),
    Item(
        "noise_levels", "Image formation: largest miss of a noise level", "", ("dataset", "effect"),
        {"miss_percent": "%"}, "corrupt@{dataset}", Tolerance(absolute=2.0), ours=ledger_sources.levels,
        published=ledger_sources.expected_levels,
    ),
    Item(
        "dataset_sizes", "Datasets: sizes", "dataset_sizes.csv", ("dataset", "quantity"), {"value": ""},
        "index@{dataset}", Tolerance(), why="another frame size is set or found", incomparable=_chosen_size,
        ours=ledger_sources.sizes,
    ),
    Item(
        "noise_reference", "Fig. noise estimation: PCA and B+F by the authors' code", "noise_reference.csv",
        ("dataset", "effect", "level_dn", "estimator"), {"sigma_dn": "DN"}, "noise@{dataset}-{estimator}",
        Tolerance(absolute=1.0), why="other frames than the reference's", incomparable=_own_sim,
        ours=ledger_sources.noise_medians,
    ),
    Item(
        "uncorrupted_mtf", "Fig. uncorrupted datasets", "uncorrupted_mtf.csv",
        ("dataset", "estimator", "statistic", "frequency"), {"mtf": ""}, "blur@{dataset}-{estimator}",
        Tolerance(absolute=0.05), why="other frames than the paper's, and another renderer and lens than its Sim",
        incomparable=_own_sim_but_star, ours=ledger_recorded.uncorrupted, other_stage=_star,
    ),
    Item(
        "runtime", "Table: run times", "runtime.csv", ("estimator", "unit"), {"seconds": "s"}, "runtime",
        Tolerance(), "lower", incomparable=_elsewhere, ours=ledger_sources.run_times,
    ),
    Item(
        "blur_amae", "Table I: AMAE of blur estimators", "blur_amae.csv", ("dataset", "estimator", "blur", "size_px"),
        {"amae_percent": "%"}, "blur@{dataset}-{estimator}", Tolerance(absolute=2.0), "lower",
        why="other frames than the paper's 150, and estimators written or trained anew",
        incomparable=_own_sim_but_recorded, ours=ledger_recorded.blur_amae,
    ),
    Item(
        "photon_defocus_amae", "Fig. defocus in presence of photon noise", "photon_defocus_amae.csv",
        ("sigma_dn", "size_px"), {"amae_percent": "%"}, "combined@{dataset}", Tolerance(absolute=2.0), "lower",
        why="ours is the spectral network, on other frames", ours=ledger_combined.photon_defocus,
        published=partial(ledger_combined.published, "photon_defocus_amae.csv"),
    ),
    Item(
        "photon_linear_motion_mtf", "Fig. linear motion in presence of photon noise", "photon_linear_motion_mtf.csv",
        ("series", "sigma_dn", "frequency"), {"mtf": ""}, "combined@{dataset}", Tolerance(absolute=0.05),
        why="ours is the spectral network, whose curves stay by the truth while those of the paper's rise with the "
        "noise; other frames and another kernel of that size",
        ours=ledger_combined.photon_linear,
        published=partial(ledger_combined.published, "photon_linear_motion_mtf.csv"),
    ),
    Item(
        "improved_blur", "Supplement: improved blur estimation", "improved_blur.csv", ("d2_px", "d1_px", "sigma_dn"),
        {"mae_h_percent": "%", "mae_v_percent": "%", "amae_percent": "%", "expected_amae_percent": "%"},
        "denoised_blur@{dataset}", Tolerance(absolute=2.0), "lower",
        why="ours is trained on noise and takes smoothed noise for a scene that the disc alone has blurred; it does "
        "better without smoothing (table of improved blur estimation)", ours=ledger_combined.improved,
        published=partial(ledger_combined.published, "improved_blur.csv"),
    ),
    Item(
        "yolov7_direction_ap", "Supplement: AP by blur direction", "yolov7_direction_ap.csv",
        ("sigma_dn", "angle_deg", "size_px"), {"ap_percent": "%"}, "direction", Tolerance(absolute=2.0), "higher",
        incomparable=_other_detector, ours=ledger_detection.direction_ap,
    ),
    Item(
        "regression_coefficients", "Supplement: fit of AP over ISO and exposure", "regression_coefficients.csv",
        ("detector", "object", "parameter"), {"value": "", "std_dev": ""}, "refit", Tolerance(relative=0.02),
        incomparable=_of_the_data, published=ledger_detection.published_coefficients,
    ),
    Item(
        "fitted_ap_grid", "Supplement: fitted AP over ISO and exposure", "fitted_ap_grid.csv",
        ("detector", "object", "iso", "exposure_ms"), {"ap_percent": "%"}, "refit", Tolerance(absolute=0.1),
    ),
    Item(
        "worked_examples", "Examples 1 and 2: operating points", "worked_examples.csv", ("example", "step"),
        {"exposure_ms": "ms", "iso": "", "sigma_dn": "DN", "mtf_at_0.1": "", "blur_px": "px", "detection_score": ""},
        "closed_loop", Tolerance(relative=0.05),
    ),
    Item(
        "controller_ap", "Fig. built-in control and framework: AP", "controller_ap.csv", ("controller",),
        {"car_ap_percent": "%"}, "closed_loop", Tolerance(absolute=2.0), "higher",
    ),
    Item(
        "controller_response", "Fig. built-in control and framework: response", "controller_response.csv",
        ("controller", "quantity", "time_ms"), {"value": ""}, "closed_loop", Tolerance(relative=0.05),
    ),
)  # fmt: skip

PICTURES_ONLY = (
    "The paper prints its noise curves, its object-detection (IOPC) curves and heat maps and its defocus with "
    "dark-current-noise table as pictures only: no numbers exist to compare."
)


def _key(row: dict[str, Any], keys: Key) -> Key:
    """Keys as text, so that 5, 5.0 and an integer column's 5 are the same."""
    return tuple(f"{row[name]:g}" if isinstance(row[name], (int, float)) else str(row[name]) for name in keys)


def _quantity(item: Item, row: dict[str, Any], value: str) -> str:
    """Which number of the item a row is, in words; the published file may give them itself as ``label``."""
    if isinstance(row.get("label"), str):
        dataset = f"{word(str(row['dataset']))}, " if "dataset" in row else ""
        return dataset + row["label"]
    units = {
        "level_dn": "DN",
        "sigma_dn": "DN",
        "size_px": "px",
        "angle_deg": "°",
        "time_ms": "ms",
        "exposure_ms": "ms",
    }
    names = {"sigma_dn": "σ", "level_dn": "σ", "frequency": "f", "iso": "ISO", "d1_px": "d₁", "d2_px": "d₂"}
    words = []
    for key in item.keys:
        cell = row[key]
        if isinstance(cell, (int, float)):
            if math.isfinite(cell):
                words.append(" ".join(part for part in (names.get(key, ""), f"{cell:g}", units.get(key, "")) if part))
        else:
            words.append(word(str(cell)))
    if len(item.values) > 1:
        words.append(value.rsplit("_percent", 1)[0].replace("_", " "))
    return ", ".join(words)


def _ours(item: Item, inputs: ReportInputs) -> dict[tuple[Key, str], float]:
    """Ours by key and value column; empty where nothing has run."""
    path = existing(inputs.results.get(item.name))
    sources = [item.ours(inputs) if item.ours is not None else None, any_table(path) if path is not None else None]
    found = {}
    for table in sources:
        if table is None:
            continue
        absent = [name for name in item.keys if name not in table.columns]
        if absent:
            raise InputError(
                f"results of '{item.name}': column '{absent[0]}' is missing; expected the keys {list(item.keys)}"
            )
        for row in records(table):
            found.update({(_key(row, item.keys), value): float(row[value]) for value in item.values if value in row})
    return found


def rows_of(item: Item, inputs: ReportInputs) -> list[LedgerRow]:
    """The ledger's rows of one item, one per published number.

    Raises:
        InputError: the published file is absent, or ours lacks a key.
    """
    if item.published is not None:
        published = item.published(inputs)
    else:
        path = inputs.paper / item.file
        if not path.exists():
            raise InputError(f"{path}: no such file of published numbers; restore data/paper from git")
        published = any_table(path)
    ours = _ours(item, inputs)
    rows = []
    for row in records(published):
        for value, unit in item.values.items():
            if row.get(value) is not None and math.isfinite(float(row[value])):
                rows.append(_row(item, row, value, unit, ours, inputs))
    return rows


def _row(
    item: Item, row: dict[str, Any], value: str, unit: str, ours: dict[tuple[Key, str], float], inputs: ReportInputs
) -> LedgerRow:
    paper = float(row[value])
    own = ours.get((_key(row, item.keys), value), math.nan)
    dataset = str(row.get("dataset", "sim"))
    stage = item.other_stage(row) if item.other_stage is not None else ""
    stage = stage or item.stage.format_map({**{name: str(row[name]) for name in item.keys}, "dataset": dataset})
    barrier = item.incomparable(row, inputs) if item.incomparable else ""
    bound = float(row["tolerance"]) if "tolerance" in row else item.tolerance.around(paper)
    result = LedgerRow(
        item=item.name,
        quantity=_quantity(item, row, value),
        unit=unit or (str(row["unit"]) if isinstance(row.get("unit"), str) and "unit" not in item.keys else ""),
        paper=paper,
        ours=own,
        tolerance=bound,
        why=barrier,
        comparable=not barrier,
        line=inputs.line(stage),
    )
    if result.verdict == NOT_RUN:
        if dataset in inputs.absent and "dataset" in row:
            return replace(result, why="data absent", line=inputs.absent[dataset])
        return replace(result, why="not among our results" if ours else "stage absent")
    if result.verdict in (CLOSE, DIFFERS):
        causes = [row["why"] if isinstance(row.get("why"), str) else item.why]
        if item.better and (own < paper) == (item.better == "lower"):
            causes.insert(0, f"ours is {item.better}, which is better")
        return replace(result, why="; ".join(cause for cause in causes if cause) or UNEXPLAINED)
    return result


def all_rows(inputs: ReportInputs) -> list[LedgerRow]:
    """The whole ledger, in the paper's order."""
    return [row for item in ITEMS for row in rows_of(item, inputs)]
