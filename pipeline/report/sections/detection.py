"""Detection under blur and noise: average precision, IOPC curves and heat maps, blur direction, regression."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import pandas as pd

from pipeline.curves import iso_exposure
from pipeline.report import detection_results
from pipeline.report.detection_results import Recorded, Results
from pipeline.report.display_names import DATASETS, counted, in_order, word
from pipeline.report.inputs import ReportInputs
from pipeline.report.ledger.items import beside_ours
from pipeline.report.sections import detection_figures
from pipeline.report.sections.detection_figures import PAGE
from pipeline.report.spec import Block, Figure, NotRun, Run, Section, as_recorded, runs_by_estimator
from pipeline.report.tables import Cell, Estimate, Table, estimate, pivot, records, where

AP = estimate("ap_percent", "low_percent", "high_percent")
RISE = "↑"


def _joined(results: Sequence[Results], part: str) -> pd.DataFrame:
    """One part of several detectors' results, with a column ``detector``; classes without an object are left out."""
    parts = [
        selected[selected["label"].isin(one.labels)].assign(detector=one.detector)
        for one in results
        if (selected := getattr(one, part)) is not None
    ]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()


def _stages(stage: str, results: Sequence[Results]) -> tuple[str, ...]:
    return tuple(f"{stage}@{one.dataset}-{one.detector}" for one in results)


def corners(dataset: str, results: Sequence[Results]) -> Table:
    """AP of every detector and class at the corners of the sweep."""
    rows = []
    for one in results:
        size, level = one.precision["kernel_size_px"].max(), one.precision["target_sigma_dn"].max()
        ends = {"clean": (0, 0), "noisy": (0, level), "blurred": (size, 0), "both": (size, level)}
        for label in one.labels:
            selected = one.precision[one.precision["label"] == label]
            cells = {name: _corner(one, label, *end) for name, end in ends.items()}
            rows.append({**selected.iloc[0], "detector": one.detector, "label": label, **cells})
    return PAGE.table("corners", rows, dataset=dataset)


def _corner(one: Results, label: str, size_px: float, sigma_dn: float) -> Cell:
    """AP under one blur and noise; its mean over directions, with the interval of that mean, under directed blur."""
    condition = {"label": label, "kernel_size_px": size_px, "target_sigma_dn": sigma_dn}
    cells = where(one.precision, **condition)
    if len(cells) < 2:
        return AP(records(cells)[0]) if len(cells) else None
    means = [] if one.spread is None else records(where(one.spread, **condition))
    low, high = (means[0][f"mean_{end}_percent"] if means else math.nan for end in ("low", "high"))
    return Estimate(float(cells["ap_percent"].mean()), low, high)


def by_direction(one: Results) -> Table | None:
    """The paper's table of blur directions, of one detector: rows noise and angle, columns class and length."""
    if one.directions is None or one.directions.empty:
        return None

    def cell(row: Mapping[str, Any]) -> Cell:
        if not math.isfinite(row["ap_percent"]):
            return None
        rises = row["rises_with_size"] or row["rises_with_sigma"]
        return Estimate(row["ap_percent"], row["low_percent"], row["high_percent"], mark=RISE if rises else "")

    selected = one.directions.sort_values(["target_sigma_dn", "angle_deg"], kind="stable")
    column = selected["label"] + selected["kernel_size_px"].map("_{:g}".format)
    labels = [label for label in one.labels if (selected["label"] == label).any()]
    sizes = sorted(set(selected["kernel_size_px"]))
    across = {f"{label}_{px:g}": f"{word(label)} {px:g} px" for label in labels for px in sizes}
    rows = pivot(selected.assign(column=column), ["target_sigma_dn", "angle_deg"], "column", cell)
    return PAGE.table("by_direction", rows, across=across, dataset=one.dataset, detector=one.detector)


def spread(dataset: str, results: Sequence[Results]) -> Table | None:
    """Largest effect of the blur direction: best less worst angle, without noise."""
    cells = _joined(results, "spread")
    cells = where(cells, target_sigma_dn=0) if len(cells) else cells
    return PAGE.table("spread", cells, dataset=dataset) if len(cells) else None


def fits(dataset: str, results: Sequence[Results]) -> Table:
    """Goodness of each fit, and the calibration of its axes."""
    pairs = [(one, label) for one in results for label in sorted(one.fits)]
    raised = [one.raised_errors(label) for one, label in pairs]
    floor = max((float(errors.max()) for errors in raised if len(errors)), default=0.0)
    rows = [
        {"detector": one.detector, "label": label, **one.fits[label], "unweighted_r2": one.unweighted_r2(label)}
        | ({"raised": len(errors)} if len(one.fitted_cells(label)) else {})
        for (one, label), errors in zip(pairs, raised, strict=True)
    ]
    known = results[0].calibration if results else {}
    notes = [*(["calibration"] if "lambda1" in known else []), *(["raised"] if floor else [])]
    return PAGE.table(
        "regression_fits", rows, cells={"reason": lambda row: f"no fit: {row['reason']}" if "reason" in row else None},
        also=notes, without=() if floor else ("raised",), dataset=dataset, floor=floor, **known,
    )  # fmt: skip


def _needed(heat: pd.DataFrame) -> str:
    """How many objects it would take for the rises that are not certain."""
    needed = heat.loc[heat["non_monotonic"] & ~heat["certainly"], "objects_needed"].dropna()
    if needed.empty:
        return ""
    least, median = needed.min(), needed.median()
    beside = f" and more are needed (median {median:,.0f})" if len(needed) > 1 else " are needed"
    return f"For an open triangle to be certain, {least:,.0f} objects{beside}."


def _curves(dataset: str, results: Sequence[Results], inputs: ReportInputs) -> list[Block]:
    blocks: list[Block] = [corners(dataset, results)]
    isolated, heat = _joined(results, "isolated"), _joined(results, "heat")
    stages = _stages("curves", results)
    if len(isolated):
        blocks.append(PAGE.figure("iopc", detection_figures.iopc(isolated), stages, dataset=dataset))
    if len(heat):
        drawing, needed = detection_figures.heat(heat), _needed(heat)
        blocks.append(PAGE.figure("iopc_heat", drawing, stages, after=needed, dataset=dataset))
    for one in results:
        for label in sorted(set(one.refused) & set(one.labels)):
            title = f"Surface of {word(one.detector)} for {word(label)} on {word(dataset)} ({one.refused[label]})"
            blocks.append(NotRun(title, "too little measured", inputs.line(f"curves@{dataset}-{one.detector}")))
    return blocks


def _directions(dataset: str, results: Sequence[Results]) -> list[Figure | Table]:
    cells = _joined(results, "directions")
    blocks: list[Figure | Table] = []
    for label in sorted(set(cells["label"])) if len(cells) else ():
        words = {"dataset": dataset, "label": label, "class": label.replace(" ", "_")}
        drawing = detection_figures.direction(cells, label)
        blocks.append(PAGE.figure("direction", drawing, _stages("direction", results), **words))
    parts = [spread(dataset, results), *map(by_direction, results)] if blocks else []
    return [*blocks, *(part for part in parts if part is not None)]


def _regression(dataset: str, results: Sequence[Results]) -> list[Block]:
    if not any(one.fits for one in results):
        return []
    fitted, coefficients = (_joined(results, part) for part in ("fitted", "coefficients"))
    if fitted.empty:
        return [fits(dataset, results)]
    titles = {
        f"{one.detector} {label}": f"{word(one.detector)}, {word(label).lower()}"
        for one in results for label in one.labels
    }  # fmt: skip
    fitted, coefficients = (rows.assign(fit=rows["detector"] + " " + rows["label"]) for rows in (fitted, coefficients))
    drawn = {name: title for name, title in titles.items() if name in set(fitted["fit"])}
    drawing = detection_figures.regression(fitted.drop(columns="detector"), drawn)
    terms = coefficients.assign(fit=coefficients["fit"].map(titles))
    return [
        PAGE.figure("regression", drawing, _stages("regression", results), dataset=dataset),
        fits(dataset, results),
        PAGE.table("regression_coefficients", terms, dataset=dataset),
    ]


def _recorded(sweeps: Sequence[Recorded]) -> list[Block]:
    """AP, curves and heat maps measured earlier on recorded pictures, each with its source."""
    blocks: list[Block] = []
    for one in sweeps:
        selected, about = one.results, one.provenance
        blur = word(about["sweep"]["blur"]).lower()
        title = f"{word(selected.detector)} on {word(selected.dataset)} behind {blur}"
        count = f"{counted(one.objects, 'object')} in {counted(len(about['frames']), 'frame')}"
        shown = corners(selected.dataset, [selected])
        caption = f"Recorded: average precision of {title} at the corners of the sweep, {count}."
        blocks.append(replace(shown, name=f"recorded_{one.name}_ap", caption=caption, stage=""))
        words = {"title": title, "count": count, "source": about["source"].rstrip("."), "record": one.name}
        words["weights"] = about["detector"]["sha256"][:12]
        blocks.append(PAGE.figure("recorded_iopc", detection_figures.iopc(selected.isolated), **words))
        if len(selected.heat):
            drawing, rises = detection_figures.heat(selected.heat), _needed(selected.heat)
            blocks.append(PAGE.figure("recorded_iopc_heat", drawing, after=rises, title=title, record=one.name))
        for block in _directions(selected.dataset, [selected]):
            blocks.append(as_recorded(block, prefix=f"{one.name}_", count=count))
    return blocks


def _refit(inputs: ReportInputs) -> list[Block]:
    """The published grids fitted anew."""
    fitted = inputs.read("refit/coefficients.parquet", iso_exposure.COEFFICIENTS)
    numbers = inputs.read("refit/fits.json")
    if fitted is None or not numbers:
        return []
    words = "; ".join(PAGE.text("refit", grid=word(label), **one) for label, one in sorted(numbers.items()))
    titled = fitted.assign(fit=fitted["label"].map(word))
    return [PAGE.table("regression_refit", titled, numbers=words)]


def _runs(results: Sequence[Results], sweeps: Sequence[Recorded], inputs: ReportInputs) -> list[Run]:
    planned = inputs.pairs("curves")
    names = {*(dataset for dataset, _ in planned), *(set(inputs.absent) & set(DATASETS))}
    datasets, ran = in_order(names, DATASETS), [(one.dataset, one.detector) for one in results]
    listed = {name for _, name in planned}
    runs = runs_by_estimator("Detection", "curves", ran, inputs, names=listed, datasets=datasets)
    for name, line in inputs.detectors_absent.items():
        known = {one.results.dataset for one in sweeps if one.results.detector == name}
        datasets = in_order({*names, *known}, DATASETS) if known else [""]
        title = f"Detection by {word(name)}"
        runs += [Run(title, dataset, False, "weights absent", line, dataset in known) for dataset in datasets]
    return runs


def section(inputs: ReportInputs) -> Section:
    """Detection on every dataset, then the paper's published numbers beside ours."""
    results, sweeps = detection_results.read(inputs), detection_results.recorded(inputs)
    runs = _runs(results, sweeps, inputs)
    blocks: list[Block] = []
    for dataset in in_order((one.dataset for one in results), DATASETS):
        selected = [one for one in results if one.dataset == dataset]
        blocks += _curves(dataset, selected, inputs) + _directions(dataset, selected) + _regression(dataset, selected)
    items = ("yolov7_direction_ap", "regression_coefficients", "fitted_ap_grid")
    published, published_runs = beside_ours(items, inputs)
    blocks += [*_recorded(sweeps), *_refit(inputs), *published]
    return PAGE.section(blocks, [*runs, *published_runs])
