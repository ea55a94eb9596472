"""Tables of the noise chapter that look at single patches: error, intervals, abstentions, saturated patches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipeline.noise.evaluation import coverage
from pipeline.report.estimates import bootstrapped
from pipeline.report.inputs import records
from pipeline.report.tables import Cell, Column, Estimate, Table
from pipeline.report.wording import DATASETS, EFFECTS, ESTIMATORS, in_order, word
from pipeline.streams import stream

if TYPE_CHECKING:
    import pandas as pd

STAGE = "noise@<dataset>-<estimator>"
SATURATED = 0.8
"""Share of black or white pixels in the sharp frame beyond which a patch counts as saturated in the report."""


def _by_frame(values: pd.Series, estimates: pd.DataFrame, *key: str) -> Estimate:
    """Mean over patches, with a bootstrap interval over frames, whose patches err together."""
    known = values.notna()
    count = int(known.sum())
    if not count:
        return Estimate(float("nan"), count=0)
    frames = values[known].groupby(estimates.loc[known, "frame"])
    sums, sizes = frames.sum().to_numpy(float), frames.size().to_numpy(float)

    def mean(places: np.ndarray, axis: int = -1) -> np.ndarray:
        chosen = places.astype(int)
        return np.asarray(sums[chosen].sum(axis=axis) / sizes[chosen].sum(axis=axis))

    generator = stream(0, "report", "noise patches", *key)
    return bootstrapped(float(values[known].mean()), np.arange(len(sums)), count, generator, mean)


def _cells(estimates: pd.DataFrame) -> list[tuple[str, str, str]]:
    """Dataset, estimator and effect of every part, in the report's order."""
    found = {(row["dataset"], row["estimator"], row["effect"]) for row in records(
        estimates[["dataset", "estimator", "effect"]].drop_duplicates()
    )}  # fmt: skip
    return [
        (dataset, estimator, effect)
        for dataset in in_order((key[0] for key in found), DATASETS)
        for estimator in in_order((key[1] for key in found), ESTIMATORS)
        for effect in in_order((key[2] for key in found), EFFECTS)
        if (dataset, estimator, effect) in found
    ]


def patch_errors(estimates: pd.DataFrame) -> Table:
    """Error of single patches against both truths, coverage of the intervals, abstentions.

    Args:
        estimates: `pipeline.tables.NOISE_ESTIMATES`.
    """
    rows: list[dict[str, Cell]] = []
    for dataset, estimator, effect in _cells(estimates):
        own = estimates[
            (estimates["dataset"] == dataset) & (estimates["estimator"] == estimator) & (estimates["effect"] == effect)
        ]
        key = (dataset, estimator, effect)
        held = 100.0 * coverage(own)
        clean = own["level_dn"] == 0
        present = (own["sigma_dn"] - own["true_sigma_dn"]).abs()
        added = (own["sigma_dn"] - own["added_sigma_dn"]).abs()
        row: dict[str, Cell] = {
            "dataset": word(dataset),
            "estimator": word(estimator),
            "effect": word(effect),
            "present_dn": _by_frame(present, own, *key, "present"),
            "added_dn": _by_frame(added, own, *key, "added"),
            "abstained_percent": 100.0 * float(own["abstained"].mean()),
        }
        if held.notna().any():
            row["coverage_percent"] = _by_frame(held.mask(clean), own, *key, "coverage")
            row["clean_percent"] = _by_frame(held.where(clean), own, *key, "clean")
            row["width_dn"] = float((own["high_dn"] - own["low_dn"]).median())
        rows.append(row)
    columns = [
        Column("dataset", "Dataset"),
        Column("estimator", "Estimator"),
        Column("effect", "Effect"),
        Column("present_dn", "Error, noise present", "DN", 2),
        Column("added_dn", "Error, noise added", "DN", 2),
        Column("coverage_percent", "Interval holds the noise added", "%", 1),
        Column("clean_percent", "The same where none was added", "%", 1),
        Column("width_dn", "Median width of the interval", "DN", 2),
        Column("abstained_percent", "Abstained", "%", 2),
    ]
    notes = (
        "Over all levels and patches. Error: mean distance of a patch's estimate to the standard deviation of the "
        "noise in this very patch, after the 8-bit range has cut it (present) and as the sensor added it (added). "
        "PCA, B+F and their kin tell what is present; the cell-wise estimator tells what was added. Intervals are "
        "nominally 95 %; an estimator without them has empty cells. Photographs that nothing was added to have noise "
        "of their own, which counts against the interval there. In brackets: bootstrap 95 % interval over frames.",
    )
    return Table("noise_patches", "Noise of single patches.", columns, rows, notes, STAGE)


def saturated(estimates: pd.DataFrame) -> Table | None:
    """What estimators say at the highest level in patches that are nearly all black or white; None without such.

    Args:
        estimates: `pipeline.tables.NOISE_ESTIMATES`.
    """
    chosen = estimates[estimates["saturated_share"] > SATURATED]
    if chosen.empty:
        return None
    level = float(chosen["level_dn"].max())
    chosen = chosen[chosen["level_dn"] == level]
    rows: list[dict[str, Cell]] = []
    estimators = in_order(chosen["estimator"], ESTIMATORS)
    for dataset in in_order(chosen["dataset"], DATASETS):
        for effect in in_order(chosen.loc[chosen["dataset"] == dataset, "effect"], EFFECTS):
            here = chosen[(chosen["dataset"] == dataset) & (chosen["effect"] == effect)]
            one = here[here["estimator"] == here["estimator"].iloc[0]]
            row: dict[str, Cell] = {
                "dataset": word(dataset),
                "effect": word(effect),
                "patches": len(one),
                "added_dn": float(one["added_sigma_dn"].median()),
                "present_dn": float(one["true_sigma_dn"].median()),
            }
            for name in estimators:
                told = here.loc[(here["estimator"] == name) & ~here["abstained"], "sigma_dn"].to_numpy(float)
                value = float(np.median(told)) if told.size else float("nan")
                generator = stream(0, "report", "saturated", dataset, effect, name)
                row[name] = bootstrapped(value, told, len(told), generator)
            rows.append(row)
    columns = [
        Column("dataset", "Dataset"),
        Column("effect", "Effect"),
        Column("patches", "Patches"),
        Column("added_dn", "Added", "DN", 2),
        Column("present_dn", "Present", "DN", 2),
        *(Column(name, word(name), "DN", 2) for name in estimators),
    ]
    caption = f"Saturated patches at {level:g} DN: more than {100 * SATURATED:.0f} % black or white when sharp."
    notes = (
        "Medians over these patches with bootstrap 95 % interval; n: patches that were not abstained from. Clipping "
        "takes half of the noise: what is present is less than what was added.",
    )
    return Table("noise_saturated", caption, columns, rows, notes, STAGE)
