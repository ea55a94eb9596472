"""AMAE over the size of the blur: Table I of the paper as curves, one panel per dataset and kind of blur.

A panel shows each estimator's AMAE (line) with its bootstrap 95 % interval (band); the paper's values are dashed, in
the colour of the estimator.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipeline.report import style
from pipeline.report.sharp_curves_figure import OURS, PAPER_DASH, handles
from pipeline.report.style import Drawing
from pipeline.report.wording import BLURS, ESTIMATORS, in_order, listing, word

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

PANEL_IN = 1.72


def _panel(axes: Axes, ours: pd.DataFrame, theirs: pd.DataFrame, estimators: Sequence[str], place: str) -> None:
    for position, name in enumerate(estimators):
        look = style.series_look(name, position) | OURS
        paper = theirs[theirs["estimator"] == name].sort_values("size_px")
        if not paper.empty:
            axes.plot(
                paper["size_px"], paper["amae_percent"], color=look["color"], linestyle=PAPER_DASH, linewidth=0.9,
                zorder=2, gid=style.series_id(name, f"paper {place}"),
            )  # fmt: skip
        own = ours[ours["estimator"] == name].sort_values("size_px")
        if own.empty:
            continue
        size = own["size_px"].to_numpy()
        axes.fill_between(
            size, own["low_percent"].to_numpy(), own["high_percent"].to_numpy(), color=look["color"], alpha=0.16,
            linewidth=0, gid=style.series_id(name, f"band {place}"),
        )  # fmt: skip
        axes.plot(size, own["amae_percent"].to_numpy(), zorder=3, gid=style.series_id(name, f"amae {place}"), **look)
    if ours.empty:
        axes.text(0.5, 0.5, "not run", transform=axes.transAxes, ha="center", va="center", color=style.MUTED)


@style.styled
def draw(summary: pd.DataFrame, datasets: Sequence[str], published: pd.DataFrame | None = None) -> Drawing:
    """Small multiples: datasets down, kinds of blur across.

    Args:
        summary: rows of `pipeline.blur.evaluation.SUMMARY`, of sharp frames without, all raw or all calibrated.
        datasets: rows of the figure; one without numbers is shown as not run.
        published: columns dataset, estimator, blur, size_px, amae_percent: the paper's Table I.
    """
    import pandas as pd

    columns = ["dataset", "estimator", "blur", "size_px", "amae_percent"]
    paper = published if published is not None else pd.DataFrame({name: [] for name in columns})
    paper = paper[paper["dataset"].isin(list(datasets))]
    kinds = in_order([*summary["kind"], *paper["blur"]], BLURS)
    estimators = in_order([*summary["estimator"], *paper["estimator"]], ESTIMATORS)
    sizes = sorted({*summary["size_px"], *paper["size_px"]})
    figure = style.new_figure(style.TWO_COLUMNS_IN, PANEL_IN * len(datasets) + 0.62)
    panels = figure.subplots(len(datasets), len(kinds), squeeze=False, sharex=True, sharey=True)
    top = float(np.nanmax([*summary["amae_percent"], *paper["amae_percent"], 10.0]))
    for down, dataset in enumerate(datasets):
        for across, kind in enumerate(kinds):
            axes = panels[down, across]
            ours = summary[(summary["dataset"] == dataset) & (summary["kind"] == kind)]
            theirs = paper[(paper["dataset"] == dataset) & (paper["blur"] == kind)]
            _panel(axes, ours, theirs, estimators, f"{dataset} {kind}")
            axes.set(xticks=sizes, ylim=(0, 1.04 * top))
            if down == 0:
                axes.set_title(word(kind))
            if down == len(datasets) - 1:
                axes.set_xlabel("size of the blur [px]")
        panels[down, 0].set_ylabel(f"{word(dataset)}\nAMAE [%]")
    lines = handles(in_order(summary["estimator"], ESTIMATORS), estimators, not paper.empty)
    figure.legend(handles=lines, loc="outside upper center", ncols=min(len(lines), 8))
    shown = ["dataset", "kind", "size_px", "estimator", "calibrated", "amae_percent", "low_percent", "high_percent"]
    values = summary[[*shown, "count", "abstained"]].sort_values(shown[:4])
    beside = paper.rename(columns={"blur": "kind", "amae_percent": "paper_amae_percent"})
    values = values.merge(beside, how="left", on=["dataset", "kind", "size_px", "estimator"])
    return Drawing(figure, _alt(summary, estimators), values, style.switches(estimators))


def _alt(summary: pd.DataFrame, estimators: Sequence[str]) -> str:
    if summary.empty:
        return "AMAE of blur estimators: not run."
    words = []
    for name in estimators:
        own = summary.loc[summary["estimator"] == name, "amae_percent"]
        if len(own):
            words.append(f"{word(name)} {own.mean():.1f} % (worst {own.max():.1f} %)")
    return (
        f"AMAE over the size of the blur for {listing(word(name) for name in summary['dataset'].unique())}. Mean over "
        f"datasets, kinds and sizes: {listing(words)}."
    )
