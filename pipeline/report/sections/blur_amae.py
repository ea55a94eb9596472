"""Table I of the paper, AMAE of blur estimators: as tables, as curves over the kernel size, beside the paper's best."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.camera.mtf import CAMERA, GENERIC_LENS
from pipeline.experiments.condition import SHARP
from pipeline.grouped_statistics import weighted_mean
from pipeline.report import style
from pipeline.report.display_names import BLURS, DATASETS, ESTIMATORS, in_order, listing, word
from pipeline.report.figures import PAPER, Facet, beside_the_paper, lines, small_multiples
from pipeline.report.inputs import mode_note
from pipeline.report.spec import Block, Figure
from pipeline.report.style import Drawing
from pipeline.report.tables import (
    Column,
    Estimate,
    Row,
    Table,
    amae,
    format_number,
    mean_cell,
    named,
    ordered,
    pivot,
    records,
    table,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

STAGE = "blur@{dataset}-{estimator}"
ANY_STAGE = STAGE.format(dataset="<dataset>", estimator="<estimator>")
SHORT = {"defocus": "D", "linear_motion": "L", "nonlinear_motion": "N"}
RELATIVE = {
    CAMERA: "{name}: calibrated to the camera on its sharp frames, blurred synthetically, instead of divided. Frames "
    "are in two halves, each evaluated with the calibration on the other. Sharp frames have a relative MTF a little "
    "under 1.",
    GENERIC_LENS: "{name}: MTF relative to a generic lens, for cameras without sharp reference frames. For lenses "
    "sharper than the generic one it underestimates blur.",
}
MEAN = "Mean"
NOT_COUNTED = "The paper has no estimator of this name, so the ledger does not count these rows."
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
    return [
        RELATIVE[to].format(name=word(name)) for name, to in shown.items() if is_calibrated == (to == CAMERA)
    ]  # fmt: skip


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
        own = summary[(summary["blur_kind"] != SHARP) & (summary["calibrated"] == is_calibrated)]
        if own.empty:
            continue
        how = ", each estimate divided by the camera's own for sharp frames" if is_calibrated else ""
        caption = [
            f"AMAE over the size of the blur{how}. Line: of the median over patches; band: 95 % interval, frames "
            "resampled. "
            f"Dashed: the paper's Table I{', which is not calibrated' if is_calibrated else ''}.",
            *_notes(relative, in_order(own["estimator"], ESTIMATORS), is_calibrated),
            mode_note(modes or {}, own["estimator"]),
        ]
        words = " ".join(filter(None, caption))
        text = f"{prefix.capitalize()}: {words}" if prefix else words
        name = "_".join(part for part in (prefix, "blur_amae", "calibrated" if is_calibrated else "") if part)
        blocks.append(Figure(name, curves(own, datasets, paper), text, stages(own)))
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

    columns = [
        Column("blur", "Blur", "px", source=_blur),
        *(Column(name, word(name), "%", 1) for name in estimators),
        Column("best", "Best of ours", source=best),
    ]
    notes = [
        "AMAE of the robust median over patches, averaged over rotations, with 95 % interval (frames resampled); n: "
        "patches with an estimate, over all rotations. D: defocus, L: linear motion, N: non-linear motion, with "
        "their size. Mean: over D, L and N."
    ]
    if (cells["blur_kind"] == SHARP).any():
        notes.append("None (sharp): against the MTF of lens and pixels, measured on the Siemens star.")
    if is_calibrated:
        notes.append("Calibrated: each estimate divided by the same camera's estimate for its own sharp frames.")
    notes += [*_notes(relative, estimators, is_calibrated), *filter(None, [mode_note(modes or {}, estimators)])]
    if cells["paper_percent"].notna().any():
        beside = (
            "Its Sim frames are the authors', ours are rendered here: set beside each other, not compared."
            if dataset == "sim"
            else "A mean of the paper's is taken over the kernels that ran here."
        )
        notes.append(f"Paper: Table I; an en dash where we did not run the estimator. {beside}")
    suffix, how = ("_calibrated", ", calibrated") if is_calibrated else ("", "")
    caption = f"Table I on {word(dataset)}: error of the MTF{how}."
    stage = STAGE.format(dataset=dataset, estimator="<estimator>")
    return table(f"blur_amae_{dataset}{suffix}", caption, rows, columns, notes, stage)


def beside_the_best(summary: pd.DataFrame, paper: pd.DataFrame | None) -> Table | None:
    """Estimators of this project beside the paper's CNN and the best of its three, per dataset and blur.

    Args:
        summary: `pipeline.experiments.tables.BLUR_SUMMARY`.
        paper: the paper's Table I.

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
    blurred = blurred.assign(column=blurred["estimator"] + np.where(blurred["calibrated"], "_calibrated", ""))
    rows: list[dict[str, Any]] = []
    wide = pivot(blurred, ["dataset", "blur_kind", "kernel_size_px"], "column", amae)
    for dataset in in_order(blurred["dataset"], DATASETS):
        own = []
        for row in wide:
            cells = theirs.get((row["dataset"], row["blur_kind"], row["kernel_size_px"]))
            if row["dataset"] == dataset and cells:
                best = min(cells, key=lambda name, cells=cells: (cells[name], name))  # type: ignore[misc]
                own.append({**row, "cnn": cells.get("cnn"), "best": cells[best], "which": ESTIMATORS[best]})
        if own:
            means = {name: mean_cell([row.get(name) for row in own]) for name in own[0] if name != "kernel_size_px"}
            rows += [*own, {**means, "dataset": dataset, "blur_kind": MEAN}]
    if not rows:
        return None
    columns = [named("dataset", "Dataset"), Column("blur", "Blur", "px", source=_blur)]
    for name in ours:
        ways = (Column(name, word(name), "%", 1), Column(f"{name}_calibrated", f"{word(name)}, calibrated", "%", 1))
        columns += [column for column in ways if any(row.get(column.name) is not None for row in rows)]
    columns += [Column("cnn", "Paper, CNN", "%", 1), Column("best", "Paper, best of three", "%", 1)]
    columns.append(Column("which", "which is"))
    notes = [f"{NOT_COUNTED} Frames differ from the paper's; on Sim they are of another renderer."]
    caption = "Estimators the paper does not have, beside its CNN and the best of its three: AMAE."
    return table("blur_beside_the_best", caption, rows, columns, notes, ANY_STAGE)


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
    for key, own in raw.groupby(["dataset", "estimator"], sort=False):
        blurred = own[own["blur_kind"] != SHARP]
        why = counts[key].to_dict() if key in counts else {}
        rows.append(
            dict(zip(("dataset", "estimator"), key, strict=True))
            | {
                "asked": int(own["count"].sum() + own["abstained"].sum()),
                "abstained": int(own["abstained"].sum()),
                "patch_error_percent": weighted_mean(blurred, "patch_error_percent"),
                "coverage_percent": 100 * weighted_mean(blurred, "coverage"),
                "reasons": ", ".join(f"{reason}: {count:,}" for reason, count in why.items()),
            }
        )
    columns = [
        named("dataset", "Dataset"),
        named("estimator", "Estimator"),
        Column("asked", "Patches"),
        Column("abstained", "Abstained"),
        Column("patch_error_percent", "Error of a single patch", "%", 1),
        Column("coverage_percent", "Ground truths within the 95 % interval", "%", 0),
        Column("reasons", "Reasons of abstention", wide=True),
    ]
    notes = [
        "Over all kernels and rotations, sharp frames included. An abstention is neither a zero nor a "
        "dropped row: it is counted here. Error of a single patch: mean |estimate − ground truth|, no median over "
        "patches, uncalibrated but for an estimator calibrated to its camera. An en dash: no interval."
    ]
    return table("blur_abstentions", "Abstentions and single-patch errors.", rows, columns, notes, ANY_STAGE)


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
    columns: list[Column] = [
        named("dataset", "Dataset"),
        Column("estimator", "Estimator"),
        Column("patches", "Patches"),
        *(Column(group, group.capitalize(), "%", 1) for group in groups),
        Column("mean", "Mean", "%", 1),
    ]
    notes = [
        f"{len(content['kernels'])} kernels rendered by wave optics, of 3 to 22 px: irises of five and seven blades, "
        "mirror lenses and cat's eyes out of focus; coma, spherical aberration, astigmatism, diffraction; lenses "
        "shaken by hand. None is of a family that networks were trained on. AMAE, mean over the kernels of a group "
        "and over all. Calibrations and divisions as in Table I. PMP and GBB on few patches, the network on the same "
        "beside them. Errors are largest where a sharp core stands in a wide faint halo (spherical aberration, coma), "
        "which no kernel that the network was trained on has."
    ]
    caption = "Kernels of a kind that no network was trained on: AMAE."
    return table("blur_unseen_kernels", caption, rows, columns, notes)
