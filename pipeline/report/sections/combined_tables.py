"""Tables of blur and noise at once: AMAE over kernel and level, and the supplement's denoising before estimation."""

from __future__ import annotations

from typing import Any

import pandas as pd

from pipeline.grouped_statistics import weighted_mean
from pipeline.report.descriptions import Descriptions
from pipeline.report.display_names import DATASETS, ESTIMATORS, EXPERIMENTS, word
from pipeline.report.tables import Cell, Row, Table, amae, estimate, format_number, mean_cell, ordered, pivot, where

PAGE = Descriptions("combined")
STAGE = "combined@{dataset}"
DENOISED_STAGE = "denoised_blur@{dataset}"
PAPERS_DATASET = "udacity"
OURS_FIRST = ["spectral", *(name for name in ESTIMATORS if name != "spectral")]
VARIANT = ["estimator", "filter_px", "calibrated"]


def _variant(row: Row) -> str:
    how = "calibrated" if row["calibrated"] else "raw"
    return f"{how}, smoothed {row['filter_px']:g} px" if row["filter_px"] else how


def _level(target_sigma_dn: float) -> str:
    return f"level_{target_sigma_dn:g}"


def _level_columns(cells: pd.DataFrame) -> dict[str, str]:
    return {_level(level): f"{level:g} DN" for level in sorted(set(cells["target_sigma_dn"]))}


def _shown(cells: pd.DataFrame, *by: str) -> pd.DataFrame:
    """Raw and calibrated estimates, and raw ones with each disc that smoothed any patch (of the same group)."""
    smoothed = (cells["smoothed_fraction"] > 0).groupby([cells[name] for name in (*by, "filter_px")]).transform("any")
    return cells[(cells["filter_px"] == 0) | (~cells["calibrated"] & smoothed)]


def error(dataset: str, experiment: str, cells: pd.DataFrame, paper: pd.DataFrame | None = None) -> Table:
    """AMAE of one dataset and experiment: a row per estimator, variant and kernel size, a column per level, and means.

    Args:
        dataset: name.
        experiment: name.
        cells: `pipeline.experiments.tables.BLUR_CELLS`.
        paper: columns sigma_dn, size_px, amae_percent: its CNN on Udacity, beside raw estimates of the first estimator.
    """
    selected = where(cells, dataset=dataset, experiment=experiment)
    levels = _level_columns(selected)
    selected = ordered(
        _shown(selected, "estimator"), estimator=OURS_FIRST, filter_px=(), calibrated=(), kernel_size_px=()
    )
    if paper is not None and len(selected):
        theirs = paper.rename(columns={"sigma_dn": "target_sigma_dn", "amae_percent": "paper_percent"})
        theirs = theirs[["target_sigma_dn", "kernel_size_px", "paper_percent"]].astype(float)
        theirs = theirs.assign(estimator=selected["estimator"].iloc[0], filter_px=0.0, calibrated=False)
        selected = selected.merge(theirs, how="left", on=[*VARIANT, "target_sigma_dn", "kernel_size_px"])
    rows: list[dict[str, Any]] = []
    for _, group in selected.groupby(VARIANT, sort=False):
        lines = pivot(group, [*VARIANT, "kernel_size_px"], "target_sigma_dn", amae, _level)
        complete = [name for name in levels if all(name in line for line in lines)]
        means = {name: mean_cell([line[name] for line in lines]) for name in complete}
        rows += [*lines, {**lines[0], **dict.fromkeys(levels), **means, "kernel_size_px": None}]
    cells_of = {
        "variant": _variant,
        "size": lambda row: "Mean" if row["kernel_size_px"] is None else _number(row["kernel_size_px"]),
    }
    beside = [] if paper is None else ["paper" if dataset == PAPERS_DATASET else "paper_elsewhere"]
    return PAGE.table("error", rows, cells=cells_of, across=levels, also=beside, dataset=dataset, experiment=experiment)


def _number(value: float) -> str:
    return format_number(float(value))


def overview(cells: pd.DataFrame) -> Table:
    """Every estimator's error over the noise level, mean over kernel sizes: a row per dataset, experiment and variant.

    Args:
        cells: `pipeline.experiments.tables.BLUR_CELLS`.
    """
    index = ["dataset", "experiment", *VARIANT]
    shown = _shown(cells, "dataset", "experiment", "estimator")
    shown = ordered(
        shown, dataset=DATASETS, experiment=EXPERIMENTS, estimator=OURS_FIRST, filter_px=(), calibrated=()
    )  # fmt: skip
    sizes = shown.groupby(index)["kernel_size_px"].unique()
    means = shown.groupby([*index, "target_sigma_dn"], sort=False, as_index=False)[["amae_percent"]].mean()
    rows = pivot(means, index, "target_sigma_dn", lambda row: float(row["amae_percent"]), _level)

    def mean_over(row: Row) -> str:
        return ", ".join(_number(size) for size in sorted(sizes[tuple(row[name] for name in index)]))

    return PAGE.table(
        "combined_overview", rows, cells={"variant": _variant, "sizes": mean_over}, across=_level_columns(cells)
    )


def denoised(dataset: str, cells: pd.DataFrame, paper: pd.DataFrame) -> Table:
    """The supplement's table: blur d1, noise, disc d2; as it is, smoothed, and as propagation of errors predicts.

    Args:
        dataset: name.
        cells: `pipeline.experiments.tables.BLUR_CELLS` of the stage `denoised_blur`.
        paper: columns d2_px, d1_px, sigma_dn, mae_h_percent, mae_v_percent, amae_percent, expected_amae_percent.
    """
    selected = cells[(cells["dataset"] == dataset) & (cells["target_sigma_dn"] > 0)]
    selected = selected.sort_values(["estimator", "filter_px", "kernel_size_px", "target_sigma_dn", "calibrated"])
    errors = ["mae_h_percent", "mae_v_percent", "amae_percent", "expected_amae_percent"]
    theirs = paper.rename(columns={"d2_px": "filter_px", "d1_px": "kernel_size_px", "sigma_dn": "target_sigma_dn"})
    keys = ["filter_px", "kernel_size_px", "target_sigma_dn"]
    theirs = theirs[[*keys, *errors]].astype(float).rename(columns={name: f"paper_{name}" for name in errors})
    selected = selected.merge(theirs.assign(calibrated=False), how="left", on=[*keys, "calibrated"])
    expected = estimate("expected_amae_percent", "", "", "", "paper_expected_amae_percent")
    made = {
        "estimator": lambda row: word(str(row["estimator"])) + (", calibrated" if row["calibrated"] else ""),
        "filter": lambda row: _number(row["filter_px"]) if row["filter_px"] else "none",
        "size": lambda row: _number(row["kernel_size_px"]),
        "level": lambda row: _number(row["target_sigma_dn"]),
        "expected": lambda row: expected(row) if row["filter_px"] else None,
    }
    return PAGE.table("denoised", selected, cells=made, dataset=dataset)


def abstentions(blur: pd.DataFrame, noise: pd.DataFrame) -> Table:
    """Abstentions of each estimator, error of a single patch, and coverage of the intervals.

    Args:
        blur: `pipeline.experiments.tables.BLUR_CELLS`.
        noise: `pipeline.experiments.tables.NOISE_CELLS`.
    """
    rows: list[dict[str, Any]] = []
    keys = ["dataset", "experiment", "estimator", "filter_px"]
    for cells, error_name in ((blur[~blur["calibrated"]], "patch_error_percent"), (noise, "patch_error_dn")):
        cells = cells if "filter_px" in cells else cells.assign(filter_px=0.0, smoothed_fraction=0.0)
        for key, group in cells.groupby(keys, sort=False):
            if key[3] == 0 or group["smoothed_fraction"].any():
                error_of: dict[str, Cell] = {error_name: weighted_mean(group, error_name)}
                totals = {name: int(group[name].sum()) for name in ("count", "abstained")}
                coverage = 100 * weighted_mean(group, "coverage")
                rows.append(dict(zip(keys, key, strict=True)) | error_of | totals | {"coverage": coverage})

    def estimator(row: Row) -> str:
        return word(row["estimator"]) + (f", smoothed {row['filter_px']:g} px" if row["filter_px"] else "")

    made = {"estimator": estimator, "asked": lambda row: row["count"] + row["abstained"]}
    return PAGE.table("combined_abstentions", rows, cells=made)
