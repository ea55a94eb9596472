"""The paper's isolated curves: average precision over estimated noise, and over estimated MTF, with intervals.

One row per class, one column per effect, one line per detector. A ring marks a point that does better than its less
noisy or sharper neighbour.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.report import style
from pipeline.report.style import Drawing
from pipeline.report.wording import DETECTORS, in_order, listing, word

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

PANEL_IN = 1.75
AXES = {"sigma_dn": "estimated noise σ [DN]", "mtf": "estimated MTF at 0.1 (sharp to blurred)"}


def _panel(axes: Axes, rows: pd.DataFrame, detectors: Sequence[str], place: str) -> None:
    for position, name in enumerate(detectors):
        own = rows[rows["detector"] == name].sort_values("at")
        if own.empty:
            continue
        look: dict[str, Any] = style.series_look(name, position)
        at, value = own["at"].to_numpy(), own["ap_percent"].to_numpy()
        low, high = own["low_percent"].to_numpy(), own["high_percent"].to_numpy()
        ends = np.flatnonzero(~own["joined"].to_numpy()) + 1
        for part in np.split(np.arange(len(own)), ends):
            if len(part):
                gid = style.series_id(name, f"{place} {part[0]}")
                axes.fill_between(
                    at[part], low[part], high[part], color=look["color"], alpha=0.15, linewidth=0, gid=gid
                )
                axes.plot(at[part], value[part], zorder=3, gid=style.series_id(name, f"line {place} {part[0]}"), **look)
        marked = own["non_monotonic"].to_numpy()
        ring = {"facecolors": "none", "edgecolors": look["color"], "linewidths": 0.7}
        axes.scatter(at[marked], value[marked], s=34, zorder=4, gid=style.series_id(name, f"rise {place}"), **ring)


@style.styled
def draw(curves: pd.DataFrame) -> Drawing:
    """Rows: classes; columns: noise, blur.

    Args:
        curves: `pipeline.curves.precision.ISOLATED` with a column ``detector``.
    """
    from matplotlib.lines import Line2D

    labels, detectors = sorted(set(curves["label"])), in_order(curves["detector"], DETECTORS)
    figure = style.new_figure(style.TWO_COLUMNS_IN, PANEL_IN * len(labels) + 0.5)
    panels = figure.subplots(len(labels), 2, squeeze=False, sharey=True)
    for down, label in enumerate(labels):
        for across, (quantity, title) in enumerate(AXES.items()):
            axes = panels[down, across]
            rows = curves[(curves["label"] == label) & (curves["quantity"] == quantity)]
            _panel(axes, rows, detectors, f"{label} {quantity}")
            axes.set(ylim=(0, 103), xlim=(-0.7, 27) if quantity == "sigma_dn" else (1.03, 0.0))
            if down == 0:
                axes.set_title("Noise alone" if quantity == "sigma_dn" else "Blur alone")
            if down == len(labels) - 1:
                axes.set_xlabel(title)
        panels[down, 0].set_ylabel(f"{word(label)}\naverage precision [%]")
    lines = [Line2D([], [], label=word(name), **style.series_look(name, place)) for place, name in enumerate(detectors)]
    ring: dict[str, Any] = {"marker": "o", "markersize": 6, "markerfacecolor": "none", "markeredgecolor": style.MUTED}
    lines.append(Line2D([], [], linestyle="none", label="better than its sharper or less noisy neighbour", **ring))
    figure.legend(handles=lines, loc="outside upper center", ncols=len(lines))
    values = curves.sort_values(["label", "quantity", "detector", "at"])
    return Drawing(figure, _alt(curves, labels, detectors), values, style.switches(detectors))


def _alt(curves: pd.DataFrame, labels: Sequence[str], detectors: Sequence[str]) -> str:
    words = []
    for label in labels:
        for name in detectors:
            own = curves[(curves["label"] == label) & (curves["detector"] == name)]
            parts = []
            for quantity, noun in (("sigma_dn", "noise"), ("mtf", "blur")):
                line = own[own["quantity"] == quantity].sort_values("at", ascending=quantity == "sigma_dn")
                if len(line):
                    first, last = line["ap_percent"].iloc[0], line["ap_percent"].iloc[-1]
                    parts.append(f"{first:.0f} to {last:.0f} % under {noun}")
            if parts:
                words.append(f"{word(name)}, {word(label)}: {listing(parts)}")
    return f"Average precision over estimated noise and MTF. From the mildest to the strongest: {'; '.join(words)}."
