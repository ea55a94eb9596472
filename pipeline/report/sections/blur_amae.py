"""Table I of the paper, AMAE of blur estimators: as tables, as curves over the kernel size, beside the paper's best.

Throughout, ``summary`` is a `pipeline.experiments.tables.BLUR_SUMMARY`, ``estimates`` a `BLUR_ESTIMATES`; ``paper`` is
Table I as published: dataset, estimator, blur_kind, kernel_size_px, amae_percent; ``modes``: see `ReportInputs`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from pipeline.camera.mtf import CAMERA, GENERIC_LENS
from pipeline.experiments.condition import SHARP
from pipeline.report import style, tables
from pipeline.report.descriptions import Descriptions
from pipeline.report.display_names import BLURS, DATASETS, ESTIMATORS, in_order, listing, word
from pipeline.report.figures import beside_the_paper
from pipeline.report.inputs import Benchmark, mode_note, relative_mtf
from pipeline.report.spec import Figure, pairs_of
from pipeline.report.tables import Estimate, Row, Table, amae, mean_cell, ordered, pivot, where

ANY_STAGE = "blur@<dataset>-<estimator>"
SHORT = {"defocus": "D", "linear_motion": "L", "nonlinear_motion": "N"}
RELATIVE = {CAMERA: "relative_to_camera", GENERIC_LENS: "relative_to_generic_lens"}
PAGE = Descriptions("blur")
MEAN = "Mean"
OTHER_FRAMES = "Frames differ from the paper's; on Sim they are of another renderer."
UNSEEN_ANSWERS = {
    ("spectral", "raw"): "", ("spectral", "generic_lens"): ", generic lens", ("spectral", "calibrated"): ", calibrated",
    ("spectral", "camera_calibrated"): ", camera-calibrated",
    ("fused", "camera_calibrated"): "", ("pmp", "raw"): "", ("gbb", "raw"): "",
}  # fmt: skip
"""Answers on unseen kernels, in words beside the estimator's; not those of PMP and GBB divided by their own of sharp
frames."""

UNSEEN = Benchmark("unseen_kernels", "python benchmarks/unseen_kernels.py", ("kernels", "results"))
BLUR = ["dataset", "blur_kind", "kernel_size_px"]


def with_paper(summary: pd.DataFrame, paper: pd.DataFrame) -> pd.DataFrame:
    """The summary with the paper's Table I in a column ``paper_percent``, beside raw estimates only.

    Rows of the paper's that did not run are appended for the datasets of the summary, with NaN for ours.
    """
    keys = [*BLUR, "estimator", "calibrated"]
    theirs = paper.rename(columns={"amae_percent": "paper_percent"}).assign(calibrated=False)
    theirs = where(theirs, dataset=list(summary["dataset"])).astype({"kernel_size_px": float})
    return summary.merge(theirs[[*keys, "paper_percent"]], how="outer", on=keys)


def without_unknown_lenses(summary: pd.DataFrame, errors: pd.DataFrame | None = None) -> pd.DataFrame:
    """The summary with sharp frames evaluated against their lens, and left out where that is not known.

    ``errors`` as of `pipeline.experiments.sharp_curves.sharp_errors`.
    """
    blurred = summary[summary["blur_kind"] != SHARP]
    return blurred if errors is None or errors.empty else pd.concat([errors, blurred], ignore_index=True)


def _notes(
    summary: pd.DataFrame, modes: Mapping[str, str], estimators: Sequence[str], is_calibrated: bool
) -> list[str]:
    """What the MTF of the estimators shown is relative to, where that is not the system, and their modes."""
    relative = relative_mtf(summary)
    shown = {name: relative[name] for name in estimators if name in relative}
    notes = [PAGE.text(RELATIVE[to], name=name) for name, to in shown.items() if is_calibrated == (to == CAMERA)]
    return [*notes, *filter(None, [mode_note(modes, estimators)])]


def curves(summary: pd.DataFrame, datasets: Sequence[str], paper: pd.DataFrame) -> style.Drawing:
    """AMAE over the kernel size: datasets down, kinds of blur across.

    A summary without sharp frames, all raw or all calibrated; a dataset without numbers is shown as not run.
    """
    theirs = where(paper.rename(columns={"amae_percent": "paper_amae_percent"}), dataset=list(datasets))
    estimators = in_order([*summary["estimator"], *theirs["estimator"]], ESTIMATORS)
    looks = style.series_looks(estimators, linestyle="-")  # dashes distinguish the paper's curves, not estimators
    top = float(np.nanmax([*summary["amae_percent"], *theirs["paper_amae_percent"], 10.0]))

    means = summary.groupby("estimator", as_index=False)["amae_percent"].agg(["mean", "max"])
    means = ordered(means, estimator=ESTIMATORS)
    shown = ["dataset", "blur_kind", "kernel_size_px", "estimator"]
    values = summary[[*shown, "calibrated", "amae_percent", "low_percent", "high_percent", "count", "abstained"]]
    return PAGE.grid(
        "blur_amae", summary,
        PAGE.alt("blur_amae", means, datasets=listing(word(name) for name in summary["dataset"].unique())), looks,
        down=datasets, across=in_order([*summary["blur_kind"], *theirs["blur_kind"]], BLURS), beside=theirs,
        axes={"xticks": sorted({*summary["kernel_size_px"], *theirs["kernel_size_px"]}), "ylim": (0, 1.04 * top)},
        legend=beside_the_paper(looks, list(summary["estimator"]), not theirs.empty),
        values=values.sort_values(shown).merge(theirs, how="left", on=shown),
    )  # fmt: skip


def stages_of(rows: pd.DataFrame) -> list[str]:
    """The stages that made rows of a table."""
    return [f"blur@{dataset}-{estimator}" for dataset, estimator in sorted(pairs_of(rows))]


def figures(
    summary: pd.DataFrame, datasets: Sequence[str], paper: pd.DataFrame, modes: Mapping[str, str]
) -> list[Figure]:
    """A figure of raw estimates and one of calibrated ones, where there are any."""
    drawn = []
    for is_calibrated, key in ((False, "blur_amae"), (True, "blur_amae_calibrated")):
        selected = summary[(summary["blur_kind"] != SHARP) & (summary["calibrated"] == is_calibrated)]
        if selected.empty:
            continue
        notes = _notes(summary, modes, in_order(selected["estimator"], ESTIMATORS), is_calibrated)
        drawn.append(PAGE.figure(
            "blur_amae", curves(selected, datasets, paper), stages_of(selected), after=" ".join(notes), name=key,
            division=", each estimate divided by the camera's own for sharp frames" if is_calibrated else "",
            not_calibrated=", which is not calibrated" if is_calibrated else "",
        ))  # fmt: skip
    return drawn


def _blur(row: Row) -> str:
    """``"D 3"``, as the paper abbreviates."""
    if row["blur_kind"] in (MEAN, SHARP):
        return MEAN if row["blur_kind"] == MEAN else "None (sharp)"
    return f"{SHORT.get(row['blur_kind'], word(row['blur_kind']))} {tables.format_number(row['kernel_size_px'])}"


def tables_one(
    dataset: str, summary: pd.DataFrame, paper: pd.DataFrame, modes: Mapping[str, str] | None = None
) -> list[Table]:
    """Table I of one dataset, of raw and of calibrated estimates, where there are any; arguments of `table_one`."""
    known = where(summary, dataset=dataset)["calibrated"].unique()
    return [table_one(dataset, summary, paper, is_calibrated, modes) for is_calibrated in sorted(known)]


def table_one(
    dataset: str,
    summary: pd.DataFrame,
    paper: pd.DataFrame,
    is_calibrated: bool,
    modes: Mapping[str, str] | None = None,
) -> Table:
    """Table I of one dataset: a row for each kind and size of blur, a column for each estimator, and their means.

    The paper's numbers stand beside raw estimates, which are what it prints.
    """
    cells = where(with_paper(where(summary, dataset=dataset), paper), calibrated=is_calibrated)
    cells = ordered(cells, blur_kind=[SHARP, *BLURS], kernel_size_px=())
    cells = cells[cells["blur_kind"] != SHARP] if is_calibrated else cells
    estimators = in_order(cells["estimator"], ESTIMATORS)
    rows = pivot(cells, ["blur_kind", "kernel_size_px"], "estimator", amae)
    blurred = [row for row in rows if row["blur_kind"] != SHARP]
    means = {name: mean_cell([row[name] for row in blurred if name in row], complete=False) for name in estimators}
    rows.append({"blur_kind": MEAN, **{name: cell for name, cell in means.items() if cell is not None}})

    def best(row: Row) -> str:
        cells = {name: cell for name in estimators if isinstance(cell := row.get(name), Estimate)}
        known = {name: cell.value for name, cell in cells.items() if math.isfinite(cell.value)}
        return word(min(known, key=lambda name: known[name])) if len(known) > 1 else ""

    also = ["sharp"] if (cells["blur_kind"] == SHARP).any() else []
    notes = _notes(summary, modes or {}, estimators, is_calibrated)
    if cells["paper_percent"].notna().any():
        notes.append(PAGE.text("paper_sim" if dataset == "sim" else "paper"))
    return PAGE.table(
        "table_one", rows, cells={"blur": _blur, "best": best}, across=PAGE.headings("table_one", estimators),
        also=[*also, *(["calibrated"] if is_calibrated else [])], notes=notes, dataset=dataset,
        suffix="_calibrated" if is_calibrated else "", how=", calibrated" if is_calibrated else "",
    )  # fmt: skip


def beside_the_best(summary: pd.DataFrame, paper: pd.DataFrame, frames: str = OTHER_FRAMES) -> Table | None:
    """Estimators of this project beside the paper's CNN and the best of its three, per dataset and blur.

    ``frames`` states how ours differ from the paper's. None where no dataset of the paper ran.
    """
    theirs = paper.pivot(index=BLUR, columns="estimator", values="amae_percent")
    ours = in_order(set(summary["estimator"]) - set(theirs.columns), ESTIMATORS)
    best = {"cnn": theirs["cnn"], "best": theirs.min(axis=1), "which": theirs.idxmin(axis=1).map(ESTIMATORS)}
    blurred = summary[(summary["blur_kind"] != SHARP) & summary["estimator"].isin(ours)]
    blurred = ordered(blurred, dataset=DATASETS, blur_kind=BLURS, kernel_size_px=())
    blurred = blurred.merge(pd.DataFrame(best).reset_index(), on=BLUR)
    if blurred.empty:
        return None
    calibrated = blurred["calibrated"].astype(bool)
    both = calibrated & blurred["estimator"].isin(blurred.loc[~calibrated, "estimator"])
    blurred = blurred.assign(column=blurred["estimator"] + np.where(both, "_calibrated", ""))
    rows: list[dict[str, Any]] = []
    for dataset, group in blurred.groupby("dataset", sort=False):
        selected = pivot(group, [*BLUR, *best], "column", amae)
        means = {name: mean_cell([row.get(name) for row in selected]) for name in selected[0] if name not in BLUR}
        rows += [*selected, {**means, "dataset": dataset, "blur_kind": MEAN}]
    titles = {
        f"{name}{after}": word(name) + how
        for name in ours
        for after, how in (("", ""), ("_calibrated", ", calibrated"))
    }
    across = {key: title for key, title in titles.items() if any(row.get(key) is not None for row in rows)}
    return PAGE.table("blur_beside_the_best", rows, cells={"blur": _blur}, across=across, frames=frames)


def abstentions(summary: pd.DataFrame, estimates: pd.DataFrame) -> Table:
    """Abstentions with their reasons, error of a single patch, and coverage of the intervals."""
    # An estimator that is calibrated to its camera has calibrated estimates only.
    calibrated_only = summary.groupby(["dataset", "estimator"])["calibrated"].transform("all")
    raw = summary[~summary["calibrated"] | calibrated_only]
    raw = ordered(raw, dataset=raw["dataset"].unique(), estimator=ESTIMATORS)
    measured = ["patch_error_percent", "coverage"]
    raw = raw.assign(**raw[measured].where(raw["blur_kind"] != SHARP))
    rows = tables.totals(raw, ["dataset", "estimator"], *measured)
    patch = ["dataset", "estimator", "kernel", "frame", "patch"]
    refused = estimates[estimates["abstained"]].drop_duplicates(patch)
    cells = {"coverage_percent": lambda row: 100 * row["coverage"], "reasons": tables.reasons_of(refused)}
    return PAGE.table("blur_abstentions", rows, cells=cells)


def unseen_kernels(record: Mapping[str, Any]) -> Table:
    """AMAE of rendered optics that no network was trained on, as the benchmark `UNSEEN` recorded it."""
    results = record["results"]
    rows = []
    for dataset in in_order(results, DATASETS):
        parts = results[dataset], results[dataset].get("few", {})
        for part, ((name, answer), how) in itertools.product(parts, UNSEEN_ANSWERS.items()):
            result = part.get(name, {}).get(answer)
            if result is not None:
                head = {"dataset": dataset, "estimator": word(name) + how, "patches": part["patches"]}
                ends = dict(zip(("mean_low", "mean_high"), result["mean_interval_percent"], strict=True))
                rows.append({**head, **result["mean_of_group_percent"], "mean": result["mean_amae_percent"], **ends})
    return PAGE.table("blur_unseen_kernels", rows, count=len(record["kernels"]), command=UNSEEN.command)
