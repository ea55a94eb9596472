"""Blur and noise at once: the paper's order of formation, estimates under both, and denoising before estimation.

Throughout, ``cells`` and ``blur`` are `pipeline.experiments.tables.BLUR_CELLS` (`noise_figure` and ``noise``:
`NOISE_CELLS`), ``curves`` a `CURVES`; ``example`` is ``example.json`` of the stage `combined`, ``arrays`` its
pictures; ``paper`` holds the published numbers of the same experiment, of the paper's network on Udacity.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from pipeline.experiments.recorded.frames import COMBINED_FILES, DENOISED_FILE, records_with
from pipeline.report import style, training_budget
from pipeline.report.descriptions import Descriptions
from pipeline.report.display_names import DATASETS, ESTIMATORS, EXPERIMENTS, in_order, word
from pipeline.report.figures import PAPER, PAPER_DASH, add_legend, lines, ordinal_legend
from pipeline.report.inputs import ReportInputs, at_frequencies, published
from pipeline.report.ledger.items import beside_ours
from pipeline.report.spec import Block, Figure, Section, as_recorded, overview
from pipeline.report.tables import (
    Row,
    Table,
    amae,
    estimate,
    format_number,
    mean_cell,
    ordered,
    pivot,
    records,
    totals,
    where,
)  # fmt: skip
from pipeline.stage_files import described

PAGE = Descriptions("combined")
STAGE = "combined@{dataset}"
DENOISED_STAGE = "denoised_blur@{dataset}"
PAPERS_DATASET = "udacity"
OURS_FIRST = ["spectral", *(name for name in ESTIMATORS if name != "spectral")]
VARIANT = ["estimator", "filter_px", "calibrated"]
TITLE, DENOISED = "Blur and noise at once", "Denoised blur"
TABLES = ("combined_blur", "combined_noise", "combined_curves")
STEPS = {
    "scene": "light", "photon": "photon noise", "optics": "optics (blur)", "dark": "dark current",
    "readout": "readout noise", "total": "sensor noise", "frame": "8-bit frame",
}  # fmt: skip
PICTURES = 3  # in a row of the example
TRUTH: style.Look = {"color": style.INK, "linewidth": 1.3}
PRESENT: style.Look = {"linestyle": (0, (2, 1.5)), "linewidth": 0.7, "marker": ""}
THE_CNN = ("the paper's CNN, Udacity", {"color": style.MUTED, "linestyle": PAPER_DASH, "linewidth": 0.8})
THIN_PAPER = PAPER | {"linewidth": 0.7}


def order_figure(arrays: Mapping[str, np.ndarray], example: Mapping[str, Any]) -> style.Drawing:
    """One patch after each step of image formation; one row for each order that occurs among the experiments.

    ``arrays`` holds ``step_<experiment>_<step>``.
    """
    rows: dict[tuple[str, ...], str] = {}
    for entry in example["experiments"]:
        rows.setdefault(tuple(entry["steps"]), entry["experiment"])
    columns = [step for step in STEPS if any(step in steps for steps in rows)]
    if any(steps.index("optics") < steps.index("photon") for steps in rows if {"optics", "photon"} <= set(steps)):
        columns.remove("photon")  # in this camera the optics come first
        columns.insert(columns.index("optics") + 1, "photon")
    figure, axes = style.sheet(len(columns), [1] * len(rows), left_in=0.5, top_in=0.22, gap_in=0.12, row_gap_in=0.16)
    for down, (steps, experiment) in enumerate(rows.items()):
        for across, step in enumerate(columns):
            panel = axes[down, across]
            if step in steps:
                style.picture(panel, arrays[f"step_{experiment}_{step}"])
            else:  # nothing happens to the light
                panel.axis("off")
                arrow = {"arrowstyle": "-|>", "color": style.MUTED, "linewidth": 0.8}
                panel.annotate("", xy=(1.0, 0.5), xytext=(0.0, 0.5), xycoords="axes fraction", arrowprops=arrow)
            if down == 0:
                panel.set_title(STEPS[step], fontsize=6.4, pad=3)
        axes[down, 0].set_ylabel(word(experiment).replace(", ", ",\n"), fontsize=6.0)
    orders = [{"name": name, "steps": ", ".join(STEPS[step] for step in steps)} for steps, name in rows.items()]
    strongest = max(example["experiments"][0]["target_sigmas_dn"])
    px = example["kernel_size_px"]
    return style.Drawing(figure, PAGE.alt("combined_order", orders, dataset=example["dataset"], px=px, level=strongest))


def example_figure(
    curves: pd.DataFrame, arrays: Mapping[str, np.ndarray], example: Mapping[str, Any], paper: pd.DataFrame
) -> style.Drawing:
    """One blur under growing noise: the patch, and the median MTF over all patches; one row per experiment.

    ``curves`` of one dataset and estimator, raw; ``arrays`` holds ``level_<experiment>_<number>``.
    """
    entries: Sequence[Mapping[str, Any]] = example["experiments"]
    looks = style.ordinal_looks(curves["target_sigma_dn"])
    thin = {level: look | {"linewidth": 0.9, "markersize": 2.2} for level, look in looks.items()}
    mean = curves[curves["axis"] == "HV"]
    filters = sorted(set(mean["filter_px"]))[:2]
    theirs = at_frequencies(where(paper, series="cnn"))
    figure = style.new_figure(style.TWO_COLUMNS_IN, 1.5 * len(entries) + 0.5)
    widths = [1.0] * PICTURES + [1.55] * len(filters)
    panels = figure.subplots(len(entries), len(widths), squeeze=False, width_ratios=widths)
    for down, entry in enumerate(entries):
        experiment, levels = entry["experiment"], list(entry["target_sigmas_dn"])
        for cell, number in enumerate(np.linspace(0, len(levels) - 1, PICTURES).round().astype(int)):
            style.picture(panels[down, cell], arrays[f"level_{experiment}_{number}"])
            panels[down, cell].set_xlabel(f"σ {levels[number]:g} DN", fontsize=5.6, labelpad=1.5)
        panels[down, 0].set_ylabel(word(experiment), fontsize=6.0)
        for axes, filter_px in zip(panels[down, PICTURES:], filters, strict=True):
            rows = where(mean, experiment=experiment, filter_px=filter_px)
            lines(axes, rows, "target_sigma_dn", thin, "frequency", "median")
            _truth(axes, rows)
            if experiment == "photon_linear" and filter_px == 0:
                lines(axes, theirs, "sigma_dn", thin, "at", "mtf", change=THIN_PAPER, zorder=2)
            axes.set(xlim=(0, 0.62), ylim=(0, 1.03), xticks=np.arange(0, 0.61, 0.2), yticks=np.arange(0, 1.01, 0.5))
            if down == 0:
                title = "as it is" if filter_px == 0 else f"smoothed before ({filter_px:g} px)"
                axes.set_title(title, fontsize=6.2)
            if down == len(entries) - 1:
                axes.set_xlabel("frequency [fraction of Nyquist]", fontsize=6.0)
        panels[down, PICTURES].set_ylabel("MTF", labelpad=1)
    beside = [THE_CNN] if any(entry["experiment"] == "photon_linear" for entry in entries) else []
    add_legend(figure, [*ordinal_legend(looks, "DN", "no noise"), ("ground truth", TRUTH), *beside])
    keys = ["experiment", "filter_px", "target_sigma_dn", "axis", "frequency_index"]
    values = curves[[*keys, "frequency", "true_mtf", "median", "minimum", "maximum", "count"]].sort_values(keys)
    distances = _distances(mean[mean["filter_px"] == 0], max(looks), ["experiment"])
    distances = ordered(distances, experiment=[entry["experiment"] for entry in entries])
    px = example["kernel_size_px"]
    alt = PAGE.alt("combined_example", distances, dataset=example["dataset"], px=px, level=max(looks))
    return style.Drawing(figure, alt, values.drop(columns="frequency_index"))


def _truth(axes: Axes, rows: pd.DataFrame, key: str = "") -> None:
    """The ground truth of a panel of curves."""
    truth = rows[rows["target_sigma_dn"] == rows["target_sigma_dn"].min()].sort_values("frequency_index")
    if len(truth):
        axes.plot(truth["frequency"], truth["true_mtf"], zorder=4, **TRUTH)


def _distances(curves: pd.DataFrame, level_dn: float, by: list[str]) -> pd.DataFrame:
    """Largest ``distance`` of the median from the ground truth at one level of noise, of each group of curves."""
    highest = curves[curves["target_sigma_dn"] == level_dn]
    distance = (highest["median"] - highest["true_mtf"]).abs()
    return highest.assign(distance=distance).groupby(by, as_index=False)[["distance"]].max()


def noise_figure(cells: pd.DataFrame, dataset: str) -> style.Drawing:
    """Noise estimated on blurred frames over its level, coloured by kernel size: estimators down, experiments across.

    Noise that comes after the optics stays white and should be estimated at its level. Photon noise is blurred with
    the scene in the paper's order: little of it is left (dashed).
    """
    selected = cells[cells["dataset"] == dataset]
    looks = style.ordinal_looks(selected["kernel_size_px"])
    highest = float(selected["target_sigma_dn"].max())

    def levels(axes: Axes, rows: pd.DataFrame, key: str) -> None:
        axes.plot([0, highest], [0, highest], color=style.MUTED, linewidth=0.6, zorder=1)
        lines(axes, rows, "kernel_size_px", looks, "target_sigma_dn", "unclipped_median_dn", change=PRESENT, zorder=2)

    blurred = selected[(selected["target_sigma_dn"] == highest) & (selected["kernel_size_px"] > 0)]
    medians = blurred.groupby(["estimator", "noise_source"])["median_dn"].agg(["min", "max"]).reset_index()
    medians = ordered(medians, estimator=ESTIMATORS, noise_source=["dcsn", "photon"])
    top = 1.06 * float(np.nanmax([highest, *selected["median_dn"], *selected["unclipped_median_dn"]]))
    return PAGE.grid(
        "combined_noise", selected, PAGE.alt("combined_noise", medians, dataset=dataset, level=highest), looks,
        under=levels, axes={"xlim": (0, highest), "ylim": (0, top)},
        legend=[*ordinal_legend(looks, "px", "no blur"), ("in the frame, unclipped", PRESENT | {"color": style.INK}),
                ("target level", {"color": style.MUTED, "linewidth": 0.6})],
    )  # fmt: skip


def amae_figure(cells: pd.DataFrame, datasets: Sequence[str], paper: pd.DataFrame) -> style.Drawing:
    """Error of the blur estimate over the noise level, coloured by kernel size: datasets down, experiments across.

    ``cells`` of one estimator, raw or calibrated, which the legend names.
    """
    first = cells.iloc[0]
    title = word(first["estimator"]) + (", calibrated" if first["calibrated"] else "")
    plain = cells[cells["filter_px"] == 0]
    looks = style.ordinal_looks(plain["kernel_size_px"])
    theirs = paper if (plain["experiment"] == "photon_defocus").any() else paper.iloc[:0]

    levels = sorted(set(plain["target_sigma_dn"]))
    means = plain.groupby(["experiment", "target_sigma_dn"])["amae_percent"].mean().unstack()
    means = means.rename(columns={levels[0]: "first", levels[-1]: "last"}).reset_index()
    alt = PAGE.alt("combined_amae", ordered(means, experiment=EXPERIMENTS), least=levels[0], most=levels[-1])
    top = float(np.nanmax([*plain["amae_percent"], *theirs["amae_percent"], 5.0]))
    return PAGE.grid(
        "combined_amae", plain, alt, looks, down=datasets, beside=theirs.assign(experiment="photon_defocus"),
        axes={"xlim": (0, levels[-1]), "ylim": (0, 1.05 * top)}, title=title,
        legend=[*ordinal_legend(looks, "px", "no blur"), *([THE_CNN] if len(theirs) else [])],
    )  # fmt: skip


def curves_figure(curves: pd.DataFrame, dataset: str, paper: pd.DataFrame) -> style.Drawing:
    """Estimated MTF of one blur under growing noise: estimators down, experiments across.

    ``curves`` raw, mean of both directions, without a filter.
    """
    looks = style.ordinal_looks(curves["target_sigma_dn"])
    theirs = at_frequencies(where(paper, series="cnn")).assign(experiment="photon_linear")
    theirs = theirs.rename(columns={"sigma_dn": "target_sigma_dn"})
    distances = _distances(curves, curves["target_sigma_dn"].max(), ["estimator", "experiment"])
    alt = PAGE.alt("recorded_curves", distances, dataset=dataset, px=curves["kernel_size_px"].iloc[0])
    legend = [*ordinal_legend(looks, "DN", "no noise"), ("ground truth", TRUTH), THE_CNN]
    return PAGE.grid("recorded_curves", curves, alt, looks, beside=theirs, over=_truth, legend=legend)


def _variant(row: Row) -> str:
    how = "calibrated" if row["calibrated"] else "raw"
    return f"{how}, smoothed {row['filter_px']:g} px" if row["filter_px"] else how


def _shown(cells: pd.DataFrame, *by: str) -> pd.DataFrame:
    """Raw and calibrated estimates, and raw ones with each disc that smoothed any patch (of the same group)."""
    smoothed = (cells["smoothed_fraction"] > 0).groupby([cells[name] for name in (*by, "filter_px")]).transform("any")
    return cells[(cells["filter_px"] == 0) | (~cells["calibrated"] & smoothed)]


def error_table(dataset: str, experiment: str, cells: pd.DataFrame, paper: pd.DataFrame | None = None) -> Table:
    """AMAE of one dataset and experiment: a row per estimator, variant and kernel size, a column per level, and means.

    The paper's CNN on Udacity stands beside raw estimates of the first estimator.
    """
    selected = where(cells, dataset=dataset, experiment=experiment)
    levels = PAGE.headings("error", selected["target_sigma_dn"])
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
        lines = pivot(group, [*VARIANT, "kernel_size_px"], "target_sigma_dn", amae, "level_{:g}".format)
        complete = [name for name in levels if all(name in line for line in lines)]
        means = {name: mean_cell([line[name] for line in lines]) for name in complete}
        rows += [*lines, {**lines[0], **dict.fromkeys(levels), **means, "kernel_size_px": None}]
    cells_of = {
        "variant": _variant,
        "size": lambda row: "Mean" if row["kernel_size_px"] is None else format_number(row["kernel_size_px"]),
    }
    beside = [] if paper is None else ["paper" if dataset == PAPERS_DATASET else "paper_elsewhere"]
    return PAGE.table("error", rows, cells=cells_of, across=levels, also=beside, dataset=dataset, experiment=experiment)


def overview_table(cells: pd.DataFrame) -> Table:
    """Each estimator's error over the noise level, mean over kernel sizes: a row per dataset, experiment, variant.

    A level has no mean where a size has no estimate: the mean of the others would not be comparable.
    """
    index = ["dataset", "experiment", *VARIANT]
    shown = _shown(cells, "dataset", "experiment", "estimator")
    shown = ordered(shown, dataset=DATASETS, experiment=EXPERIMENTS, estimator=OURS_FIRST, filter_px=(), calibrated=())
    sizes = shown.groupby(index)["kernel_size_px"].transform(lambda px: ", ".join(map(format_number, sorted(set(px)))))
    groups = shown.assign(sizes=sizes).groupby([*index, "sizes", "target_sigma_dn"], sort=False, as_index=False)
    means = groups.agg(amae_percent=("amae_percent", lambda sizes_amae: sizes_amae.mean(skipna=False)))
    return PAGE.table("combined_overview", means, cells={"variant": _variant})


def denoised_table(dataset: str, cells: pd.DataFrame, paper: pd.DataFrame) -> Table:
    """The supplement's table: blur d1, noise, disc d2; as it is, smoothed, and as propagation of errors predicts."""
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
        "filter": lambda row: format_number(row["filter_px"]) if row["filter_px"] else "none",
        "expected": lambda row: expected(row) if row["filter_px"] else None,
    }
    return PAGE.table("denoised", selected, cells=made, dataset=dataset)


def abstention_table(blur: pd.DataFrame, noise: pd.DataFrame) -> Table:
    """Abstentions of each estimator, error of a single patch, and coverage of the intervals."""
    keys = ["dataset", "experiment", "estimator", "filter_px"]
    raw = blur[~blur["calibrated"]]
    raw = raw[(raw["filter_px"] == 0) | (raw.groupby(keys)["smoothed_fraction"].transform("max") > 0)]
    rows = [
        *records(totals(raw, keys, "patch_error_percent", "coverage")),
        *records(totals(noise.assign(filter_px=0.0), keys, "patch_error_dn", "coverage")),
    ]

    def estimator(row: Row) -> str:
        return word(row["estimator"]) + (f", smoothed {row['filter_px']:g} px" if row["filter_px"] else "")

    cells = {"estimator": estimator, "coverage": lambda row: 100 * row["coverage"]}
    return PAGE.table("combined_abstentions", rows, cells=cells)


def _example(dataset: str, curves: pd.DataFrame, inputs: ReportInputs, *, with_order: bool) -> Iterator[Block]:
    example = described(
        inputs.folders("combined")[dataset], "example.json", ("dataset", "kernel_size_px", "experiments")
    )
    if example is None or not example["experiments"]:
        return
    arrays = inputs.arrays(f"combined/{dataset}/example.npz")
    if with_order:
        yield PAGE.figure("combined_order", order_figure(arrays, example), dataset=dataset)
    for estimator in in_order(curves["estimator"], OURS_FIRST)[:1]:
        selected = where(curves, estimator=estimator, calibrated=False)
        if len(selected):
            drawing = example_figure(selected, arrays, example, published(inputs, "photon_linear_motion_mtf.csv"))
            words = {"dataset": dataset, "estimator": estimator, "px": example["kernel_size_px"]}
            yield PAGE.figure("combined_example", drawing, **words)


def _noise(noise: pd.DataFrame, dataset: str, inputs: ReportInputs) -> Figure:
    with training_budget.named(inputs, "noise"):
        return PAGE.figure("combined_noise", noise_figure(noise, dataset), dataset=dataset)


def _abstentions(blur: pd.DataFrame, noise: pd.DataFrame, inputs: ReportInputs) -> Table:
    with training_budget.named(inputs):
        return abstention_table(blur, noise)


def _figures(blur: pd.DataFrame, noise: pd.DataFrame, datasets: Sequence[str], inputs: ReportInputs) -> Iterator[Block]:
    for dataset in in_order(noise["dataset"], datasets):
        yield _noise(noise, dataset, inputs)
    stages, paper = [STAGE.format(dataset=name) for name in datasets], published(inputs, "photon_defocus_amae.csv")
    for estimator in in_order(blur["estimator"], OURS_FIRST)[:1]:
        for is_calibrated, suffix, how in ((False, "", ""), (True, "_calibrated", ", calibrated")):
            selected = where(blur, estimator=estimator, calibrated=is_calibrated)
            if len(selected):
                drawing, name = amae_figure(selected, datasets, paper), f"combined_amae{suffix}"
                yield PAGE.figure("combined_amae", drawing, stages, name=name, estimator=estimator, how=how)


def _errors(dataset: str, blur: pd.DataFrame, inputs: ReportInputs) -> list[Table]:
    """The table of errors of each experiment on one dataset."""
    paper = published(inputs, "photon_defocus_amae.csv")
    return [
        error_table(dataset, name, blur, paper if name == "photon_defocus" else None)
        for name in in_order(where(blur, dataset=dataset)["experiment"], EXPERIMENTS)
    ]


def section(inputs: ReportInputs) -> Section:
    """Blur and noise at once on every dataset, and the supplement's denoising."""
    blur, noise, curves, cells = map(inputs.result, (*TABLES, "denoised_blur"))
    ran, smoothed = (in_order(one["dataset"], inputs.datasets) for one in (blur, cells))
    runs, denoised_runs = (
        overview(title, stage, done, inputs, recorded=[one.dataset for one in records_with(inputs.recorded, file)])
        for title, stage, done, file in (
            (TITLE, STAGE, ran, COMBINED_FILES[0]), (DENOISED, DENOISED_STAGE, smoothed, DENOISED_FILE)
        )
    )  # fmt: skip
    paper = published(inputs, "improved_blur.csv")
    items = ("photon_defocus_amae", "photon_linear_motion_mtf", "improved_blur")
    beside, published_runs = beside_ours(items, inputs)
    blocks: list[Block] = []
    for dataset in ran:  # the order is the same on every dataset
        blocks += _example(dataset, where(curves, dataset=dataset), inputs, with_order=dataset == ran[0])
    if ran:
        blocks += [*_figures(blur, noise, ran, inputs), overview_table(blur)]
    blocks += [table for dataset in ran for table in _errors(dataset, blur, inputs)]
    blocks += [denoised_table(dataset, cells, paper) for dataset in smoothed]
    blocks += [_abstentions(blur, noise, inputs)] if ran else []
    return PAGE.section([*blocks, *beside], [*runs, *denoised_runs, *published_runs])


def _of_record(
    dataset: str, blur: pd.DataFrame, noise: pd.DataFrame, curves: pd.DataFrame, inputs: ReportInputs
) -> Iterator[Block]:
    """Figures and tables of one recorded dataset."""
    selected = where(curves, dataset=dataset, calibrated=False, axis="HV", filter_px=0)
    selected = selected[selected["experiment"] != ""]
    if len(selected):
        drawing = curves_figure(selected, dataset, published(inputs, "photon_linear_motion_mtf.csv"))
        yield PAGE.figure("recorded_curves", drawing, dataset=dataset, px=selected["kernel_size_px"].iloc[0])
    theirs, on = published(inputs, "photon_defocus_amae.csv"), f" on {word(dataset)}"
    for name in in_order(where(blur, dataset=dataset)["estimator"], ESTIMATORS):
        drawing = amae_figure(where(blur, dataset=dataset, estimator=name, calibrated=False), [dataset], theirs)
        amae_of = PAGE.figure("combined_amae", drawing, name=f"combined_amae_{dataset}_{name}", estimator=name, how=on)
        yield as_recorded(amae_of)
    if (noise["dataset"] == dataset).any():
        yield as_recorded(_noise(noise, dataset, inputs))
    yield from map(as_recorded, _errors(dataset, blur, inputs))


def recorded(inputs: ReportInputs) -> Section | None:
    """The same of frames recorded by ``camera-monitor record combined`` and ``denoised-blur``; None without them."""
    records, denoised = records_with(inputs.recorded, COMBINED_FILES[0]), records_with(inputs.recorded, DENOISED_FILE)
    if not records and not denoised:
        return None
    blocks: list[Block] = []
    if records:
        blocks.append(PAGE.table("recorded_combined_sources", [one.described("blur_patches") for one in records]))
        blur, noise, curves = map(inputs.recorded_result, TABLES)
        blur = blur[blur["experiment"] != ""]
        for record in records:
            blocks += _of_record(record.dataset, blur, noise, curves, inputs)
        blocks.append(as_recorded(_abstentions(blur, noise, inputs)))
    paper, cells = published(inputs, "improved_blur.csv"), inputs.recorded_result("denoised_blur")
    blocks += [as_recorded(denoised_table(record.dataset, cells, paper)) for record in denoised]
    return PAGE.section(blocks, key="combined_recorded")
