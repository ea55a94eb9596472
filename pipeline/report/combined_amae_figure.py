"""Error of the blur estimate over the noise level, coloured by the size of the blur: one panel per experiment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipeline.report import style
from pipeline.report.grades import grade_handles, grades
from pipeline.report.sharp_curves_figure import PAPER_DASH
from pipeline.report.style import Drawing
from pipeline.report.wording import EXPERIMENTS, in_order, listing, word

if TYPE_CHECKING:
    import pandas as pd

PANEL_IN = 1.72


@style.styled
def draw(cells: pd.DataFrame, datasets: Sequence[str], published: Mapping[str, pd.DataFrame] | None = None) -> Drawing:
    """Small multiples: datasets down, experiments across; one estimator's answers without smoothing.

    Args:
        cells: rows of `pipeline.condition.combined_tables.BLUR_CELLS` of one estimator, raw or calibrated.
        datasets: rows of the figure.
        published: experiment -> columns size_px, sigma_dn, amae_percent: the paper's, on Udacity.
    """
    from matplotlib.lines import Line2D

    plain = cells[cells["filter_px"] == 0]
    experiments = in_order(plain["experiment"], EXPERIMENTS)
    looks = grades(plain["size_px"])
    figure = style.new_figure(style.TWO_COLUMNS_IN, PANEL_IN * len(datasets) + 0.55)
    panels = figure.subplots(len(datasets), len(experiments), squeeze=False, sharex=True, sharey=True)
    theirs = published or {}
    paper_top = [table["amae_percent"].max() for name, table in theirs.items() if name in experiments]
    top = 1.05 * float(np.nanmax([*plain["amae_percent"], *paper_top, 5.0]))
    for down, dataset in enumerate(datasets):
        for across, experiment in enumerate(experiments):
            axes = panels[down, across]
            here = plain[(plain["dataset"] == dataset) & (plain["experiment"] == experiment)]
            if here.empty:
                axes.text(0.5, 0.5, "not run", transform=axes.transAxes, ha="center", va="center", color=style.MUTED)
            for size, look in looks.items():
                rows = here[here["size_px"] == size].sort_values("level_dn")
                level = rows["level_dn"].to_numpy()
                axes.fill_between(
                    level, rows["low_percent"].to_numpy(), rows["high_percent"].to_numpy(), color=look["color"],
                    alpha=0.12, linewidth=0,
                )  # fmt: skip
                axes.plot(level, rows["amae_percent"], zorder=3, **look)
                if experiment in theirs:
                    paper = theirs[experiment]
                    paper = paper[paper["size_px"] == size].sort_values("sigma_dn")
                    axes.plot(
                        paper["sigma_dn"], paper["amae_percent"], color=look["color"], linestyle=PAPER_DASH,
                        linewidth=0.8, zorder=2,
                    )  # fmt: skip
            axes.set(xlim=(0, float(plain["level_dn"].max())), ylim=(0, top))
            if down == 0:
                axes.set_title(word(experiment), fontsize=6.6)
            if down == len(datasets) - 1:
                axes.set_xlabel("noise level σ [DN]")
        panels[down, 0].set_ylabel(f"{word(dataset)}\nAMAE [%]")
    lines = grade_handles(looks, "px", "no blur")
    if any(name in experiments for name in theirs):
        line = {"color": style.MUTED, "linestyle": PAPER_DASH, "linewidth": 0.8}
        lines.append(Line2D([], [], label="the paper's CNN, Udacity", **line))  # type: ignore[arg-type]
    figure.legend(handles=lines, loc="outside upper center", ncols=min(len(lines), 8))
    shown = ["dataset", "experiment", "size_px", "level_dn"]
    values = plain[[*shown, "estimator", "calibrated", "amae_percent", "low_percent", "high_percent", "count"]]
    return Drawing(figure, _alt(plain, experiments), values.sort_values(shown))


def _alt(plain: pd.DataFrame, experiments: Sequence[str]) -> str:
    levels = sorted(set(plain["level_dn"]))
    words = []
    for name in experiments:
        own = plain[plain["experiment"] == name]
        first, last = (own.loc[own["level_dn"] == level, "amae_percent"].mean() for level in (levels[0], levels[-1]))
        words.append(f"{word(name)} {first:.1f} to {last:.1f} %")
    return (
        f"Error of the blur estimate over the noise level. Mean over datasets and sizes from {levels[0]:g} to "
        f"{levels[-1]:g} DN: {listing(words)}."
    )
