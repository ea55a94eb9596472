"""Detection under blur and noise: average precision, IOPC curves and heat maps, blur direction, regression."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pipeline.curves import iso_exposure
from pipeline.report import detection_results
from pipeline.report.detection_results import Recorded, Results
from pipeline.report.display_names import DATASETS, DETECTORS, counted, in_order, word
from pipeline.report.inputs import ReportInputs, optional
from pipeline.report.ledger import LedgerRow
from pipeline.report.sections import detection_figures
from pipeline.report.sections.published import beside_ours
from pipeline.report.spec import STAGE_ABSENT, Block, Figure, NotRun, Run, Section, overview
from pipeline.report.tables import (
    Cell,
    Column,
    Estimate,
    Table,
    estimate,
    format_number,
    named,
    pivot,
    table,
)

if TYPE_CHECKING:
    import pandas as pd

TEXT = (
    "Each detector is applied to every frame under every blur, direction and noise of the sweep. Noise and modulation "
    "transfer function (MTF) are estimated on the objects of the same frames, as a camera could do; average precision "
    "(AP) is drawn over these estimates. Intervals come from resampling scenes."
)
PARTS = "AP under blur and noise, IOPC curves and heat maps, blur-direction table, regression over ISO and exposure"
RISE = " ↑"
EACH_CELL = " Filled triangles: in 97.5 % of the bootstrap draws of that cell alone, not corrected for their number."
"""Of records that lack the number of objects it would take."""


def _joined(results: Sequence[Results], part: str) -> pd.DataFrame:
    """One part of several detectors' results, with a column ``detector``; classes without an object are left out."""
    import pandas as pd

    parts = [
        own[own["label"].isin(one.labels)].assign(detector=one.detector)
        for one in results
        if (own := getattr(one, part)) is not None
    ]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()


def _stages(stage: str, results: Sequence[Results]) -> tuple[str, ...]:
    return tuple(f"{stage}@{one.dataset}-{one.detector}" for one in results)


def corners(dataset: str, results: Sequence[Results]) -> Table:
    """AP of every detector and class at the corners of the sweep."""
    rows = []
    for one in results:
        size, level = one.precision["kernel_size_px"].max(), one.precision["target_sigma_dn"].max()
        for label in one.labels:
            own = one.precision[one.precision["label"] == label]
            row = {"detector": one.detector, "label": label, **own[["objects", "objects_ignored", "images"]].iloc[0]}
            places = {"clean": (0, 0), "noisy": (0, level), "blurred": (size, 0), "both": (size, level)}
            for name, (px, dn) in places.items():
                cells = own[(own["kernel_size_px"] == px) & (own["target_sigma_dn"] == dn)]
                if len(cells) == 1:
                    value, low, high = map(float, cells[["ap_percent", "low_percent", "high_percent"]].iloc[0])
                    row[name] = Estimate(value, low, high)
                elif len(cells):
                    row[name] = Estimate(float(cells["ap_percent"].mean()), *_of_mean(one, label, px, dn))
            rows.append(row)
    columns = [
        named("detector", "Detector"),
        named("label", "Class"),
        Column("clean", "Sharp, no noise", "%", 1),
        Column("noisy", "Strongest noise", "%", 1),
        Column("blurred", "Longest blur", "%", 1),
        Column("both", "Both", "%", 1),
        Column("objects", "Objects", source=lambda row: int(row["objects"])),
        Column("ignored", "Ignored", source=lambda row: int(row["objects_ignored"])),
        Column("images", "Frames", source=lambda row: int(row["images"])),
    ]
    notes = [
        "Average precision by the paper's rules (IoU 0.5, whole area), with a bootstrap 95 % interval over scenes. "
        "Blurred columns: mean over directions, with the interval of that mean. "
        "Ignored: low or hidden objects, which are neither true nor false positives.",
    ]
    caption = f"Average precision on {word(dataset)} at the corners of the sweep."
    return table(f"detection_ap_{dataset}", caption, rows, columns, notes, f"curves@{dataset}-<detector>")


def _of_mean(one: Results, label: str, size_px: float, target_sigma_dn: float) -> tuple[float, float]:
    """95 % interval of the AP's mean over directions; NaN where it was not measured."""
    rows = one.spread
    if rows is not None:
        rows = rows[
            (rows["label"] == label)
            & (rows["kernel_size_px"] == size_px)
            & (rows["target_sigma_dn"] == target_sigma_dn)
        ]
    if rows is None or rows.empty:
        return math.nan, math.nan
    return float(rows["mean_low_percent"].iloc[0]), float(rows["mean_high_percent"].iloc[0])


def by_direction(one: Results) -> Table | None:
    """The paper's table of blur directions, of one detector: rows noise and angle, columns class and length."""
    if one.directions is None or one.directions.empty:
        return None

    def cell(row: Mapping[str, Any]) -> Cell:
        mark = RISE if row["rises_with_size"] or row["rises_with_sigma"] else ""
        return format_number(row["ap_percent"], 1) + mark if math.isfinite(row["ap_percent"]) else None

    own = one.directions.sort_values(["target_sigma_dn", "angle_deg"], kind="stable")
    own = own.assign(
        place=[f"{label}_{size:g}" for label, size in zip(own["label"], own["kernel_size_px"], strict=True)]
    )
    labels = [label for label in one.labels if (own["label"] == label).any()]
    columns = [Column("target_sigma_dn", "Noise", "DN"), Column("angle_deg", "Angle", "°")]
    for label in labels:
        columns += [
            Column(f"{label}_{px:g}", f"{word(label)} {px:g} px", "%") for px in sorted(set(own["kernel_size_px"]))
        ]
    notes = [f"{RISE.strip()}: better than with the next shorter blur, or at the next lower noise. 0°: horizontal."]
    caption = f"Average precision of {word(one.detector)} on {word(one.dataset)} by direction and length of the blur."
    name = f"{one.dataset}_{one.detector}"
    rows = pivot(own, ["target_sigma_dn", "angle_deg"], "place", cell)
    return table(f"direction_{name}", caption, rows, columns, notes, f"direction@{one.dataset}-{one.detector}")


def spread(dataset: str, results: Sequence[Results]) -> Table | None:
    """Largest effect of the blur direction: best less worst angle, without noise."""
    cells = _joined(results, "spread")
    cells = cells[cells["target_sigma_dn"] == 0] if len(cells) else cells
    if cells.empty:
        return None
    columns = [
        named("detector", "Detector"),
        named("label", "Class"),
        Column("kernel_size_px", "Length", "px"),
        Column("mean", "Mean over directions", "%", 1,
               estimate("mean_percent", "mean_low_percent", "mean_high_percent")),
        Column("spread", "Best less worst direction", "points", 1,
               estimate("spread_percent", "low_percent", "high_percent")),
        Column("worst", "Worst direction", "°", source="worst_angle_deg"),
    ]  # fmt: skip
    caption = f"Effect of the blur direction on {word(dataset)}, without noise."
    return table(f"direction_spread_{dataset}", caption, cells, columns, (), f"direction@{dataset}-<detector>")


def coefficients(name: str, fitted: pd.DataFrame, caption: str, stage: str) -> Table:
    """Coefficients of several fits, with the effect of leaving each term out.

    Args:
        name: of the table.
        fitted: `pipeline.curves.iso_exposure.COEFFICIENTS` with a column ``fit``, its title.
        caption: of the table.
        stage: that made it.
    """
    columns = [
        Column("fit", "Fit"),
        Column("term", "Term"),
        Column("formula", "Multiplies"),
        Column("value", "Value"),
        Column("std_dev", "Std. dev."),
        Column("largest_change", "Largest change without it", "points", 2),
        Column("f", "Partial F"),
        Column("p_value", "p"),
        Column("r2_without", "R² without it", "", 4),
    ]
    notes = ["x: ISO, y: exposure time in ms. A term matters where leaving it out changes the fit: a large F."]
    return table(name, caption, fitted, columns, notes, stage)


def fits(dataset: str, results: Sequence[Results]) -> Table:
    """Goodness of each fit, and the calibration of its axes."""
    rows = [
        {"detector": one.detector, "label": label, **numbers}
        for one in results
        for label, numbers in sorted(one.fits.items())
    ]
    columns = [
        named("detector", "Detector"),
        named("label", "Class"),
        Column("cells", "Cells"),
        Column("chi2", "χ²", "", 2),
        Column("r2", "R²", "", 4),
        Column("adjusted_r2", "Adjusted R²", "", 4),
        Column("largest_residual", "Largest residual", "points", 2),
        Column("reason", "Note", wide=True,
               source=lambda row: f"no fit: {row['reason']}" if "reason" in row else None),
    ]  # fmt: skip
    notes = ["Weighted by the bootstrap error of each cell; χ² is the sum of squared residuals over these errors."]
    known = results[0].calibration if results else {}
    if "lambda1" in known:
        notes.append(
            f"Calibration by the estimators: λ₁ {known['lambda1']:.5f} ± {known['lambda1_std_dev']:.5f} DN per ISO "
            f"(taken: {known['lambda1_nominal']:g}), λ₂ {known['lambda2']:.3f} ± "
            f"{known['lambda2_std_dev']:.3f} px per ms (taken: {known['lambda2_nominal']:g})."
        )
    caption = f"Regression of average precision over ISO and exposure time on {word(dataset)}."
    return table(f"regression_fits_{dataset}", caption, rows, columns, notes, f"regression@{dataset}-<detector>")


def _needed(heat: pd.DataFrame) -> str:
    """How many objects it would take for the rises that are not certain."""
    needed = heat.loc[heat["non_monotonic"] & ~heat["certainly"], "objects_needed"].dropna()
    if needed.empty:
        return ""
    return f" For the others it would take {needed.min():,.0f} objects and more (median {needed.median():,.0f})."


def _curves(dataset: str, results: Sequence[Results], inputs: ReportInputs) -> list[Block]:
    blocks: list[Block] = [corners(dataset, results)]
    isolated, heat = _joined(results, "isolated"), _joined(results, "heat")
    stages = _stages("curves", results)
    if len(isolated):
        caption = (
            f"Isolated curves (IOPC) on {word(dataset)}: AP over estimated noise, and over estimated MTF, with 95 % "
            "intervals. A ring marks a point whose AP exceeds that of its milder neighbour."
        )
        blocks.append(Figure(f"iopc_{dataset}", detection_figures.iopc(isolated), caption, stages))
    if len(heat):
        caption = (
            f"Heat maps on {word(dataset)}: AP in the paper's bins of estimated noise and MTF; white bins were not "
            "measured. A triangle marks a cell whose AP exceeds that of a milder one, filled where that is certain "
            f"although so many cells are compared (Bonferroni).{_needed(heat)}"
        )
        blocks.append(Figure(f"iopc_heat_{dataset}", detection_figures.heat(heat), caption, stages))
    for one in results:
        for label in sorted(set(one.refused) & set(one.labels)):
            title = f"Surface of {word(one.detector)} for {word(label)} on {word(dataset)} ({one.refused[label]})"
            blocks.append(NotRun(title, "too little measured", inputs.line(f"curves@{dataset}-{one.detector}")))
    return blocks


def _directions(dataset: str, results: Sequence[Results]) -> list[Block]:
    cells = _joined(results, "directions")
    blocks: list[Block] = []
    for label in sorted(set(cells["label"])) if len(cells) else ():
        caption = f"AP of {word(label).lower()} by length and direction of the blur on {word(dataset)}."
        name = f"direction_{dataset}_{label}".replace(" ", "_")
        drawing = detection_figures.direction(cells, label)
        blocks.append(Figure(name, drawing, caption, _stages("direction", results)))
    parts = [spread(dataset, results), *map(by_direction, results)] if blocks else []
    return [*blocks, *(part for part in parts if part is not None)]


def _regression(dataset: str, results: Sequence[Results]) -> list[Block]:
    import pandas as pd

    if not any(one.fits for one in results):
        return []
    cells, found, titles = [], [], {}
    for one in results:
        for label in one.labels if one.fitted is not None and one.coefficients is not None else ():
            assert one.fitted is not None and one.coefficients is not None
            rows = one.fitted[one.fitted["label"] == label]
            if len(rows):
                name, title = f"{one.detector} {label}", f"{word(one.detector)}, {word(label).lower()}"
                titles[name] = title
                cells.append(rows.assign(fit=name))
                found.append(one.coefficients[one.coefficients["label"] == label].assign(fit=title))
    blocks: list[Block] = [fits(dataset, results)]
    if cells:
        caption = (
            f"Regression on {word(dataset)}: fitted AP over ISO and exposure time (dots: measured cells; ISO 100 is "
            "1 DN, 1 ms a motion of 1 px), and the residuals of the cells."
        )
        drawing = detection_figures.regression(pd.concat(cells, ignore_index=True), titles)
        blocks.insert(0, Figure(f"regression_{dataset}", drawing, caption, _stages("regression", results)))
        caption = f"Coefficients of the regression on {word(dataset)}, and the effect of each term."
        name, stage = f"regression_coefficients_{dataset}", f"regression@{dataset}-<detector>"
        blocks.append(coefficients(name, pd.concat(found), caption, stage))
    return blocks


def _recorded(records: Sequence[Recorded]) -> list[Block]:
    """AP, curves and heat maps measured earlier on recorded pictures, each with its source."""
    blocks: list[Block] = []
    for one in records:
        own, about = one.results, one.provenance
        title = f"{word(own.detector)} on {word(own.dataset)}"
        source = f"{counted(one.objects, 'object')} in {counted(len(about['frames']), 'frame')}"
        shown = corners(own.dataset, [own])
        caption = f"Recorded: average precision of {title} at the corners of the sweep, {source}."
        blocks.append(replace(shown, name=f"recorded_{one.name}_ap", caption=caption, stage=""))
        caption = (
            f"Recorded: isolated curves of {title}, {source}: {about['source'].rstrip('.')}. Weights: "
            f"{about['detector']['sha256'][:12]}."
        )
        blocks.append(Figure(f"recorded_{one.name}_iopc", detection_figures.iopc(own.isolated), caption))
        if len(own.heat):
            rises = _needed(own.heat) if "objects_needed" in own.heat else EACH_CELL
            caption = f"Recorded: heat maps of {title}, of the same frames.{rises}"
            blocks.append(Figure(f"recorded_{one.name}_iopc_heat", detection_figures.heat(own.heat), caption))
        for block in _directions(own.dataset, [own]):
            if not isinstance(block, NotRun):
                name, caption = f"recorded_{one.name}_{block.name}", f"Recorded: {block.caption}"
                unstaged = {"stages": ()} if isinstance(block, Figure) else {"stage": ""}
                blocks.append(replace(block, name=name, caption=caption, **unstaged))
    return blocks


def _refit(inputs: ReportInputs) -> list[Block]:
    """The published grids fitted anew."""
    folder = None if inputs.detection is None else inputs.detection / "refit"
    fitted = optional(folder, "coefficients.parquet", iso_exposure.COEFFICIENTS)
    numbers = optional(folder, "fits.json")
    if fitted is None or not numbers:
        return []
    words = "; ".join(
        f"{label.replace('_', ' ')}: R² {one['r2']:.6f}, coefficients within {one['largest_miss_in_std_devs']:.2f} of "
        f"their printed standard deviations, printed grid within {one['largest_miss_of_grid']:.3f} points"
        for label, one in sorted(numbers.items())
    )
    titled = fitted.assign(fit=fitted["label"].str.replace("_", " "))
    caption = f"The paper's published grids fitted anew. {words}."
    return [coefficients("regression_refit", titled, caption, "refit")]


def _runs(results: Sequence[Results], records: Sequence[Recorded], inputs: ReportInputs) -> list[Run]:
    planned = sorted(inputs.detection_members)
    names = {*(dataset for dataset, _ in planned), *(set(inputs.absent) & set(DATASETS))}
    runs = [
        run
        for detector in in_order({name for _, name in planned}, DETECTORS)
        for run in overview(
            f"Detection by {word(detector)}", f"curves@{{dataset}}-{detector}",
            [one.dataset for one in results if one.detector == detector], inputs, in_order(names, DATASETS),
        )
    ]  # fmt: skip
    for name, line in inputs.detectors_absent.items():
        known = {one.results.dataset for one in records if one.results.detector == name}
        datasets = in_order({*names, *known}, DATASETS) if known else [""]
        title = f"Detection by {word(name)}"
        runs += [Run(title, dataset, False, "weights absent", line, dataset in known) for dataset in datasets]
    return runs


def section(inputs: ReportInputs, ledger: Sequence[LedgerRow] = ()) -> Section:
    """Detection on every dataset, then the paper's published numbers beside ours."""
    results = detection_results.read(inputs)
    records = detection_results.recorded(inputs)
    runs = _runs(results, records, inputs)
    blocks: list[Block] = []
    for dataset in in_order((one.dataset for one in results), DATASETS):
        own = [one for one in results if one.dataset == dataset]
        blocks += [*_curves(dataset, own, inputs), *_directions(dataset, own), *_regression(dataset, own)]
    if not results:
        blocks.append(NotRun(PARTS, STAGE_ABSENT, inputs.line("curves@<dataset>-<detector>")))
    notes = {
        run.line: NotRun(f"Detection on {word(run.dataset)}" if run.dataset else run.experiment, run.why, run.line)
        for run in reversed(runs)
        if run.state == "absent" and run.why != STAGE_ABSENT
    }
    blocks += [*reversed(notes.values()), *_recorded(records), *_refit(inputs)]
    items = ("yolov7_direction_ap", "regression_coefficients", "fitted_ap_grid")
    published, published_runs = beside_ours(items, ledger, inputs)
    title = "Object detection under blur and noise"
    return Section("detection", title, (TEXT,), [*blocks, *published], [*runs, *published_runs])
