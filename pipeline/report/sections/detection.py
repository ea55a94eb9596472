"""The chapter of detection: average precision, IOPC curves and heat maps, blur direction, regression."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from pipeline.curves import by_settings
from pipeline.report import (
    detection_results,
    detection_tables,
    direction_figure,
    heat_figure,
    iopc_figure,
    regression_figure,
)
from pipeline.report.detection_results import Results
from pipeline.report.inputs import ReportInputs, any_table, existing, optional_json, optional_table
from pipeline.report.ledger import LedgerRow
from pipeline.report.sections import published
from pipeline.report.sections.base import Block, NotRun, Run, Section, ShownFigure
from pipeline.report.tables import Table
from pipeline.report.wording import DATASETS, DETECTORS, in_order, word
from pipeline.store import read_json

TEXT = (
    "Each detector looks at every frame under every blur, direction and noise of the sweep. What a camera could know "
    "of these conditions, noise and modulation transfer function (MTF), is estimated on the objects of the same "
    "frames; average precision (AP) is drawn over these estimates. Intervals come from resampling scenes."
)
PARTS = "AP under blur and noise, IOPC curves and heat maps, blur-direction table, regression over ISO and exposure"


def _joined(found: Sequence[Results], part: str) -> pd.DataFrame:
    """One part of several detectors' results, with a column ``detector``; classes without an object are left out."""
    tables = []
    for one in found:
        table = getattr(one, part)
        if table is not None:
            tables.append(table[table["label"].isin(one.labels)].assign(detector=one.detector))
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame()


def _stages(stage: str, found: Sequence[Results]) -> tuple[str, ...]:
    return tuple(f"{stage}@{one.dataset}-{one.detector}" for one in found)


def _curves(dataset: str, found: Sequence[Results], inputs: ReportInputs) -> list[Block]:
    blocks: list[Block] = [detection_tables.precision(dataset, found)]
    isolated, heat = _joined(found, "isolated"), _joined(found, "heat")
    if not isolated.empty:
        caption = (
            f"Isolated curves (IOPC) on {word(dataset)}: AP over estimated noise, and over estimated MTF, with 95 % "
            "intervals. A ring marks a point that does better than its milder neighbour."
        )
        blocks.append(ShownFigure(f"iopc_{dataset}", iopc_figure.draw(isolated), caption, _stages("curves", found)))
    if not heat.empty:
        caption = (
            f"Heat maps on {word(dataset)}: AP in the paper's bins of estimated noise and MTF; white bins were not "
            "measured. A triangle marks a cell that does better than a milder one, a filled one where 97.5 % of the "
            "bootstrap draws agree."
        )
        blocks.append(ShownFigure(f"iopc_heat_{dataset}", heat_figure.draw(heat), caption, _stages("curves", found)))
    for one in found:
        for label, reason in sorted(one.refused.items()):
            if label in one.labels:
                what = f"Surface of {word(one.detector)} for {word(label)} on {word(dataset)} ({reason})"
                blocks.append(NotRun(what, "too little measured", inputs.line(f"curves@{dataset}-{one.detector}")))
    return blocks


def _directions(dataset: str, found: Sequence[Results]) -> list[Block]:
    table = _joined(found, "directions")
    if table.empty:
        return []
    blocks: list[Block] = []
    for label in sorted(set(table["label"])):
        caption = f"AP of {word(label).lower()} by length and direction of the blur on {word(dataset)}."
        name, drawing = f"direction_{dataset}_{label}", direction_figure.draw(table, label)
        blocks.append(ShownFigure(name.replace(" ", "_"), drawing, caption, _stages("direction", found)))
    parts = [detection_tables.spread(dataset, found), *map(detection_tables.direction, found)]
    return [*blocks, *(part for part in parts if part is not None)]


def _regression(dataset: str, found: Sequence[Results]) -> list[Block]:
    if not any(one.fits for one in found):
        return []
    blocks: list[Block] = []
    tables, coefficients, titles = [], [], {}
    for one in found:
        if one.fitted is None or one.coefficients is None:
            continue
        for label in one.labels:
            rows = one.fitted[one.fitted["label"] == label]
            if rows.empty:
                continue
            name, title = f"{one.detector} {label}", f"{word(one.detector)}, {word(label).lower()}"
            titles[name] = title
            tables.append(rows.assign(fit=name))
            coefficients.append(one.coefficients[one.coefficients["label"] == label].assign(fit=title))
    if tables:
        caption = (
            f"Regression on {word(dataset)}: fitted AP over ISO and exposure time (dots: measured cells; ISO 100 is "
            "1 DN, 1 ms a motion of 1 px), and the residuals of the cells."
        )
        drawing = regression_figure.draw(pd.concat(tables, ignore_index=True), titles)
        blocks.append(ShownFigure(f"regression_{dataset}", drawing, caption, _stages("regression", found)))
    blocks.append(detection_tables.fits(dataset, found))
    if coefficients:
        caption = f"Coefficients of the regression on {word(dataset)}, and what each term is worth."
        name, stage = f"regression_coefficients_{dataset}", f"regression@{dataset}-<detector>"
        blocks.append(detection_tables.coefficients(name, pd.concat(coefficients), caption, stage))
    return blocks


def _recorded(inputs: ReportInputs) -> list[Block]:
    """Curves measured earlier on recorded pictures, each with its source."""
    blocks: list[Block] = []
    place = existing(inputs.recorded)
    for path in sorted(place.glob("*/precision.csv")) if place is not None else []:
        said = read_json(path.parent / "provenance.json")
        name = path.parent.name.replace("-", "_")
        title = f"{word(said['detector']['kind'])} on {word(said['dataset'])}"
        curves = iopc_figure.draw(any_table(path.parent / "iopc.csv"))
        heat = heat_figure.draw(any_table(path.parent / "iopc_heat.csv"))
        where = f"{len(said['frames'])} frames: {said['source'].rstrip('.')}"
        caption = f"Recorded: isolated curves of {title}, {where}. Weights: {said['detector']['sha256'][:12]}."
        blocks.append(ShownFigure(f"recorded_{name}_iopc", curves, caption))
        caption = f"Recorded: heat maps of {title}, of the same frames."
        blocks.append(ShownFigure(f"recorded_{name}_iopc_heat", heat, caption))
    return blocks


def _refit(inputs: ReportInputs) -> list[Block]:
    """The published grids fitted anew."""
    folder = None if inputs.detection is None else inputs.detection / "refit"
    found = optional_table(folder, "coefficients.parquet", by_settings.COEFFICIENTS)
    numbers = optional_json(folder, "fits.json")
    if found is None or not numbers:
        return []
    words = "; ".join(
        f"{label.replace('_', ' ')}: R² {one['r2']:.6f}, coefficients within {one['largest_miss_in_std_devs']:.2f} of "
        f"their printed standard deviations, printed grid within {one['largest_miss_of_grid']:.3f} points"
        for label, one in sorted(numbers.items())
    )
    caption = f"The paper's published grids fitted anew. {words}."
    titled = found.assign(fit=found["label"].str.replace("_", " "))
    table: Table = detection_tables.coefficients("regression_refit", titled, caption, "refit")
    return [table]


def _runs(found: Sequence[Results], inputs: ReportInputs) -> list[Run]:
    ran = {(one.dataset, one.detector) for one in found}
    named = sorted(inputs.detection_members)
    detectors = in_order({pair[1] for pair in named}, DETECTORS)
    lines = []
    for dataset in in_order({*(pair[0] for pair in named), *(set(inputs.absent) & set(DATASETS))}, DATASETS):
        for detector in detectors:
            done, absent = (dataset, detector) in ran, inputs.absent.get(dataset)
            why = "" if done else "data absent" if absent else "stage absent"
            line = inputs.line(f"curves@{dataset}-{detector}") if done or not absent else absent
            lines.append(Run(f"Detection by {word(detector)}", dataset, done, why, line))
    lines += [
        Run(f"Detection by {word(name)}", "", False, "weights absent", line)
        for name, line in inputs.detectors_absent.items()
    ]
    return lines


def section(chapter: published.Chapter, rows: Sequence[LedgerRow], inputs: ReportInputs) -> Section:
    """Detection on every dataset, then the paper's published numbers beside ours.

    Args:
        chapter: the paper's part.
        rows: the whole ledger.
        inputs: of the report.
    """
    beside = published.section(chapter, rows, inputs)
    found = detection_results.read(inputs)
    runs = _runs(found, inputs)
    blocks: list[Block] = []
    for dataset in in_order((one.dataset for one in found), DATASETS):
        own = [one for one in found if one.dataset == dataset]
        blocks += [*_curves(dataset, own, inputs), *_directions(dataset, own), *_regression(dataset, own)]
    if not found:
        blocks.append(NotRun(PARTS, "stage absent", inputs.line("curves@<dataset>-<detector>")))
    noted = set()
    for run in runs:
        if not run.ran and run.why != "stage absent" and run.line not in noted:
            noted.add(run.line)
            where = f" on {word(run.dataset)}" if run.dataset else ""
            blocks.append(NotRun(f"{run.experiment if not run.dataset else 'Detection'}{where}", run.why, run.line))
    blocks += [*_recorded(inputs), *_refit(inputs), *beside.blocks]
    return Section(chapter.key, chapter.title, (TEXT,), blocks, [*runs, *beside.runs])
