"""Table I of the paper, AMAE of blur estimators: as tables, as curves over the kernel size, beside the paper's best."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.camera.mtf import CAMERA, GENERIC_LENS
from pipeline.experiments.condition import SHARP
from pipeline.grouped_statistics import weighted_mean
from pipeline.report import style
from pipeline.report.descriptions import Descriptions
from pipeline.report.display_names import BLURS, DATASETS, ESTIMATORS, in_order, listing, word
from pipeline.report.figures import PAPER, Facet, beside_the_paper, lines, small_multiples
from pipeline.report.inputs import mode_note
from pipeline.report.spec import Block
from pipeline.report.style import Drawing
from pipeline.report.tables import Estimate, Row, Table, amae, format_number, mean_cell, ordered, pivot, records

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

STAGE = "blur@{dataset}-{estimator}"
ANY_STAGE = "blur@<dataset>-<estimator>"
SHORT = {"defocus": "D", "linear_motion": "L", "nonlinear_motion": "N"}
RELATIVE = {CAMERA: "relative_to_camera", GENERIC_LENS: "relative_to_generic_lens"}
PAGE = Descriptions("blur")
MEAN = "Mean"
OTHER_FRAMES = "Frames differ from the paper's; on Sim they are of another renderer."
KEYS = ["dataset", "estimator", "blur_kind", "kernel_size_px"]


def with_paper(summary: pd.DataFrame, paper: pd.DataFrame | None) -> pd.DataFrame:
    """The summary with the paper's Table I in a column ``paper_percent``, beside raw estimates only.

    Args:
        summary: `pipeline.experiments.tables.BLUR_SUMMARY`.
        paper: columns dataset, estimator, blur, size_px, amae_percent; rows that did not run are appended for the
            summary's datasets, with NaN for ours.
    """
    if paper is None:
        return summary.assign(paper_percent=math.nan)
    theirs = paper.rename(columns={"amae_percent": "paper_percent"}).assign(calibrated=False)
    theirs = theirs[theirs["dataset"].isin(summary["dataset"])].astype({"kernel_size_px": float})
    return summary.merge(theirs[[*KEYS, "calibrated", "paper_percent"]], how="outer", on=[*KEYS, "calibrated"])


def without_unknown_lenses(summary: pd.DataFrame, errors: pd.DataFrame | None = None) -> pd.DataFrame:
    """The summary with sharp frames evaluated against their lens, and left out where that is not known.

    Args:
        summary: `pipeline.experiments.tables.BLUR_SUMMARY`.
        errors: `pipeline.experiments.sharp_curves.sharp_errors`.
    """
    import pandas as pd

    blurred = summary[summary["blur_kind"] != SHARP]
    return blurred if errors is None or errors.empty else pd.concat([errors, blurred], ignore_index=True)


def _notes(relative: Mapping[str, str], estimators: Sequence[str], is_calibrated: bool) -> list[str]:
    """What the MTF of the estimators shown is relative to, where that is not the system."""
    shown = {name: relative[name] for name in estimators if name in relative}
    return [PAGE.text(RELATIVE[to], name=name) for name, to in shown.items() if is_calibrated == (to == CAMERA)]


@style.styled
def curves(summary: pd.DataFrame, datasets: Sequence[str], paper: pd.DataFrame | None = None) -> Drawing:
    """AMAE over the kernel size: datasets down, kinds of blur across.

    Args:
        summary: `pipeline.experiments.tables.BLUR_SUMMARY`, without sharp frames, all raw or all calibrated.
        datasets: rows of the figure; one without numbers is shown as not run.
        paper: columns dataset, estimator, blur, size_px, amae_percent: Table I.
    """
    import pandas as pd

    columns = ["dataset", "estimator", "blur_kind", "kernel_size_px", "paper_amae_percent"]
    theirs = pd.DataFrame({name: [] for name in columns})
    if paper is not None:
        theirs = paper.rename(columns={"amae_percent": "paper_amae_percent"})
        theirs = theirs[theirs["dataset"].isin(list(datasets))]
    kinds = in_order([*summary["blur_kind"], *theirs["blur_kind"]], BLURS)
    estimators = in_order([*summary["estimator"], *theirs["estimator"]], ESTIMATORS)
    looks = style.series_looks(estimators, linestyle="-")  # dashes distinguish the paper's curves, not estimators
    top = float(np.nanmax([*summary["amae_percent"], *theirs["paper_amae_percent"], 10.0]))

    def panel(axes: Axes, rows: pd.DataFrame, key: str) -> None:
        beside = theirs[(theirs["dataset"] + " " + theirs["blur_kind"]) == key]
        lines(axes, beside, "estimator", looks, "kernel_size_px", "paper_amae_percent", change=PAPER, zorder=2,
            part="paper",
              key=key)  # fmt: skip
        band = ("low_percent", "high_percent")
        lines(
            axes,
            rows,
            "estimator",
            looks,
            "kernel_size_px",
            "amae_percent",
            band=band,
            alpha=0.16,
            part="amae",
            key=key,
        )

    shown = [
        "dataset",
        "blur_kind",
        "kernel_size_px",
        "estimator",
        "calibrated",
        "amae_percent",
        "low_percent",
        "high_percent",
    ]
    values = summary[[*shown, "count", "abstained"]].sort_values(shown[:4])
    means = summary.groupby("estimator")["amae_percent"].agg(["mean", "max"])
    words = [
        f"{word(name)} {means['mean'][name]:.1f} % (worst {means['max'][name]:.1f} %)"
        for name in estimators if name in means.index
    ]  # fmt: skip
    alt = (
        f"AMAE over the size of the blur for {listing(word(name) for name in summary['dataset'].unique())}. Mean over "
        f"datasets, kinds and sizes: {listing(words)}."
    )
    return small_multiples(
        summary, Facet("dataset", datasets), Facet("blur_kind", kinds), panel,
        x="size of the blur [px]", y="AMAE [%]", alt=alt,
        axes={"xticks": sorted({*summary["kernel_size_px"], *theirs["kernel_size_px"]}), "ylim": (0, 1.04 * top)},
        legend=beside_the_paper(looks, list(summary["estimator"]), not theirs.empty),
        values=values.merge(theirs, how="left", on=["dataset", "blur_kind", "kernel_size_px", "estimator"]),
        series=style.switches(estimators), margin_in=0.62,
    )  # fmt: skip


def figures(
    summary: pd.DataFrame,
    datasets: Sequence[str],
    paper: pd.DataFrame | None,
    stages: Callable[[pd.DataFrame], tuple[str, ...]],
    relative: Mapping[str, str],
    prefix: str = "",
    modes: Mapping[str, str] | None = None,
) -> list[Block]:
    """A figure of raw estimates and one of calibrated ones, where there are any.

    Args:
        summary: `pipeline.experiments.tables.BLUR_SUMMARY`.
        datasets: in their order.
        paper: the paper's Table I.
        stages: (rows shown) -> stages that made them.
        relative: estimator -> what its MTF is relative to (`pipeline.report.inputs.relative_mtf`).
        prefix: before names and captions, e.g. ``"recorded"``.
        modes: see `ReportInputs`.
    """
    blocks: list[Block] = []
    for is_calibrated in (False, True):
        selected = summary[(summary["blur_kind"] != SHARP) & (summary["calibrated"] == is_calibrated)]
        if selected.empty:
            continue
        notes = [
            *_notes(relative, in_order(selected["estimator"], ESTIMATORS), is_calibrated),
            mode_note(modes or {}, selected["estimator"]),
        ]
        figure = PAGE.figure(
            "blur_amae", curves(selected, datasets, paper), stages(selected), after=" ".join(filter(None, notes)),
            name="blur_amae_calibrated" if is_calibrated else "",
            division=", each estimate divided by the camera's own for sharp frames" if is_calibrated else "",
            not_calibrated=", which is not calibrated" if is_calibrated else "",
        )  # fmt: skip
        if prefix:
            caption = f"{prefix.capitalize()}: {figure.caption}"
            figure = replace(figure, name=f"{prefix}_{figure.name}", caption=caption)
        blocks.append(figure)
    return blocks


def _blur(row: Row) -> str:
    """``"D 3"``, as the paper abbreviates."""
    if row["blur_kind"] in (MEAN, SHARP):
        return MEAN if row["blur_kind"] == MEAN else "None (sharp)"
    return f"{SHORT.get(row['blur_kind'], word(row['blur_kind']))} {format_number(row['kernel_size_px'])}"


def table_one(
    dataset: str,
    summary: pd.DataFrame,
    paper: pd.DataFrame | None,
    is_calibrated: bool,
    relative: Mapping[str, str],
    modes: Mapping[str, str] | None = None,
) -> Table:
    """Table I of one dataset: a row for each kind and size of blur, a column for each estimator, and their means.

    Args:
        dataset: name.
        summary: `pipeline.experiments.tables.BLUR_SUMMARY`.
        paper: the paper's Table I, shown beside raw estimates, which are what the paper prints.
        is_calibrated: show estimates divided by those for sharp frames.
        relative: estimator -> what its MTF is relative to.
        modes: see `ReportInputs`.
    """
    cells = with_paper(summary[summary["dataset"] == dataset], paper)
    cells = ordered(cells[cells["calibrated"] == is_calibrated], blur_kind=[SHARP, *BLURS], kernel_size_px=())
    cells = cells[cells["blur_kind"] != SHARP] if is_calibrated else cells
    estimators = in_order(cells["estimator"], ESTIMATORS)
    rows = pivot(cells, ["blur_kind", "kernel_size_px"], "estimator", amae)
    blurred = [row for row in rows if row["blur_kind"] != SHARP]
    means = {name: mean_cell([row[name] for row in blurred if name in row], complete=False) for name in estimators}
    rows.append({"blur_kind": MEAN, **{name: cell for name, cell in means.items() if cell is not None}})

    def best(row: Row) -> str:
        values = {name: cell.value for name in estimators if isinstance(cell := row.get(name), Estimate)}
        values = {name: value for name, value in values.items() if math.isfinite(value)}
        return word(min(values, key=lambda name: values[name])) if len(values) > 1 else ""

    also = ["sharp"] if (cells["blur_kind"] == SHARP).any() else []
    also += ["calibrated"] if is_calibrated else []
    notes = [*_notes(relative, estimators, is_calibrated), *filter(None, [mode_note(modes or {}, estimators)])]
    if cells["paper_percent"].notna().any():
        notes.append(PAGE.text("paper_sim" if dataset == "sim" else "paper"))
    return PAGE.table(
        "table_one", rows, cells={"blur": _blur, "best": best}, across={name: word(name) for name in estimators},
        also=also, notes=notes, dataset=dataset, suffix="_calibrated" if is_calibrated else "",
        how=", calibrated" if is_calibrated else "",
    )  # fmt: skip


def beside_the_best(summary: pd.DataFrame, paper: pd.DataFrame | None, frames: str = OTHER_FRAMES) -> Table | None:
    """Estimators of this project beside the paper's CNN and the best of its three, per dataset and blur.

    Args:
        summary: `pipeline.experiments.tables.BLUR_SUMMARY`.
        paper: the paper's Table I.
        frames: how ours differ from the paper's, a sentence.

    Returns:
        None where no dataset of the paper ran.
    """
    theirs: dict[tuple[Any, ...], dict[str, float]] = {}
    for row in [] if paper is None else records(paper):
        theirs.setdefault((row["dataset"], row["blur_kind"], row["kernel_size_px"]), {})[row["estimator"]] = row[
            "amae_percent"
        ]
    ours = in_order(set(summary["estimator"]) - {name for cell in theirs.values() for name in cell}, ESTIMATORS)
    blurred = summary[(summary["blur_kind"] != SHARP) & summary["estimator"].isin(ours)]
    blurred = ordered(blurred, dataset=DATASETS, blur_kind=BLURS, kernel_size_px=())
    calibrated = blurred["calibrated"].astype(bool)
    both = calibrated & blurred["estimator"].isin(blurred.loc[~calibrated, "estimator"])
    blurred = blurred.assign(column=blurred["estimator"] + np.where(both, "_calibrated", ""))
    rows: list[dict[str, Any]] = []
    wide = pivot(blurred, ["dataset", "blur_kind", "kernel_size_px"], "column", amae)
    for dataset in in_order(blurred["dataset"], DATASETS):
        selected = []
        for row in wide:
            cells = theirs.get((row["dataset"], row["blur_kind"], row["kernel_size_px"]))
            if row["dataset"] == dataset and cells:
                best = min(cells, key=lambda name, cells=cells: (cells[name], name))  # type: ignore[misc]
                selected.append({**row, "cnn": cells.get("cnn"), "best": cells[best], "which": ESTIMATORS[best]})
        if selected:
            means = {
                name: mean_cell([row.get(name) for row in selected]) for name in selected[0] if name != "kernel_size_px"
            }
            rows += [*selected, {**means, "dataset": dataset, "blur_kind": MEAN}]
    if not rows:
        return None
    across = {key: title for name in ours for key, title in _columns(name).items()}
    across = {key: title for key, title in across.items() if any(row.get(key) is not None for row in rows)}
    return PAGE.table("blur_beside_the_best", rows, cells={"blur": _blur}, across=across, frames=frames)


def _columns(estimator: str) -> dict[str, str]:
    return {estimator: word(estimator), f"{estimator}_calibrated": f"{word(estimator)}, calibrated"}


def abstentions(summary: pd.DataFrame, estimates: pd.DataFrame) -> Table:
    """Abstentions with their reasons, error of a single patch, and coverage of the intervals.

    Args:
        summary: `pipeline.experiments.tables.BLUR_SUMMARY`.
        estimates: `pipeline.experiments.tables.BLUR_ESTIMATES`.
    """
    # An estimator that is calibrated to its camera has calibrated estimates only.
    calibrated_only = summary.groupby(["dataset", "estimator"])["calibrated"].transform("all")
    raw = summary[~summary["calibrated"] | calibrated_only]
    patch = ["dataset", "estimator", "kernel", "frame", "patch"]
    refused = estimates.loc[estimates["abstained"], [*patch, "reason"]].drop_duplicates(patch)
    reasons = refused.groupby(["dataset", "estimator"])["reason"]
    counts = {key: group.value_counts().sort_index() for key, group in reasons}
    raw = ordered(raw, dataset=raw["dataset"].unique(), estimator=ESTIMATORS)
    rows = []
    for key, row in raw.groupby(["dataset", "estimator"], sort=False):
        blurred = row[row["blur_kind"] != SHARP]
        why = counts[key].to_dict() if key in counts else {}
        rows.append(
            dict(zip(("dataset", "estimator"), key, strict=True))
            | {
                "asked": int(row["count"].sum() + row["abstained"].sum()),
                "abstained": int(row["abstained"].sum()),
                "patch_error_percent": weighted_mean(blurred, "patch_error_percent"),
                "coverage_percent": 100 * weighted_mean(blurred, "coverage"),
                "reasons": ", ".join(f"{reason}: {count:,}" for reason, count in why.items()),
            }
        )
    return PAGE.table("blur_abstentions", rows)


def unseen_kernels(content: Mapping[str, Any]) -> Table:
    """AMAE of kernels of a kind that no network was trained on, as ``benchmarks/unseen_kernels.py`` recorded it.

    Args:
        content: ``kernels`` and ``results`` (dataset -> patches, estimator -> way -> AMAE, and ``few`` patches).
    """
    groups = ("out of focus", "aberrated", "shaken")
    ways = {"raw": "", "typical": ", generic lens", "calibrated": ", calibrated", "fitted": ", camera-calibrated"}
    rows = []
    for dataset in in_order(content["results"], DATASETS):
        for part in (content["results"][dataset], content["results"][dataset].get("few", {})):
            for estimator in ("spectral", "pmp", "gbb"):
                # Divided estimates of a kernel estimator are not shown: its own of sharp frames is not its camera's.
                for way in ways if estimator == "spectral" else ("raw",):
                    result = part.get(estimator, {}).get(way)
                    if result is not None:
                        name = word(estimator) + ways[way]
                        head = {"dataset": dataset, "estimator": name, "patches": part["patches"]}
                        means = {group: float(result["mean_of_group_percent"][group]) for group in groups}
                        rows.append({**head, **means, "mean": float(result["mean_amae_percent"])})
    return PAGE.table("blur_unseen_kernels", rows, count=len(content["kernels"]))
