"""The section of noise estimation: the paper's figure, the medians with intervals, and the abstentions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipeline.report import noise_figure
from pipeline.report.inputs import ReportInputs, any_table, noise_tables, records
from pipeline.report.sections.base import Block, NotRun, Run, Section, ShownFigure
from pipeline.report.tables import Cell, Column, Estimate, Table
from pipeline.report.wording import EFFECTS, ESTIMATORS, in_order, word

if TYPE_CHECKING:
    import pandas as pd

STAGE = "noise@{dataset}-{estimator}"
REFERENCE = "noise_reference.csv"


def _reference(inputs: ReportInputs) -> dict[tuple[str, str, float, str], float]:
    path = inputs.paper / REFERENCE
    if not path.exists():
        return {}
    return {
        (row["dataset"], row["effect"], float(row["level_dn"]), row["estimator"]): float(row["sigma_dn"])
        for row in records(any_table(path))
    }


def _medians(dataset: str, summary: pd.DataFrame, inputs: ReportInputs) -> Table:
    own = summary[summary["dataset"] == dataset]
    estimators = in_order(own["estimator"], ESTIMATORS)
    reference = _reference(inputs)
    rows: list[dict[str, Cell]] = []
    for effect in in_order(own["effect"], EFFECTS):
        for level in sorted(set(own.loc[own["effect"] == effect, "level_dn"])):
            cells = own[(own["effect"] == effect) & (own["level_dn"] == level)]
            row: dict[str, Cell] = {
                "effect": word(effect),
                "level_dn": level,
                "present_dn": float(cells["true_median_dn"].median()),
            }
            for found in records(cells):
                key = (dataset, effect, float(level), found["estimator"])
                inliers = int(found["count"]) - int(found["rejected"])
                row[found["estimator"]] = Estimate(
                    found["median_dn"], found["low_dn"], found["high_dn"], inliers, reference.get(key)
                )
            rows.append(row)
    columns = [Column("effect", "Effect"), Column("level_dn", "Level", "DN"), Column("present_dn", "Present", "DN", 2)]
    columns += [Column(name, word(name), "DN", 2) for name in estimators]
    notes = [
        "Median of the inliers (3.5 MAD) with bootstrap 95 % interval; n: inliers. Present: robust median of the noise "
        "really in the patches, after clipping, against which an estimator is to be judged."
    ]
    if any(isinstance(cell, Estimate) and cell.reference is not None for row in rows for cell in row.values()):
        notes.append("Code: the same statistic from the authors' published program, on its own frames.")
    caption = f"Noise estimated on {word(dataset)}."
    stage = STAGE.format(dataset=dataset, estimator="<estimator>")
    return Table(f"noise_{dataset}", caption, columns, rows, notes, stage, "code")


def _abstentions(summary: pd.DataFrame, estimates: pd.DataFrame) -> Table:
    rows: list[dict[str, Cell]] = []
    grouped = summary.groupby(["dataset", "estimator"], sort=False, as_index=False)
    for sums in records(grouped[["count", "rejected", "abstained"]].sum()):
        dataset, estimator = sums["dataset"], sums["estimator"]
        chosen = (estimates["dataset"] == dataset) & (estimates["estimator"] == estimator) & estimates["abstained"]
        reasons = estimates.loc[chosen, "reason"].value_counts().sort_index()
        rows.append(
            {
                "dataset": word(dataset),
                "estimator": word(estimator),
                "asked": int(sums["count"] + sums["abstained"]),
                "abstained": int(sums["abstained"]),
                "rejected": int(sums["rejected"]),
                "reasons": ", ".join(f"{reason}: {count:,}" for reason, count in reasons.items()),
            }
        )
    columns = [
        Column("dataset", "Dataset"),
        Column("estimator", "Estimator"),
        Column("asked", "Patches asked about"),
        Column("abstained", "Abstained"),
        Column("rejected", "Outliers rejected"),
        Column("reasons", "Reasons of abstention", wide=True),
    ]
    notes = ("Over all effects and levels. An abstention is neither a zero nor a dropped row: it is counted here.",)
    stage = STAGE.format(dataset="<dataset>", estimator="<estimator>")
    return Table("noise_abstentions", "Abstentions of the noise estimators.", columns, rows, notes, stage)


def section(inputs: ReportInputs) -> Section:
    """Noise estimation on every dataset."""
    summary, estimates = noise_tables(inputs)
    ran = {(row["dataset"], row["estimator"]) for row in records(summary[["dataset", "estimator"]])}
    estimators = in_order((estimator for _, estimator in ran), ESTIMATORS)
    runs: list[Run] = []
    blocks: list[Block] = []
    for dataset in inputs.datasets:
        for estimator in estimators or ["<estimator>"]:
            stage = STAGE.format(dataset=dataset, estimator=estimator)
            done = (dataset, estimator) in ran
            absent = inputs.absent.get(dataset) if not done else None
            why = "" if done else "data absent" if absent else "stage absent"
            runs.append(Run(f"Noise by {word(estimator)}", dataset, done, why, absent or inputs.line(stage)))
    if not summary.empty:
        caption = (
            "Noise estimation. Median (line) and range of the inliers (band) of the estimates over the level asked "
            "for. Thin diagonal: that level. Dashed: the noise really present after clipping to 8 bit."
        )
        stages = tuple(sorted(STAGE.format(dataset=dataset, estimator=estimator) for dataset, estimator in ran))
        done_on = in_order(summary["dataset"], inputs.datasets)
        blocks.append(ShownFigure("noise", noise_figure.draw(summary, done_on), caption, stages))
        blocks += [_medians(name, summary, inputs) for name in done_on]
        blocks.append(_abstentions(summary, estimates))
    shown: set[tuple[str, str]] = set()
    for run in runs:
        if not run.ran and (run.dataset, run.line) not in shown:
            shown.add((run.dataset, run.line))
            blocks.append(NotRun(f"Noise estimation on {word(run.dataset)}", run.why, run.line))
    return Section("noise", "Noise estimation", (), blocks, runs)
