"""The tables of blur estimation: the paper's Table I, ours beside the paper's best, and what was abstained from."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.blur.evaluation import SHARP
from pipeline.report.estimates import of_amae
from pipeline.report.inputs import ReportInputs, any_table, existing, records
from pipeline.report.tables import Cell, Column, Estimate, Table, format_number
from pipeline.report.wording import BLURS, DATASETS, ESTIMATORS, PAPER_NAMES, in_order, word

if TYPE_CHECKING:
    import pandas as pd

STAGE = "blur@{dataset}-{estimator}"
ANY_STAGE = STAGE.format(dataset="<dataset>", estimator="<estimator>")
SHORT = {"defocus": "D", "linear_motion": "L", "nonlinear_motion": "N"}
FITTED = (
    "Spectral, fitted: not divided; answers are mapped to the truth by what the network makes of the same camera's "
    "sharp frames, blurred on purpose. Frames are in two halves, each judged with a fit to the other. "
    "Nothing added reads a little under 1."
)
TYPICAL = (
    "Spectral, typical lens: the network's answer less the blur of a typical lens, for a camera without sharp frames; "
    "of frames from a better lens, or rendered with none, it tells less blur than there is."
)
MEAN = "Mean"
NOT_COUNTED = "The paper has no estimator of this name, so the ledger does not count these rows."
ADDED = frozenset({"fitted", "fused", "typical"})
"""Estimators that answer what was added to sharp frames: what they read from those is no curve of the frames."""

Place = tuple[str, float]  # kind and size of a blur
Published = Mapping[tuple[str, str, str, float], float]  # dataset, estimator, kind, size -> AMAE in percent


def paper_table(inputs: ReportInputs, name: str) -> pd.DataFrame | None:
    """Published numbers with a column dataset, those of its Sim also under our name of the authors' own frames.

    Args:
        inputs: of the report.
        name: of the file.
    """
    import pandas as pd

    path = existing(inputs.paper / name)
    if path is None:
        return None
    table = any_table(path)
    again = [table[table["dataset"] == theirs].assign(dataset=ours) for ours, theirs in PAPER_NAMES.items()]
    return pd.concat([table, *again], ignore_index=True)


def published_amae(table: pd.DataFrame | None) -> dict[tuple[str, str, str, float], float]:
    """The paper's Table I by dataset, estimator, kind and size.

    Args:
        table: columns dataset, estimator, blur, size_px, amae_percent; None for none.
    """
    rows = [] if table is None else records(table)
    return {
        (str(row["dataset"]), str(row["estimator"]), str(row["blur"]), float(row["size_px"])): float(
            row["amae_percent"]
        )
        for row in rows
    }


def _name(place: Place) -> str:
    """``"D 3"``, as the paper abbreviates."""
    return f"{SHORT.get(place[0], word(place[0]))} {format_number(place[1])}"


def _ordered(places: set[Place]) -> list[Place]:
    kinds = in_order((kind for kind, _ in places), BLURS)
    return sorted(places, key=lambda place: (kinds.index(place[0]), place[1]))


def _cells(summary: pd.DataFrame) -> dict[tuple[str, Place], Estimate]:
    """Estimator and place -> the cell, of one dataset's rows, raw or calibrated."""
    return {
        (str(row["estimator"]), (str(row["kind"]), float(row["size_px"]))): of_amae(row) for row in records(summary)
    }


def _mean(cells: Mapping[Place, Estimate]) -> Estimate:
    """Mean over the kernels that have an answer, the paper's over the same ones; over all of its where none has."""
    own = {place: cell for place, cell in cells.items() if math.isfinite(cell.value)}
    theirs = [cell.reference for cell in (own or cells).values()]
    known = [value for value in theirs if value is not None]
    reference = float(np.mean(known)) if known and len(known) == len(theirs) else None
    return Estimate(float(np.mean([cell.value for cell in own.values()])) if own else math.nan, reference=reference)


def _best(row: Mapping[str, Cell], estimators: list[str]) -> str:
    """The estimator with the lowest AMAE of ours; empty where fewer than two have one."""
    found = {name: cell.value for name in estimators if isinstance(cell := row.get(name), Estimate)}
    found = {name: value for name, value in found.items() if math.isfinite(value)}
    return word(min(found, key=lambda name: found[name])) if len(found) > 1 else ""


def amae(dataset: str, summary: pd.DataFrame, published: Published, is_calibrated: bool) -> Table:
    """Table I of one dataset: a row for each kind and size of blur, a column for each estimator, and their means.

    Args:
        dataset: name.
        summary: `pipeline.blur.evaluation.SUMMARY`.
        published: from `published_amae`; shown beside raw answers, which are what the paper prints.
        is_calibrated: show answers divided by those for sharp frames.
    """
    own = summary[(summary["dataset"] == dataset) & (summary["calibrated"] == is_calibrated)]
    cells = _cells(own)
    theirs = {} if is_calibrated else {key[1:]: value for key, value in published.items() if key[0] == dataset}
    estimators = in_order([*own["estimator"], *(key[0] for key in theirs)], ESTIMATORS)
    places = {place for _, place in cells} | {(key[1], key[2]) for key in theirs}
    sharp = {place for place in places if place[0] == SHARP}
    rows: list[dict[str, Cell]] = []
    columns_of: dict[str, dict[Place, Estimate]] = {name: {} for name in estimators}
    for place in [*([] if is_calibrated else sorted(sharp)), *_ordered(places - sharp)]:
        row: dict[str, Cell] = {"blur": "None (sharp)" if place[0] == SHARP else _name(place)}
        for name in estimators:
            cell, paper = cells.get((name, place)), theirs.get((name, *place))
            if cell is None and paper is None:
                continue
            cell = cell or Estimate(math.nan)
            row[name] = Estimate(cell.value, cell.low, cell.high, cell.count, paper)
            if place[0] != SHARP:
                columns_of[name][place] = Estimate(cell.value, reference=paper)
        rows.append({**row, "best": _best(row, estimators)})
    means: dict[str, Cell] = {name: _mean(cells) for name, cells in columns_of.items() if cells}
    rows.append({"blur": MEAN, **means, "best": _best(means, estimators)})
    columns = [Column("blur", "Blur", "px"), *(Column(name, word(name), "%", 1) for name in estimators)]
    columns.append(Column("best", "Best of ours"))
    notes = [
        "AMAE of the robust median over patches, averaged over rotations, with bootstrap 95 % interval; n: patches "
        "with an answer, over all rotations. D: defocus, L: linear motion, N: non-linear motion, with their size. "
        "Mean: over D, L and N. Resampling adds error, so an interval may lie above an AMAE that is near zero."
    ]
    if is_calibrated:
        notes.append("Calibrated: each answer divided by the same camera's answer for its own sharp frames.")
        if "fitted" in estimators:
            notes.append(FITTED)
    elif "typical" in estimators:
        notes.append(TYPICAL)
    if theirs:
        notes.append("Paper: Table I; an en dash where we did not run the estimator. " + _comparability(dataset))
    caption = f"Table I on {word(dataset)}: error of the MTF{', calibrated' if is_calibrated else ''}."
    stage = STAGE.format(dataset=dataset, estimator="<estimator>")
    return Table(f"blur_amae_{dataset}{'_calibrated' if is_calibrated else ''}", caption, columns, rows, notes, stage)


def _comparability(dataset: str) -> str:
    if dataset == "sim":
        return "Its Sim frames are the authors', ours are rendered here: set beside each other, not compared."
    return "A mean of the paper's is taken over the kernels that ran here."


def beside_the_best(summary: pd.DataFrame, published: Published) -> Table | None:
    """Our own estimators beside the paper's CNN and the best of its three, per dataset and blur; None without any.

    Args:
        summary: `pipeline.blur.evaluation.SUMMARY`.
        published: from `published_amae`.
    """
    theirs = {key[1] for key in published}
    ours = in_order(set(summary["estimator"]) - theirs, ESTIMATORS)
    blurred = summary[(summary["kind"] != SHARP) & summary["estimator"].isin(ours)]
    rows: list[dict[str, Cell]] = []
    for dataset in in_order(blurred["dataset"], DATASETS):
        own = blurred[blurred["dataset"] == dataset]
        raw, calibrated = (_cells(own[own["calibrated"] == way]) for way in (False, True))
        lines: list[dict[str, Cell]] = []
        for place in _ordered({place for _, place in raw | calibrated}):
            paper = {name: published[dataset, name, *place] for name in theirs if (dataset, name, *place) in published}
            if not paper:
                continue
            best = min(paper, key=lambda name: (paper[name], name))
            line: dict[str, Cell] = {"dataset": word(dataset), "blur": _name(place)}
            for name in ours:
                cells = {name: raw.get((name, place)), f"{name}_calibrated": calibrated.get((name, place))}
                line |= {way: cell for way, cell in cells.items() if cell is not None}
            lines.append({**line, "cnn": paper.get("cnn"), "best": paper[best], "which": word(best)})
        if lines:
            rows += [*lines, _means(word(dataset), lines)]
    if not rows:
        return None
    columns = [Column("dataset", "Dataset"), Column("blur", "Blur", "px")]
    for name in ours:
        ways = (Column(name, word(name), "%", 1), Column(f"{name}_calibrated", f"{word(name)}, calibrated", "%", 1))
        columns += [column for column in ways if any(column.name in row for row in rows)]
    columns += [Column("cnn", "Paper, CNN", "%", 1), Column("best", "Paper, best of three", "%", 1)]
    columns.append(Column("which", "which is"))
    notes = (f"{NOT_COUNTED} Frames differ from the paper's; on Sim they are of another renderer.",)
    caption = "Estimators the paper does not have, beside its CNN and the best of its three: AMAE."
    return Table("blur_beside_the_best", caption, columns, rows, notes, ANY_STAGE)


def _means(dataset: str, lines: list[dict[str, Cell]]) -> dict[str, Cell]:
    """The mean over one dataset's lines of every column of numbers."""
    means: dict[str, Cell] = {"dataset": dataset, "blur": MEAN}
    for column in lines[0]:
        values = [cell.value if isinstance(cell := line.get(column), Estimate) else cell for line in lines]
        numbers = [value for value in values if isinstance(value, (int, float)) and math.isfinite(value)]
        if numbers and len(numbers) == len(lines):
            means[column] = float(np.mean(numbers))
    return means


def abstentions(summary: pd.DataFrame, estimates: pd.DataFrame) -> Table:
    """Who abstained how often and why, the error of a single patch, and how often an interval held the truth.

    Args:
        summary: `pipeline.blur.evaluation.SUMMARY`.
        estimates: `pipeline.blur.evaluation.ESTIMATES`.
    """
    rows: list[dict[str, Cell]] = []
    # An estimator that is fitted to its camera has calibrated answers only.
    of_own = summary.groupby(["dataset", "estimator"])["calibrated"].transform("all")
    raw = summary[~summary["calibrated"] | of_own]
    patch = ["dataset", "estimator", "kernel", "frame", "patch"]
    refused = estimates.loc[estimates["abstained"], [*patch, "reason"]].drop_duplicates(patch)
    for dataset in raw["dataset"].unique():
        for estimator in in_order(raw.loc[raw["dataset"] == dataset, "estimator"], ESTIMATORS):
            own = raw[(raw["dataset"] == dataset) & (raw["estimator"] == estimator)]
            why = refused[(refused["dataset"] == dataset) & (refused["estimator"] == estimator)]["reason"]
            row: dict[str, Any] = {
                "dataset": word(str(dataset)),
                "estimator": word(estimator),
                "asked": int(own["count"].sum() + own["abstained"].sum()),
                "abstained": int(own["abstained"].sum()),
                "reasons": ", ".join(
                    f"{reason}: {count:,}" for reason, count in why.value_counts().sort_index().items()
                ),
            }
            blurred = own[own["kind"] != SHARP]
            row["patch_error_percent"] = _weighted(blurred, "patch_error_percent")
            row["coverage_percent"] = 100 * _weighted(blurred, "coverage")
            rows.append(row)
    columns = [
        Column("dataset", "Dataset"),
        Column("estimator", "Estimator"),
        Column("asked", "Patches asked about"),
        Column("abstained", "Abstained"),
        Column("patch_error_percent", "Error of a single patch", "%", 1),
        Column("coverage_percent", "Truths within the 95 % interval", "%", 0),
        Column("reasons", "Reasons of abstention", wide=True),
    ]
    notes = (
        "Over all kernels and rotations, sharp frames among those asked about. An abstention is neither a zero nor a "
        "dropped row: it is counted here. Error of a single patch: mean |estimate − truth|, no median over patches, "
        "uncalibrated but for an estimator fitted to its camera. An en dash: the estimator gives no interval.",
    )
    return Table("blur_abstentions", "Abstentions and single-patch errors.", columns, rows, notes, ANY_STAGE)


def _weighted(rows: pd.DataFrame, name: str) -> float:
    """Mean over cells weighted by their patches; NaN where no cell has a number."""
    known = rows[np.isfinite(rows[name].to_numpy(float)) & (rows["count"].to_numpy() > 0)]
    return float(np.average(known[name], weights=known["count"])) if len(known) else math.nan
