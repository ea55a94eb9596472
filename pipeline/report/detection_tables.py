"""Tables of the detection chapter: average precision with intervals, direction, regression."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from pipeline.report.detection_results import Results
from pipeline.report.estimates import of_row
from pipeline.report.inputs import records
from pipeline.report.tables import Cell, Column, Estimate, Table, format_number
from pipeline.report.wording import word

if TYPE_CHECKING:
    import pandas as pd

RISE = " ↑"


def precision(dataset: str, found: Sequence[Results]) -> Table:
    """Average precision of every detector and class: sharp, and at the ends of the sweep."""
    rows: list[dict[str, Cell]] = []
    for one in found:
        table = one.precision
        size, level = table["size_px"].max(), table["level_dn"].max()
        for label in one.labels:
            own = table[table["label"] == label]
            sharp, quiet = own["size_px"] == 0, own["level_dn"] == 0
            row: dict[str, Cell] = {"detector": word(one.detector), "label": word(label)}
            cells = {
                "clean": own[sharp & quiet],
                "noisy": own[sharp & (own["level_dn"] == level)],
                "blurred": own[quiet & (own["size_px"] == size)],
                "both": own[(own["size_px"] == size) & (own["level_dn"] == level)],
            }
            row |= {name: _estimate(cell) for name, cell in cells.items()}
            row |= {"objects": int(own["objects"].iloc[0]), "ignored": int(own["objects_ignored"].iloc[0])}
            rows.append({**row, "images": int(own["images"].iloc[0])})
    columns = [
        Column("detector", "Detector"),
        Column("label", "Class"),
        Column("clean", "Sharp, no noise", "%", 1),
        Column("noisy", "Strongest noise", "%", 1),
        Column("blurred", "Longest blur", "%", 1),
        Column("both", "Both", "%", 1),
        Column("objects", "Objects"),
        Column("ignored", "Ignored"),
        Column("images", "Frames"),
    ]
    notes = [
        "Average precision by the paper's rules (IoU 0.5, whole area), with a bootstrap 95 % interval over scenes. "
        "Blurred columns: mean over directions, interval from the lowest to the highest end of any direction's. "
        "Ignored: low or hidden objects, which count neither way.",
    ]
    stage = f"curves@{dataset}-<detector>"
    caption = f"Average precision on {word(dataset)} at the corners of the sweep."
    return Table(f"detection_ap_{dataset}", caption, columns, rows, notes, stage)


def _estimate(cells: pd.DataFrame) -> Estimate | None:
    if cells.empty:
        return None
    low, high = float(cells["low_percent"].min()), float(cells["high_percent"].max())
    return Estimate(float(cells["ap_percent"].mean()), low, high)


def direction(one: Results) -> Table | None:
    """The paper's table of blur directions, of one detector: rows noise and angle, columns class and length."""
    table = one.directions
    if table is None or table.empty:
        return None
    labels = [label for label in one.labels if (table["label"] == label).any()]
    sizes = sorted(set(table["size_px"]))
    rows: list[dict[str, Cell]] = []
    groups: Any = table.groupby(["level_dn", "angle_deg"])
    for (level, angle), group in groups:
        row: dict[str, Cell] = {"level_dn": float(level), "angle_deg": float(angle)}
        for cell in records(group):
            if cell["label"] in labels and math.isfinite(cell["ap_percent"]):
                mark = RISE if cell["rises_with_size"] or cell["rises_with_sigma"] else ""
                row[f"{cell['label']}_{cell['size_px']:g}"] = format_number(cell["ap_percent"], 1) + mark
        rows.append(row)
    columns = [Column("level_dn", "Noise", "DN"), Column("angle_deg", "Angle", "°")]
    columns += [Column(f"{label}_{size:g}", f"{word(label)} {size:g} px", "%") for label in labels for size in sizes]
    notes = [f"{RISE.strip()}: better than with the next shorter blur, or at the next lower noise. 0°: horizontal."]
    name = f"direction_{one.dataset}_{one.detector}"
    caption = f"Average precision of {word(one.detector)} on {word(one.dataset)} by direction and length of the blur."
    return Table(name, caption, columns, rows, notes, f"direction@{one.dataset}-{one.detector}")


def spread(dataset: str, found: Sequence[Results]) -> Table | None:
    """What direction does at most: best less worst angle, without noise."""
    rows: list[dict[str, Cell]] = []
    for one in found:
        if one.spread is None:
            continue
        for cell in records(one.spread):
            if cell["level_dn"] == 0 and cell["label"] in one.labels:
                row: dict[str, Cell] = {"detector": word(one.detector), "label": word(cell["label"])}
                width = of_row(cell, "spread_percent")
                row |= {"size_px": cell["size_px"], "mean": cell["mean_percent"], "spread": width}
                rows.append({**row, "worst": cell["worst_angle_deg"]})
    if not rows:
        return None
    columns = [
        Column("detector", "Detector"),
        Column("label", "Class"),
        Column("size_px", "Length", "px"),
        Column("mean", "Mean over directions", "%", 1),
        Column("spread", "Best less worst direction", "points", 1),
        Column("worst", "Worst direction", "°"),
    ]
    caption = f"What the direction of the blur does on {word(dataset)}, without noise."
    return Table(f"direction_spread_{dataset}", caption, columns, rows, (), f"direction@{dataset}-<detector>")


def coefficients(name: str, found: pd.DataFrame, caption: str, stage: str) -> Table:
    """Coefficients of several fits, with what each term is worth.

    Args:
        name: of the table.
        found: `pipeline.curves.by_settings.COEFFICIENTS` with a column ``fit``, its title.
        caption: of the table.
        stage: that made it.
    """
    rows: list[dict[str, Cell]] = []
    for cell in records(found):
        row: dict[str, Cell] = {"fit": cell["fit"], "term": cell["term"], "formula": cell["formula"]}
        row |= {key: cell[key] for key in ("value", "std_dev", "largest_change", "f", "p_value", "r2_without")}
        rows.append(row)
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
    return Table(name, caption, columns, rows, notes, stage)


def fits(dataset: str, found: Sequence[Results]) -> Table:
    """How well each fit does, and the calibration that its axes rest on."""
    rows: list[dict[str, Cell]] = []
    for one in found:
        for label, numbers in sorted(one.fits.items()):
            row: dict[str, Cell] = {"detector": word(one.detector), "label": word(label)}
            if "reason" in numbers:
                rows.append({**row, "reason": f"no fit: {numbers['reason']}"})
                continue
            names = ("cells", "chi2", "r2", "adjusted_r2", "largest_residual")
            rows.append({**row, **{name: numbers[name] for name in names}})
    columns = [
        Column("detector", "Detector"),
        Column("label", "Class"),
        Column("cells", "Cells"),
        Column("chi2", "χ²", "", 2),
        Column("r2", "R²", "", 4),
        Column("adjusted_r2", "Adjusted R²", "", 4),
        Column("largest_residual", "Largest residual", "points", 2),
        Column("reason", "Note", wide=True),
    ]
    notes = ["Weighted by the bootstrap error of each cell; χ² is the sum of squared residuals over these errors."]
    for one in found[:1]:
        known = one.calibration
        if "lambda1" in known:
            notes.append(
                f"Calibration by the estimators: λ₁ {known['lambda1']:.5f} ± {known['lambda1_std_dev']:.5f} DN per ISO "
                f"(taken: {known['lambda1_nominal']:g}), λ₂ {known['lambda2']:.3f} ± "
                f"{known['lambda2_std_dev']:.3f} px per ms (taken: {known['lambda2_nominal']:g})."
            )
    caption = f"Regression of average precision over ISO and exposure time on {word(dataset)}."
    return Table(f"regression_fits_{dataset}", caption, columns, rows, notes, f"regression@{dataset}-<detector>")
