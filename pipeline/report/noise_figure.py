"""The paper's noise figure: estimated over true noise level, one panel per dataset and effect.

A panel shows, per estimator, the median (line) and the range of the inliers (band) over the level asked for. The
thin diagonal is that level; the dashed grey line is the noise really present, which lies lower where the 8-bit
range clips it. Abstentions are counted in the panel.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipeline.report import style
from pipeline.report.style import Drawing
from pipeline.report.wording import EFFECTS, ESTIMATORS, in_order, listing, word

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

PAPER_EFFECTS = ("photon", "dcsn", "readout", "combined")


def _panel(axes: Axes, rows: pd.DataFrame, estimators: Sequence[str], top: float, place: str) -> None:
    axes.plot([0, top], [0, top], color=style.MUTED, linewidth=0.6, zorder=1)
    if rows.empty:
        axes.text(0.5, 0.5, "not run", transform=axes.transAxes, ha="center", va="center", color=style.MUTED)
        return
    truth = rows.groupby("level_dn")["true_median_dn"].median()
    axes.plot(truth.index, truth.to_numpy(), color=style.INK, linewidth=0.9, linestyle=(0, (4, 2)), zorder=2)
    lines = 0
    for position, estimator in enumerate(estimators):
        own = rows[rows["estimator"] == estimator].sort_values("level_dn")
        if own.empty:
            continue
        look = style.series_look(estimator, position)
        level = own["level_dn"].to_numpy()
        axes.fill_between(
            level, own["minimum_dn"].to_numpy(), own["maximum_dn"].to_numpy(), color=look["color"], alpha=0.13,
            linewidth=0, gid=style.series_id(estimator, f"band {place}"),
        )  # fmt: skip
        axes.plot(
            level, own["median_dn"].to_numpy(), gid=style.series_id(estimator, f"median {place}"), zorder=3, **look
        )
        abstained, asked = int(own["abstained"].sum()), int(own["abstained"].sum() + own["count"].sum())
        if abstained:
            axes.text(
                0.03, 0.97 - 0.085 * lines, f"{word(estimator)} abstained {abstained:,} of {asked:,}", fontsize=4.6,
                color=style.MUTED, transform=axes.transAxes, va="top",
                gid=style.series_id(estimator, f"abstained {place}"),
            )  # fmt: skip
            lines += 1


@style.styled
def draw(summary: pd.DataFrame, datasets: Sequence[str]) -> Drawing:
    """Small multiples: datasets down, effects across.

    Args:
        summary: `pipeline.tables.NOISE_SUMMARY`.
        datasets: rows of the figure; one without numbers is shown as not run.
    """
    from matplotlib.lines import Line2D

    effects = in_order([*PAPER_EFFECTS, *summary["effect"]], EFFECTS)
    estimators = in_order(summary["estimator"], ESTIMATORS)
    # The bands are shown up to 40 DN; a single runaway estimate must not flatten every panel.
    tops = [25.0, summary["level_dn"].max(), summary["median_dn"].max(), min(40.0, summary["maximum_dn"].max())]
    highest = float(np.nanmax(tops))
    top = 5.0 * np.ceil(highest / 5.0)
    side = style.TWO_COLUMNS_IN / len(effects)
    figure = style.new_figure(style.TWO_COLUMNS_IN, len(datasets) * side * 0.98 + 0.45)
    axes = figure.subplots(len(datasets), len(effects), squeeze=False, sharex=True, sharey=True)
    for down, dataset in enumerate(datasets):
        for across, effect in enumerate(effects):
            panel = axes[down, across]
            chosen = (summary["dataset"] == dataset) & (summary["effect"] == effect)
            _panel(panel, summary[chosen], estimators, top, f"{dataset} {effect}")
            panel.set(
                xlim=(0, max(25.0, summary["level_dn"].max())), ylim=(0, top + 3), yticks=np.arange(0, top + 1, 5)
            )
            panel.set_xticks(np.arange(0, panel.get_xlim()[1] + 1, 5))
            if down == 0:
                panel.set_title(word(effect))
            if down == len(datasets) - 1:
                panel.set_xlabel("noise level σ [DN]")
        axes[down, 0].set_ylabel(f"{word(dataset)}\nestimated σ [DN]")
    handles = [
        Line2D([], [], label=word(name), **style.series_look(name, position))
        for position, name in enumerate(estimators)
    ]
    handles += [
        Line2D([], [], color=style.INK, linestyle=(0, (4, 2)), linewidth=0.9, label="noise really present"),
        Line2D([], [], color=style.MUTED, linewidth=0.6, label="level asked for"),
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=min(len(handles), 8))
    columns = ["dataset", "effect", "estimator", "level_dn", "true_median_dn", "median_dn", "minimum_dn", "maximum_dn"]
    values = summary[[*columns, "added_median_dn", "low_dn", "high_dn", "count", "rejected", "abstained"]].sort_values(
        columns[:4]
    )
    return Drawing(figure, _alt(summary, estimators), values, style.switches(estimators))


def _alt(summary: pd.DataFrame, estimators: Sequence[str]) -> str:
    if summary.empty:
        return "Noise estimation: not run."
    highest = summary[summary["level_dn"] == summary["level_dn"].max()]
    words = []
    for name in estimators:
        own = highest[highest["estimator"] == name]
        words.append(f"{word(name)} {own['median_dn'].min():.1f} to {own['median_dn'].max():.1f}")
    truth = f"{highest['true_median_dn'].min():.1f} to {highest['true_median_dn'].max():.1f}"
    return (
        f"Estimated noise over the level asked for, for {listing(word(name) for name in summary['dataset'].unique())}. "
        f"At {highest['level_dn'].iloc[0]:g} DN, where {truth} DN are really present, the medians over the panels are "
        f"{listing(words)} DN; {int(summary['abstained'].sum()):,} estimates were abstained from."
    )
