"""The paper's figure of uncorrupted datasets: the MTF that each estimator reads from sharp frames.

A panel shows, per estimator, the median over patches (line) and the range of the inliers (band) at the eight
frequencies. The paper's medians are dashed, in the colour of the estimator; it publishes the horizontal ones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.camera.mtf import DIRECTIONS, FREQUENCIES
from pipeline.report import style
from pipeline.report.ledger_sources import NOMINAL_FREQUENCIES
from pipeline.report.style import Drawing
from pipeline.report.wording import ESTIMATORS, in_order, listing, word

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

PANEL_IN = 1.62
PAPER_DASH = (0, (3, 1.6))
OURS: dict[str, Any] = {"linestyle": "-"}  # dashes tell the paper's curves from ours here, not estimators


def _ours(axes: Axes, rows: pd.DataFrame, estimators: Sequence[str], place: str) -> None:
    for position, estimator in enumerate(estimators):
        own = rows[rows["estimator"] == estimator].sort_values("place")
        if own.empty:
            continue
        look = style.series_look(estimator, position) | OURS
        frequency = FREQUENCIES[own["place"].to_numpy(int)]
        axes.fill_between(
            frequency, own["min"].to_numpy(), own["max"].to_numpy(), color=look["color"], alpha=0.13, linewidth=0,
            gid=style.series_id(estimator, f"band {place}"),
        )  # fmt: skip
        axes.plot(
            frequency, own["median"].to_numpy(), zorder=3, gid=style.series_id(estimator, f"median {place}"), **look
        )


def _published(axes: Axes, rows: pd.DataFrame, estimators: Sequence[str], place: str) -> None:
    for position, estimator in enumerate(estimators):
        own = rows[(rows["estimator"] == estimator) & (rows["statistic"] == "median")].sort_values("frequency")
        if not own.empty:
            axes.plot(
                FREQUENCIES[[NOMINAL_FREQUENCIES.index(value) for value in own["frequency"]]], own["mtf"].to_numpy(),
                color=style.series_look(estimator, position)["color"], linestyle=PAPER_DASH, linewidth=0.9, zorder=2,
                gid=style.series_id(estimator, f"paper {place}"),
            )  # fmt: skip


def _abstentions(axes: Axes, rows: pd.DataFrame, estimators: Sequence[str]) -> None:
    """Counts of patches without an answer, in the corner; the same for every frequency."""
    lines = []
    for name in estimators:
        own = rows[(rows["place"] == 0) & (rows["estimator"] == name)]
        abstained, answered = int(own["abstained"].sum()), int(own["count"].sum())
        if abstained:
            lines.append(f"{word(name)} abstained {abstained:,} of {abstained + answered:,}")
    axes.text(0.03, 0.04, "\n".join(lines), fontsize=4.6, color=style.MUTED, transform=axes.transAxes, va="bottom")


def handles(ours: Sequence[str], known: Sequence[str], has_published: bool) -> list[Line2D]:
    """The legend's lines: solid for estimators that ran, dashed for those of the paper only.

    Args:
        ours: estimators that ran.
        known: those and the paper's, in the order shown.
        has_published: the paper's curves are shown.
    """
    from matplotlib.lines import Line2D

    lines = []
    for position, name in enumerate(known):
        look = style.series_look(name, position) | OURS
        if name in ours:
            lines.append(Line2D([], [], label=word(name), **look))
        else:
            paper = {"color": look["color"], "linestyle": PAPER_DASH, "linewidth": 0.9}
            lines.append(Line2D([], [], label=f"{word(name)} (paper's only)", **paper))
    if has_published:
        lines.append(Line2D([], [], color=style.MUTED, linestyle=PAPER_DASH, linewidth=0.9, label="the paper's"))
    return lines


@style.styled
def draw(
    curves: pd.DataFrame,
    datasets: Sequence[str],
    published: pd.DataFrame | None = None,
    truths: Mapping[str, tuple[np.ndarray, np.ndarray]] | None = None,
) -> Drawing:
    """Small multiples: datasets down, horizontal and vertical beside each other.

    Args:
        curves: `pipeline.report.ledger_sources.sharp_curves`.
        datasets: rows of the figure; one without numbers is shown as not run.
        published: columns dataset, estimator, statistic, frequency, mtf: the paper's, horizontal.
        truths: dataset -> (K,) frequency as fraction of Nyquist and (K,) MTF, where a dataset's own is known.
    """
    from matplotlib.lines import Line2D

    theirs: list[str] = []
    if published is not None:
        theirs = [str(name) for name in published.loc[published["dataset"].isin(list(datasets)), "estimator"]]
    estimators = in_order(curves["estimator"], ESTIMATORS)
    known = in_order([*estimators, *(name for name in theirs if name != "ground_truth")], ESTIMATORS)
    figure = style.new_figure(style.TWO_COLUMNS_IN, PANEL_IN * len(datasets) + 0.62)
    panels = figure.subplots(len(datasets), 2, squeeze=False, sharex=True, sharey=True)
    shown_truth = False
    for down, dataset in enumerate(datasets):
        for across, axis in enumerate("HV"):
            axes, place = panels[down, across], f"{dataset} {axis}"
            rows = curves[(curves["dataset"] == dataset) & (curves["axis"] == axis)]
            if dataset in (truths or {}):
                frequency, truth = (np.asarray(values, dtype=float) for values in (truths or {})[dataset])
                inside = frequency <= 0.62
                axes.plot(frequency[inside], truth[inside], color=style.INK, linewidth=1.0, zorder=4)
                shown_truth = True
            if published is not None and axis == "H":
                _published(axes, published[published["dataset"] == dataset], known, place)
            if rows.empty:
                axes.text(0.5, 0.5, "not run", transform=axes.transAxes, ha="center", va="center", color=style.MUTED)
            else:
                _ours(axes, rows, known, place)
                _abstentions(axes, rows, estimators)
            axes.set(xlim=(0, 0.62), ylim=(0, 1.03), xticks=np.arange(0, 0.61, 0.1), yticks=np.arange(0, 1.01, 0.25))
            if down == 0:
                axes.set_title(DIRECTIONS[across].capitalize())
            if down == len(datasets) - 1:
                axes.set_xlabel("spatial frequency [fraction of Nyquist]")
        panels[down, 0].set_ylabel(f"{word(dataset)}\nMTF")
    lines = handles(estimators, known, bool(theirs))
    if shown_truth:
        lines.append(Line2D([], [], color=style.INK, linewidth=1.0, label="Siemens star"))
    figure.legend(handles=lines, loc="outside upper center", ncols=min(len(lines), 8))
    values = curves.drop(columns="place").sort_values(["dataset", "estimator", "axis", "frequency"])
    return Drawing(figure, _alt(curves, estimators, truths or {}), values, style.switches(known))


def _alt(curves: pd.DataFrame, estimators: Sequence[str], truths: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> str:
    if curves.empty:
        return "MTF of uncorrupted frames: not run."
    last = curves[(curves["place"] == curves["place"].max()) & (curves["axis"] == "H")]
    words = []
    for name in estimators:
        own = last[last["estimator"] == name]["median"]
        words.append(
            f"{word(name)} {own.min():.2f} to {own.max():.2f}" if len(own) > 1 else f"{word(name)} {own.min():.2f}"
        )
    stars = [
        f" The Siemens star of {word(dataset)} has {np.interp(FREQUENCIES[-1], frequency, truth):.2f} there."
        for dataset, (frequency, truth) in truths.items()
    ]
    return (
        f"MTF read from sharp frames of {listing(word(name) for name in curves['dataset'].unique())} over the paper's "
        f"eight frequencies. At the highest, {FREQUENCIES[-1]:.2f} of Nyquist, the horizontal medians are "
        f"{listing(words)}.{''.join(stars)}"
    )
