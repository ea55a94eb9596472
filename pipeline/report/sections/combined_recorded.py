"""Blur and noise at once on recorded frames: the paper's tables and curves, of its network and ours, measured by hand.

`camera-monitor record combined` and `record denoised-blur` measure and store (`pipeline.recording.frames`); the
tables and most figures are those of the section of blur and noise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipeline.camera.mtf import FREQUENCIES
from pipeline.experiments.sharp_curves import NOMINAL_FREQUENCIES
from pipeline.report import style
from pipeline.report.display_names import ESTIMATORS, EXPERIMENTS, in_order, listing, word
from pipeline.report.figures import PAPER, Facet, lines, ordinal_legend, small_multiples
from pipeline.report.frame_records import COMBINED_FILES, DENOISED_FILE, joined, records_with
from pipeline.report.inputs import ReportInputs, paper_table
from pipeline.report.ledger import LedgerRow
from pipeline.report.sections import combined, combined_tables
from pipeline.report.sections.combined_tables import PAGE
from pipeline.report.sections.noise_recorded import sources
from pipeline.report.spec import Block, Section
from pipeline.report.style import Drawing
from pipeline.report.tables import as_recorded

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

TITLE = "Blur and noise at once on recorded frames"


@style.styled
def curves_figure(curves: pd.DataFrame, dataset: str, paper: pd.DataFrame | None) -> Drawing:
    """Estimated MTF of one blur under growing noise: estimators down, experiments across.

    Args:
        curves: `pipeline.experiments.tables.CURVES` of one dataset, raw, mean of both directions, without a filter.
        dataset: name.
        paper: columns series, sigma_dn, frequency, mtf: the paper's photon noise with linear motion.
    """
    looks: Mapping[float, style.Look] = style.ordinal_looks(curves["target_sigma_dn"])
    theirs = None
    if paper is not None:
        theirs = paper[paper["series"] == "cnn"]
        theirs = theirs.assign(at=[FREQUENCIES[NOMINAL_FREQUENCIES.index(value)] for value in theirs["frequency"]])

    def panel(axes: Axes, rows: pd.DataFrame, key: str) -> None:
        if theirs is not None and key.endswith(" photon_linear"):
            lines(axes, theirs, "sigma_dn", looks, "at", "mtf", change=PAPER | {"linewidth": 0.7}, zorder=2)
        lines(axes, rows, "target_sigma_dn", looks, "frequency", "median")
        truth = rows[rows["target_sigma_dn"] == rows["target_sigma_dn"].min()].sort_values("frequency_index")
        axes.plot(truth["frequency"], truth["true_mtf"], zorder=4, **combined.TRUTH)

    highest = curves[curves["target_sigma_dn"] == curves["target_sigma_dn"].max()]
    distance = (highest["median"] - highest["true_mtf"]).abs().groupby([highest["estimator"], highest["experiment"]])
    words = [f"{word(str(name))}, {word(str(experiment))} {value:.2f}"
             for (name, experiment), value in distance.max().items()]  # fmt: skip
    alt = (
        f"Median MTF over patches of {word(dataset)} under a blur of {curves['kernel_size_px'].iloc[0]:g} px and "
        f"growing "
        f"noise. Largest distance from the ground truth at the strongest noise: {listing(words)}."
    )
    legend = [*ordinal_legend(looks, "DN", "no noise"), ("ground truth", combined.TRUTH)]
    shown = [
        "estimator",
        "experiment",
        "target_sigma_dn",
        "frequency",
        "true_mtf",
        "median",
        "minimum",
        "maximum",
        "count",
    ]
    return small_multiples(
        curves, Facet("estimator", in_order(curves["estimator"], ESTIMATORS)),
        Facet("experiment", in_order(curves["experiment"], EXPERIMENTS)), panel,
        x="frequency [fraction of Nyquist]", y="MTF", alt=alt,
        axes={"xlim": (0, 0.62), "ylim": (0, 1.03), "xticks": np.arange(0, 0.61, 0.2)},
        legend=legend if theirs is None else [*legend, ("the paper's CNN, Udacity", combined.THE_CNN)],
        values=curves[shown].sort_values(shown[:4]), panel_in=1.7, title_size=6.6,
    )  # fmt: skip


def _of_dataset(
    dataset: str, blur: pd.DataFrame, noise: pd.DataFrame, curves: pd.DataFrame, inputs: ReportInputs
) -> list[Block]:
    """Figures and tables of one dataset."""
    blocks: list[Block] = []
    selected = curves[(curves["dataset"] == dataset) & ~curves["calibrated"] & (curves["axis"] == "HV")]
    selected = selected[(selected["filter_px"] == 0) & (selected["experiment"] != "")]
    if len(selected):
        drawing = curves_figure(selected, dataset, paper_table(inputs, "photon_linear_motion_mtf.csv"))
        name, px = "recorded_combined_curves_{dataset}", selected["kernel_size_px"].iloc[0]
        blocks.append(PAGE.figure("recorded_curves", drawing, name=name, dataset=dataset, px=px))
    theirs = paper_table(inputs, "photon_defocus_amae.csv")
    for name in in_order(blur.loc[blur["dataset"] == dataset, "estimator"], ESTIMATORS):
        cells = blur[(blur["dataset"] == dataset) & (blur["estimator"] == name) & ~blur["calibrated"]]
        drawing, words = combined.amae_figure(cells, [dataset], theirs), {"dataset": dataset, "estimator": name}
        file = "recorded_combined_amae_{dataset}_{estimator}"
        blocks.append(PAGE.figure("recorded_amae", drawing, name=file, **words))
    if (noise["dataset"] == dataset).any():
        drawing, name = combined.noise_figure(noise, dataset), "recorded_combined_noise_{dataset}"
        blocks.append(PAGE.figure("recorded_noise", drawing, name=name, dataset=dataset))
    for experiment in in_order(blur.loc[blur["dataset"] == dataset, "experiment"], EXPERIMENTS):
        known = theirs if experiment == "photon_defocus" else None
        blocks.append(as_recorded(combined_tables.error(dataset, experiment, blur, known)))
    return blocks


def section(inputs: ReportInputs, ledger: Sequence[LedgerRow] = ()) -> Section | None:
    """Blur and noise at once on every recorded dataset, or None where nothing was recorded."""
    records, denoised = records_with(inputs, COMBINED_FILES[0]), records_with(inputs, DENOISED_FILE)
    if not records and not denoised:
        return None
    blocks: list[Block] = []
    if records:
        blocks.append(PAGE.table("recorded_combined_sources", sources(records, "blur_patches")))
        blur, noise, curves = (joined(inputs, name) for name in COMBINED_FILES)
        blur = blur[blur["experiment"] != ""]
        for record in records:
            blocks += _of_dataset(record.dataset, blur, noise, curves, inputs)
        blocks.append(as_recorded(combined_tables.abstentions(blur, noise)))
    paper, cells = paper_table(inputs, "improved_blur.csv"), joined(inputs, DENOISED_FILE)
    blocks += [as_recorded(combined_tables.denoised(record.dataset, cells, paper)) for record in denoised]
    return Section("combined_recorded", TITLE, (PAGE.text("recorded"),), blocks)
