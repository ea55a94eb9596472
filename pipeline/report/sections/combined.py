"""Blur and noise at once: the paper's order of formation, estimates under both, and denoising before estimation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.camera.mtf import FREQUENCIES
from pipeline.experiments.sharp_curves import NOMINAL_FREQUENCIES
from pipeline.report import style
from pipeline.report.display_names import ESTIMATORS, EXPERIMENTS, in_order, listing, word
from pipeline.report.figures import PAPER, PAPER_DASH, Facet, add_legend, lines, ordinal_legend, small_multiples
from pipeline.report.frame_records import COMBINED_FILES, DENOISED_FILE, records_with
from pipeline.report.inputs import ReportInputs, denoised_cells, described, optional, paper_table
from pipeline.report.inputs import combined_tables as read_tables
from pipeline.report.ledger import LedgerRow
from pipeline.report.sections import combined_tables
from pipeline.report.sections.combined_tables import DENOISED_STAGE, OURS_FIRST, PAGE, STAGE
from pipeline.report.sections.published import beside_ours
from pipeline.report.spec import Block, Section, missing, overview
from pipeline.report.style import Drawing

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

TITLE = "Blur and noise at once"
STEPS = {
    "scene": "light",
    "photon": "photon noise",
    "optics": "optics (blur)",
    "dark": "dark current",
    "readout": "readout noise",
    "frame": "8-bit frame",
}
BLUR_FILE = COMBINED_FILES[0]
PICTURES = 3  # in a row of the example
LEFT_IN = 0.5
TRUTH: style.Look = {"color": style.INK, "linewidth": 1.3}
PRESENT: style.Look = {"linestyle": (0, (2, 1.5)), "linewidth": 0.7, "marker": ""}
THE_CNN: style.Look = {"color": style.MUTED, "linestyle": PAPER_DASH, "linewidth": 0.8}


@style.styled
def order_figure(arrays: Mapping[str, np.ndarray], example: Mapping[str, Any]) -> Drawing:
    """One patch after each step of image formation; one row for each order that occurs among the experiments.

    Args:
        arrays: ``step_<experiment>_<step>``.
        example: ``example.json`` of the stage `combined`.
    """
    rows: dict[tuple[str, ...], str] = {}
    for entry in example["experiments"]:
        rows.setdefault(tuple(entry["steps"]), entry["experiment"])
    columns = [step for step in STEPS if any(step in steps for steps in rows)]
    cell_in = style.sheet_cell_in(len(columns), margins_in=LEFT_IN + 0.02, gap_in=0.12)
    figure, axes = style.sheet(
        len(columns), [cell_in] * len(rows), left_in=LEFT_IN, top_in=0.22, gap_in=0.12,
        row_gaps_in=[0.16] * (len(rows) - 1),
    )  # fmt: skip
    for down, (steps, experiment) in enumerate(rows.items()):
        for across, step in enumerate(columns):
            panel = axes[down, across]
            if step in steps:
                style.picture(panel, arrays[f"step_{experiment}_{step}"])
            else:  # nothing happens to the light
                panel.axis("off")
                panel.annotate(
                    "", xy=(1.0, 0.5), xytext=(0.0, 0.5), xycoords="axes fraction",
                    arrowprops={"arrowstyle": "-|>", "color": style.MUTED, "linewidth": 0.8},
                )  # fmt: skip
            if down == 0:
                panel.set_title(STEPS[step], fontsize=6.4, pad=3)
        axes[down, 0].set_ylabel(word(experiment).replace(", ", ",\n"), fontsize=6.0)
    orders = [f"{word(name)}: {', '.join(STEPS[step] for step in steps)}" for steps, name in rows.items()]
    alt = (
        f"A patch of {word(example['dataset'])} after each step of image formation, blur "
        f"{example['kernel_size_px']:g} px, "
        f"noise {max(example['experiments'][0]['target_sigmas_dn']):g} DN. {listing(orders)}."
    )
    return Drawing(figure, alt)


@style.styled
def example_figure(
    curves: pd.DataFrame, arrays: Mapping[str, np.ndarray], example: Mapping[str, Any], paper: pd.DataFrame | None
) -> Drawing:
    """One blur under growing noise: the patch, and the median MTF over all patches; one row per experiment.

    Args:
        curves: rows of `pipeline.experiments.tables.CURVES` of one dataset and estimator, raw.
        arrays: ``level_<experiment>_<number>``.
        example: ``example.json`` of the stage `combined`.
        paper: columns series, sigma_dn, frequency, mtf: the paper's photon noise with linear motion.
    """
    entries: Sequence[Mapping[str, Any]] = example["experiments"]
    looks = {level: look | {"linewidth": 0.9, "markersize": 2.2} for level, look in
             style.ordinal_looks(curves["target_sigma_dn"]).items()}  # fmt: skip
    mean = curves[curves["axis"] == "HV"]
    filters = sorted(set(mean["filter_px"]))[:2]
    theirs = None
    if paper is not None and any(entry["experiment"] == "photon_linear" for entry in entries):
        theirs = paper[paper["series"] == "cnn"]
        theirs = theirs.assign(at=[FREQUENCIES[NOMINAL_FREQUENCIES.index(value)] for value in theirs["frequency"]])
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
            rows = mean[(mean["experiment"] == experiment) & (mean["filter_px"] == filter_px)]
            lines(axes, rows, "target_sigma_dn", looks, "frequency", "median")
            truth = rows[rows["target_sigma_dn"] == rows["target_sigma_dn"].min()].sort_values("frequency_index")
            if len(truth):
                axes.plot(truth["frequency"], truth["true_mtf"], zorder=4, **TRUTH)
            if theirs is not None and experiment == "photon_linear" and filter_px == 0:
                lines(axes, theirs, "sigma_dn", looks, "at", "mtf", change=PAPER | {"linewidth": 0.7}, zorder=2)
            axes.set(xlim=(0, 0.62), ylim=(0, 1.03), xticks=np.arange(0, 0.61, 0.2), yticks=np.arange(0, 1.01, 0.5))
            if down == 0:
                title = "as recorded" if filter_px == 0 else f"smoothed before ({filter_px:g} px)"
                axes.set_title(title, fontsize=6.2)
            if down == len(entries) - 1:
                axes.set_xlabel("frequency [fraction of Nyquist]", fontsize=6.0)
        panels[down, PICTURES].set_ylabel("MTF", labelpad=1)
    legend = [
        *ordinal_legend(style.ordinal_looks(curves["target_sigma_dn"]), "DN", "no noise"),
        ("ground truth", TRUTH),
    ]
    add_legend(figure, legend if theirs is None else [*legend, ("the paper's CNN, Udacity", THE_CNN)])
    keys = ["experiment", "filter_px", "target_sigma_dn", "axis", "frequency_index"]
    values = curves[[*keys, "frequency", "true_mtf", "median", "minimum", "maximum", "count"]].sort_values(keys)
    highest = mean[(mean["filter_px"] == 0) & (mean["target_sigma_dn"] == max(looks))]
    error = (highest["median"] - highest["true_mtf"]).abs().groupby(highest["experiment"]).max()
    words = [f"{word(one['experiment'])} {error[one['experiment']]:.2f}" for one in entries
             if one["experiment"] in error.index]  # fmt: skip
    alt = (
        f"A patch of {word(example['dataset'])} under a blur of {example['kernel_size_px']:g} px and growing noise, "
        f"with its "
        f"estimated MTF. Largest distance of the median from the ground truth at {max(looks):g} DN: {listing(words)}."
    )
    return Drawing(figure, alt, values.drop(columns="frequency_index"))


@style.styled
def noise_figure(cells: pd.DataFrame, dataset: str) -> Drawing:
    """Noise estimated on blurred frames over its level, coloured by kernel size: estimators down, experiments across.

    Noise that comes after the optics stays white and should be estimated at its level. Photon noise is blurred with
    the scene in the paper's order: little of it is left (dashed).

    Args:
        cells: `pipeline.experiments.tables.NOISE_CELLS`.
        dataset: name.
    """
    selected = cells[cells["dataset"] == dataset]
    estimators = in_order(selected["estimator"], ESTIMATORS)
    looks = style.ordinal_looks(selected["kernel_size_px"])
    highest = float(selected["target_sigma_dn"].max())

    def panel(axes: Axes, rows: pd.DataFrame, key: str) -> None:
        axes.plot([0, highest], [0, highest], color=style.MUTED, linewidth=0.6, zorder=1)
        lines(axes, rows, "kernel_size_px", looks, "target_sigma_dn", "unclipped_median_dn", change=PRESENT, zorder=2)
        lines(axes, rows, "kernel_size_px", looks, "target_sigma_dn", "median_dn")

    words = []
    blurred = selected[(selected["target_sigma_dn"] == highest) & (selected["kernel_size_px"] > 0)]
    for name in estimators:
        rows = blurred[blurred["estimator"] == name]
        for noise_source in in_order(rows["noise_source"], ["dcsn", "photon"]):
            median = rows.loc[rows["noise_source"] == noise_source, "median_dn"]
            words.append(
                f"{word(name)} estimates {median.min():.1f} to {median.max():.1f} DN of {word(noise_source)} noise"
            )
    shown = ["estimator", "experiment", "kernel_size_px", "target_sigma_dn"]
    values = selected[
        [*shown, "median_dn", "low_dn", "high_dn", "unclipped_median_dn", "clipped_median_dn", "count", "abstained"]
    ]
    top = 1.06 * float(np.nanmax([highest, *selected["median_dn"], *selected["unclipped_median_dn"]]))
    return small_multiples(
        selected, Facet("estimator", estimators), Facet("experiment", in_order(selected["experiment"], EXPERIMENTS)),
        panel, x="noise level σ [DN]", y="estimated σ [DN]", axes={"xlim": (0, highest), "ylim": (0, top)},
        alt=f"Noise estimated on blurred frames of {word(dataset)}. At a level of {highest:g} DN {listing(words)}.",
        legend=[*ordinal_legend(looks, "px", "no blur"), ("present, unclipped", PRESENT | {"color": style.INK}),
                ("target level", {"color": style.MUTED, "linewidth": 0.6})],
        values=values.sort_values(shown), panel_in=1.7, title_size=6.6,
    )  # fmt: skip


@style.styled
def amae_figure(cells: pd.DataFrame, datasets: Sequence[str], paper: pd.DataFrame | None = None) -> Drawing:
    """Error of the blur estimate over the noise level, coloured by kernel size: datasets down, experiments across.

    Args:
        cells: rows of `pipeline.experiments.tables.BLUR_CELLS` of one estimator, raw or calibrated.
        datasets: rows of the figure.
        paper: columns size_px, sigma_dn, amae_percent: the paper's photon noise with defocus, on Udacity.
    """
    plain = cells[cells["filter_px"] == 0]
    experiments = in_order(plain["experiment"], EXPERIMENTS)
    looks = style.ordinal_looks(plain["kernel_size_px"])
    theirs = paper if "photon_defocus" in experiments else None

    def panel(axes: Axes, rows: pd.DataFrame, key: str) -> None:
        band = ("low_percent", "high_percent")
        lines(axes, rows, "kernel_size_px", looks, "target_sigma_dn", "amae_percent", band=band, alpha=0.12)
        if theirs is not None and key.endswith(" photon_defocus"):
            change = PAPER | {"linewidth": 0.8}
            lines(axes, theirs, "kernel_size_px", looks, "sigma_dn", "amae_percent", change=change, zorder=2)

    levels = sorted(set(plain["target_sigma_dn"]))
    means = plain.groupby(["experiment", "target_sigma_dn"])["amae_percent"].mean()
    words = [f"{word(name)} {means[name, levels[0]]:.1f} to {means[name, levels[-1]]:.1f} %" for name in experiments]
    alt = (
        f"Error of the blur estimate over the noise level. Mean over datasets and sizes from {levels[0]:g} to "
        f"{levels[-1]:g} DN: {listing(words)}."
    )
    shown = ["dataset", "experiment", "kernel_size_px", "target_sigma_dn"]
    values = plain[[*shown, "estimator", "calibrated", "amae_percent", "low_percent", "high_percent", "count"]]
    top = float(np.nanmax([*plain["amae_percent"], *([] if theirs is None else theirs["amae_percent"]), 5.0]))
    legend = ordinal_legend(looks, "px", "no blur")
    return small_multiples(
        plain, Facet("dataset", datasets), Facet("experiment", experiments), panel,
        x="noise level σ [DN]", y="AMAE [%]", alt=alt, axes={"xlim": (0, levels[-1]), "ylim": (0, 1.05 * top)},
        legend=legend if theirs is None else [*legend, ("the paper's CNN, Udacity", THE_CNN)],
        values=values.sort_values(shown), title_size=6.6,
    )  # fmt: skip


def _example(dataset: str, curves: pd.DataFrame, inputs: ReportInputs, *, with_order: bool) -> list[Block]:
    folder = inputs.combined[dataset]
    example = described(folder, "example.json", ("dataset", "kernel_size_px", "experiments"))
    if example is None or not example["experiments"]:
        return []
    arrays, stages = optional(folder, "example.npz") or {}, (STAGE.format(dataset=dataset),)
    blocks: list[Block] = []
    if with_order:
        drawing, name = order_figure(arrays, example), "combined_order_{dataset}"
        blocks.append(PAGE.figure("combined_order", drawing, stages, name=name, dataset=dataset))
    estimator = in_order(curves["estimator"], OURS_FIRST)[:1]
    selected = curves[curves["estimator"].isin(estimator) & ~curves["calibrated"]]
    if len(selected):
        drawing = example_figure(selected, arrays, example, paper_table(inputs, "photon_linear_motion_mtf.csv"))
        words = {"dataset": dataset, "estimator": estimator[0], "px": example["kernel_size_px"]}
        blocks.append(PAGE.figure("combined_example", drawing, stages, name="combined_example_{dataset}", **words))
    return blocks


def _figures(blur: pd.DataFrame, noise: pd.DataFrame, datasets: Sequence[str], inputs: ReportInputs) -> list[Block]:
    blocks: list[Block] = []
    for dataset in in_order(noise["dataset"], datasets):
        drawing, stage = noise_figure(noise, dataset), STAGE.format(dataset=dataset)
        blocks.append(PAGE.figure("combined_noise", drawing, [stage], name="combined_noise_{dataset}", dataset=dataset))
    estimator = in_order(blur["estimator"], OURS_FIRST)[:1]
    paper = paper_table(inputs, "photon_defocus_amae.csv")
    for is_calibrated in (False, True):
        selected = blur[blur["estimator"].isin(estimator) & (blur["calibrated"] == is_calibrated)]
        if len(selected):
            stages = [STAGE.format(dataset=dataset) for dataset in datasets]
            name, how = ("combined_amae_calibrated", ", calibrated") if is_calibrated else ("combined_amae", "")
            drawing = amae_figure(selected, datasets, paper)
            blocks.append(PAGE.figure("combined_amae", drawing, stages, name=name, estimator=estimator[0], how=how))
    return blocks


def section(inputs: ReportInputs, ledger: Sequence[LedgerRow] = ()) -> Section:
    """Blur and noise at once on every dataset, and the supplement's denoising."""
    blur, noise, curves = read_tables(inputs)
    cells = denoised_cells(inputs)
    ran, smoothed = (in_order(one["dataset"], inputs.datasets) for one in (blur, cells))
    listed, listed_denoised = (
        [one.dataset for one in records_with(inputs, name)] for name in (BLUR_FILE, DENOISED_FILE)
    )
    runs = overview(TITLE, STAGE, ran, inputs, recorded=listed)
    denoised_runs = overview("Denoised blur", DENOISED_STAGE, smoothed, inputs, recorded=listed_denoised)
    blocks: list[Block] = []
    for dataset in ran:  # the order is the same on every dataset
        blocks += _example(dataset, curves[curves["dataset"] == dataset], inputs, with_order=dataset == ran[0])
    if ran:
        blocks += [*_figures(blur, noise, ran, inputs), combined_tables.overview(blur)]
    theirs = paper_table(inputs, "photon_defocus_amae.csv")
    for dataset in ran:
        for experiment in in_order(blur.loc[blur["dataset"] == dataset, "experiment"], EXPERIMENTS):
            known = theirs if experiment == "photon_defocus" else None
            blocks.append(combined_tables.error(dataset, experiment, blur, known))
    paper = paper_table(inputs, "improved_blur.csv")
    blocks += [combined_tables.denoised(dataset, cells, paper) for dataset in smoothed]
    if ran:
        blocks.append(combined_tables.abstentions(blur, noise))
    items = ("photon_defocus_amae", "photon_linear_motion_mtf", "improved_blur")
    published, published_runs = beside_ours(items, ledger, inputs)
    blocks += [*published, *missing(TITLE, runs), *missing("Denoised blur", denoised_runs)]
    return Section("combined", TITLE, (PAGE.text("introduction"),), blocks, [*runs, *denoised_runs, *published_runs])
