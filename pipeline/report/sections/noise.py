"""The section of noise estimation: the paper's figure, medians, local maps, single patches, and the abstentions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipeline.errors import InputError
from pipeline.report import noise_figure, noise_maps_figure, noise_patch_tables
from pipeline.report.estimates import of_row
from pipeline.report.inputs import (
    ReportInputs,
    any_table,
    members,
    noise_tables,
    optional_arrays,
    optional_json,
    records,
)
from pipeline.report.noise_maps_figure import NoiseMaps
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
                "added_dn": float(cells["added_median_dn"].median()),
                "present_dn": float(cells["true_median_dn"].median()),
            }
            for found in records(cells):
                key = (dataset, effect, float(level), found["estimator"])
                inliers = int(found["count"]) - int(found["rejected"])
                row[found["estimator"]] = of_row(found, "median_dn", "dn", inliers, reference.get(key))
            rows.append(row)
    columns = [Column("effect", "Effect"), Column("level_dn", "Level", "DN")]
    columns += [Column("added_dn", "Added", "DN", 2), Column("present_dn", "Present", "DN", 2)]
    columns += [Column(name, word(name), "DN", 2) for name in estimators]
    notes = [
        "Median of the inliers (3.5 MAD) with bootstrap 95 % interval; n: inliers. Added and present: robust median of "
        "the noise in the patches before and after the 8-bit range clips it. The cell-wise estimator tells what was "
        "added, the others what is present."
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


def _maps(inputs: ReportInputs) -> list[Block]:
    """Local noise over a frame, of every dataset whose stage left maps."""
    found: dict[str, list[tuple[NoiseMaps, str]]] = {}
    for folder in members(inputs.noise, inputs.noise_members):
        said = optional_json(folder, "maps.json")
        if said is None:
            continue
        if not isinstance(said, dict) or not set(said) >= {"dataset", "estimator", "frame", "effects", "level_dn"}:
            raise InputError(
                f"{folder / 'maps.json'}: expected dataset, estimator, frame, effects and level_dn; "
                "run the stage noise again"
            )
        maps = NoiseMaps(said["estimator"], optional_arrays(folder, "maps.npz"), said["effects"], said["level_dn"])
        found.setdefault(said["dataset"], []).append((maps, said["frame"]))
    blocks: list[Block] = []
    for dataset in in_order(found, inputs.datasets):
        if len({(frame, tuple(maps.effects), maps.level_dn) for maps, frame in found[dataset]}) > 1:
            raise InputError(f"noise maps of '{dataset}' show different frames; run the stage noise again for all")
        pairs = sorted(found[dataset], key=lambda pair: pair[0].estimator)
        caption = (
            f"Local noise over a frame of {word(dataset)}. Added: root mean square over 40 px about each cell of 8 px, "
            "before clipping. Found: the estimator's own map. Grey where nothing can be said."
        )
        stages = tuple(STAGE.format(dataset=dataset, estimator=maps.estimator) for maps, _ in pairs)
        drawing = noise_maps_figure.draw([maps for maps, _ in pairs])
        blocks.append(ShownFigure(f"noise_maps_{dataset}", drawing, caption, stages))
    return blocks


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
        blocks += _maps(inputs)
        clipped = noise_patch_tables.saturated(estimates)
        blocks += [noise_patch_tables.patch_errors(estimates), *([clipped] if clipped is not None else [])]
        blocks.append(_abstentions(summary, estimates))
    shown: set[tuple[str, str]] = set()
    for run in runs:
        if not run.ran and (run.dataset, run.line) not in shown:
            shown.add((run.dataset, run.line))
            blocks.append(NotRun(f"Noise estimation on {word(run.dataset)}", run.why, run.line))
    return Section("noise", "Noise estimation", (), blocks, runs)
