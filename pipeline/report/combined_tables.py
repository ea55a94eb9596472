"""Tables of blur and noise at once: AMAE over kernel and level, and the supplement's smoothing before estimating."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from pipeline.report.estimates import of_amae
from pipeline.report.inputs import records
from pipeline.report.tables import Cell, Column, Estimate, Table, format_number
from pipeline.report.wording import DATASETS, ESTIMATORS, EXPERIMENTS, in_order, word

if TYPE_CHECKING:
    import pandas as pd

STAGE = "combined@{dataset}"
DENOISED_STAGE = "denoised_blur@{dataset}"
PAPERS_DATASET = "udacity"
ORDER = ["spectral", *(name for name in ESTIMATORS if name != "spectral")]
"""Of blur estimators: ours first."""

Published = Mapping[tuple[float, float], float]  # level in DN and size in px -> AMAE in percent


def _way(is_calibrated: bool, filter_px: float) -> str:
    how = "calibrated" if is_calibrated else "raw"
    return f"{how}, smoothed {filter_px:g} px" if filter_px else how


def amae(dataset: str, experiment: str, cells: pd.DataFrame, published: Published | None = None) -> Table:
    """AMAE of one dataset and experiment: a row for each estimator, way and kernel size, a column for each level.

    Args:
        dataset: name.
        experiment: name.
        cells: `pipeline.condition.combined_tables.BLUR_CELLS`.
        published: the paper's, for its CNN on Udacity; shown beside the raw answers of the first estimator.
    """
    own = cells[(cells["dataset"] == dataset) & (cells["experiment"] == experiment)]
    levels = sorted(set(own["level_dn"]))
    estimators = in_order(own["estimator"], ORDER)
    rows: list[dict[str, Cell]] = []
    for estimator in estimators:
        of_one = own[own["estimator"] == estimator]
        for is_calibrated, filter_px in _ways(of_one):
            here = of_one[(of_one["calibrated"] == is_calibrated) & (of_one["filter_px"] == filter_px)]
            theirs = published if estimator == estimators[0] and not is_calibrated and not filter_px else None
            head: dict[str, Cell] = {"estimator": word(estimator), "way": _way(is_calibrated, filter_px)}
            lines: list[dict[str, Cell]] = []
            for size in sorted(set(here["size_px"])):
                line: dict[str, Cell] = {**head, "size": format_number(size)}
                for row in records(here[here["size_px"] == size]):
                    reference = (theirs or {}).get((float(row["level_dn"]), float(size)))
                    line[_level(row["level_dn"])] = of_amae(row, reference)
                lines.append(line)
            rows += [*lines, {**head, "size": "Mean", **_means(lines, levels)}]
    columns = [Column("estimator", "Estimator"), Column("way", "Answer"), Column("size", "Blur", "px")]
    columns += [Column(_level(level), f"{level:g} DN", "%", 1) for level in levels]
    notes = [
        "AMAE of the robust median over patches, averaged over rotations, with bootstrap 95 % interval; n: patches "
        "with an answer, over all rotations. Calibrated: divided by the same camera's answer for its own sharp frames "
        "without noise. Smoothed: patches read as noisy are smoothed by a disc before, and the disc's MTF is divided "
        "out after; frequencies at which it leaves too little are left out of the error."
    ]
    if published:
        notes.append("Paper: its CNN on Udacity" + (".", ", beside ours on other frames.")[dataset != PAPERS_DATASET])
    caption = f"{word(experiment)} on {word(dataset)}: error of the MTF."
    return Table(f"combined_{experiment}_{dataset}", caption, columns, rows, notes, STAGE.format(dataset=dataset))


def overview(cells: pd.DataFrame) -> Table:
    """Every estimator's error over the noise level, mean over the sizes it ran on: one row per dataset and experiment.

    Args:
        cells: `pipeline.condition.combined_tables.BLUR_CELLS`.
    """
    levels = sorted(set(cells["level_dn"]))
    rows: list[dict[str, Cell]] = []
    for dataset in in_order(cells["dataset"], DATASETS):
        for experiment in in_order(cells["experiment"], EXPERIMENTS):
            here = cells[(cells["dataset"] == dataset) & (cells["experiment"] == experiment)]
            for estimator in in_order(here["estimator"], ORDER):
                of_one = here[here["estimator"] == estimator]
                for is_calibrated, filter_px in _ways(of_one):
                    own = of_one[(of_one["calibrated"] == is_calibrated) & (of_one["filter_px"] == filter_px)]
                    sizes = [format_number(size) for size in sorted(set(own["size_px"]))]
                    means = own.groupby("level_dn")["amae_percent"].mean()
                    rows.append(
                        {
                            "dataset": word(dataset),
                            "experiment": word(experiment),
                            "estimator": word(estimator),
                            "way": _way(is_calibrated, filter_px),
                            "sizes": ", ".join(sizes),
                            **{_level(level): float(means[level]) for level in levels if level in means.index},
                        }
                    )
    columns = [Column("dataset", "Dataset"), Column("experiment", "Experiment"), Column("estimator", "Estimator")]
    columns += [Column("way", "Answer"), Column("sizes", "Mean over", "px")]
    columns += [Column(_level(level), f"{level:g} DN", "%", 1) for level in levels]
    notes = ("Set side by side what ran on the same sizes only. The tables below have each size with its interval.",)
    caption = "Blur and noise at once: mean AMAE over the noise level."
    return Table("combined_overview", caption, columns, rows, notes, STAGE.format(dataset="<dataset>"))


def _ways(cells: pd.DataFrame) -> list[tuple[bool, float]]:
    """Raw, calibrated, and raw with each disc that smoothed any patch, of one estimator's cells."""
    pairs = {(bool(way), float(disc)) for way, disc in zip(cells["calibrated"], cells["filter_px"], strict=True)}
    smoothed = set(cells.loc[cells["smoothed_share"] > 0, "filter_px"])
    return sorted(
        (pair for pair in pairs if pair[1] == 0 or (not pair[0] and pair[1] in smoothed)),
        key=lambda pair: (pair[1], pair[0]),
    )


def _level(level_dn: float) -> str:
    return f"level_{level_dn:g}"


def _means(lines: list[dict[str, Cell]], levels: list[float]) -> dict[str, Cell]:
    """Mean over the sizes of every level that all of them have, the paper's beside it."""
    means: dict[str, Cell] = {}
    for level in levels:
        cells = [cell for line in lines if isinstance(cell := line.get(_level(level)), Estimate)]
        if len(cells) < len(lines) or not all(math.isfinite(cell.value) for cell in cells):
            continue
        paper = [cell.reference for cell in cells if cell.reference is not None]
        reference = float(np.mean(paper)) if len(paper) == len(cells) else None
        means[_level(level)] = Estimate(float(np.mean([cell.value for cell in cells])), reference=reference)
    return means


def published_photon_defocus(table: pd.DataFrame | None) -> dict[tuple[float, float], float]:
    """The paper's AMAE of defocus in the presence of photon noise.

    Args:
        table: columns sigma_dn, size_px, amae_percent; None for none.
    """
    rows = [] if table is None else records(table)
    return {(float(row["sigma_dn"]), float(row["size_px"])): float(row["amae_percent"]) for row in rows}


def denoised(dataset: str, cells: pd.DataFrame, published: pd.DataFrame | None) -> Table:
    """The supplement's table: blur d1, noise, disc d2; as it is, smoothed, and what propagation of errors expects.

    Args:
        dataset: name.
        cells: `pipeline.condition.combined_tables.BLUR_CELLS` of the stage `denoised_blur`.
        published: columns d2_px, d1_px, sigma_dn, mae_h_percent, mae_v_percent, amae_percent, expected_amae_percent.
    """
    own = cells[(cells["dataset"] == dataset) & (cells["level_dn"] > 0)]
    paper = {
        (float(row["d2_px"]), float(row["d1_px"]), float(row["sigma_dn"])): row
        for row in (records(published) if published is not None else [])
    }
    rows: list[dict[str, Cell]] = []
    order = ["estimator", "filter_px", "size_px", "level_dn", "calibrated"]
    for row in records(own.sort_values(order)):
        theirs = paper.get((float(row["filter_px"]), float(row["size_px"]), float(row["level_dn"])), {})
        theirs = {} if row["calibrated"] else theirs
        rows.append(
            {
                "estimator": word(str(row["estimator"])) + (", calibrated" if row["calibrated"] else ""),
                "filter": format_number(row["filter_px"]) if row["filter_px"] else "none",
                "size": format_number(row["size_px"]),
                "level": format_number(row["level_dn"]),
                "h": Estimate(row["mae_h_percent"], reference=theirs.get("mae_h_percent")),
                "v": Estimate(row["mae_v_percent"], reference=theirs.get("mae_v_percent")),
                "amae": of_amae(row, theirs.get("amae_percent")),
                "expected": Estimate(row["expected_amae_percent"], reference=theirs.get("expected_amae_percent"))
                if row["filter_px"]
                else None,
                "frequencies": 100 * row["frequencies_share"],
            }
        )
    columns = [
        Column("estimator", "Estimator"),
        Column("filter", "d₂", "px"),
        Column("size", "d₁", "px"),
        Column("level", "σ", "DN"),
        Column("h", "MAE, horizontal", "%", 1),
        Column("v", "MAE, vertical", "%", 1),
        Column("amae", "AMAE", "%", 1),
        Column("expected", "Expected", "%", 1),
        Column("frequencies", "Frequencies answered", "%", 0),
    ]
    notes = (
        "d₁: linear motion; σ: dark-current noise after it; d₂: the smoothing disc, none for patches as they are. "
        "Expected: root of the sum of squares of the errors for d₁ and for d₂ without noise. Frequencies at which the "
        "disc leaves too little are left out of the error.",
        "Smoothed noise falls off as the disc's own MTF does. Read as the picture, it gives an MTF of 1 after the "
        "division: nearly right for a blur of 3 px, wrong for a larger one.",
        "Paper: its CNN on Udacity, on other frames.",
    )
    caption = f"Improved blur estimation under noise on {word(dataset)} (supplement)."
    return Table(f"denoised_blur_{dataset}", caption, columns, rows, notes, DENOISED_STAGE.format(dataset=dataset))


def abstentions(blur: pd.DataFrame, noise: pd.DataFrame) -> Table:
    """How often each estimator abstained, the error of a single patch, and how often an interval held the truth.

    Args:
        blur: `pipeline.condition.combined_tables.BLUR_CELLS`.
        noise: `pipeline.condition.combined_tables.NOISE_CELLS`.
    """
    rows: list[dict[str, Cell]] = []
    raw = blur[~blur["calibrated"]]
    for (dataset, experiment, estimator, filter_px), group in raw.groupby(
        ["dataset", "experiment", "estimator", "filter_px"], sort=False
    ):
        if filter_px == 0 or group["smoothed_share"].any():
            way = f", smoothed {filter_px:g} px" if filter_px else ""
            rows.append(_reliability(dataset, experiment, f"{word(str(estimator))}{way}", group, "patch_error_percent"))
    for (dataset, experiment, estimator), group in noise.groupby(["dataset", "experiment", "estimator"], sort=False):
        rows.append(_reliability(dataset, experiment, word(str(estimator)), group, "patch_error_dn"))
    columns = [
        Column("dataset", "Dataset"),
        Column("experiment", "Experiment"),
        Column("estimator", "Estimator"),
        Column("asked", "Patches asked about"),
        Column("abstained", "Abstained"),
        Column("patch_error_percent", "MTF of a single patch: error", "%", 1),
        Column("patch_error_dn", "σ of a single patch: error", "DN", 2),
        Column("coverage", "Truths within the 95 % interval", "%", 0),
    ]
    notes = (
        "Over all sizes, rotations and levels, uncalibrated. σ is set against the noise as added, photon noise as the "
        "optics pass it on. An en dash: the estimator gives no interval.",
    )
    caption = "Blur and noise at once: abstentions, single-patch errors, intervals."
    return Table("combined_abstentions", caption, columns, rows, notes, STAGE.format(dataset="<dataset>"))


def _reliability(
    dataset: object, experiment: object, estimator: str, group: pd.DataFrame, error: str
) -> dict[str, Cell]:
    return {
        "dataset": word(str(dataset)),
        "experiment": word(str(experiment)),
        "estimator": estimator,
        "asked": int(group["count"].sum() + group["abstained"].sum()),
        "abstained": int(group["abstained"].sum()),
        error: _weighted(group, error),
        "coverage": 100 * _weighted(group, "coverage"),
    }


def _weighted(rows: pd.DataFrame, name: str) -> float:
    """Mean over cells weighted by their patches; NaN where no cell has a number."""
    known = rows[np.isfinite(rows[name].to_numpy(float)) & (rows["count"].to_numpy() > 0)]
    return float(np.average(known[name], weights=known["count"])) if len(known) else math.nan
