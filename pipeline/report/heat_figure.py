"""Heat maps of average precision over estimated noise and MTF: the paper's combined curves, one panel per detector.

A cell is the mean of its conditions. A small triangle marks cells that do better than a less noisy or sharper one, a
filled triangle those that do so in at least 97.5 % of the bootstrap draws.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipeline.report import style
from pipeline.report.style import Drawing
from pipeline.report.wording import DETECTORS, in_order, listing, word

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

PANEL_IN = 1.72
COLOURS = "viridis"
LIGHT_BELOW = 55.0


def _panel(axes: Axes, rows: pd.DataFrame) -> object:
    import matplotlib as mpl

    table = rows.pivot(index="sigma_bin_dn", columns="mtf_bin", values="ap_percent").sort_index()
    table = table[sorted(table.columns, reverse=True)]
    colours = mpl.colormaps[COLOURS].with_extremes(bad=style.PAPER)
    image = axes.pcolormesh(np.ma.masked_invalid(table.to_numpy(float)), vmin=0, vmax=100, cmap=colours, linewidth=0)
    place = {name: number for number, name in enumerate(table.columns)}
    down = {name: number for number, name in enumerate(table.index)}
    for row in rows[rows["count"] > 0].to_dict("records"):
        x, y = place[row["mtf_bin"]] + 0.5, down[row["sigma_bin_dn"]] + 0.5
        ink = style.PAPER if row["ap_percent"] < LIGHT_BELOW else style.INK
        axes.text(x, y, f"{row['ap_percent']:.0f}", ha="center", va="center", fontsize=5.6, color=ink)
        if row["non_monotonic"]:
            face = ink if row["certainly"] else "none"
            axes.scatter([x + 0.32], [y + 0.3], marker="^", s=6, facecolors=face, edgecolors=ink, linewidths=0.5)
    axes.grid(False)
    axes.set_xticks(np.arange(len(place)) + 0.5, [f"{name:g}" for name in place])
    axes.set_yticks(np.arange(len(down)) + 0.5, [f"{name:g}" for name in down])
    return image


@style.styled
def draw(heat: pd.DataFrame) -> Drawing:
    """Rows: classes; columns: detectors.

    Args:
        heat: `pipeline.curves.precision.HEAT` with a column ``detector``.
    """
    labels, detectors = sorted(set(heat["label"])), in_order(heat["detector"], DETECTORS)
    width = style.TWO_COLUMNS_IN if len(detectors) > 1 else style.TWO_COLUMNS_IN * 0.6
    figure = style.new_figure(width, PANEL_IN * len(labels) + 0.35)
    panels = figure.subplots(len(labels), len(detectors), squeeze=False, sharex=True, sharey=True)
    image = None
    for down, label in enumerate(labels):
        for across, name in enumerate(detectors):
            axes = panels[down, across]
            rows = heat[(heat["label"] == label) & (heat["detector"] == name)]
            if rows.empty:
                axes.text(0.5, 0.5, "too few cells", transform=axes.transAxes, ha="center", color=style.MUTED)
                continue
            image = _panel(axes, rows)
            if down == 0:
                axes.set_title(word(name))
            if down == len(labels) - 1:
                axes.set_xlabel("estimated MTF at 0.1 (bin)")
        panels[down, 0].set_ylabel(f"{word(label)}\nestimated noise σ [DN] (bin)")
    bar = figure.colorbar(image, ax=panels, shrink=0.9, pad=0.01)  # type: ignore[arg-type]
    bar.set_label("average precision [%]")
    bar.outline.set_visible(False)
    values = heat[heat["count"] > 0].sort_values(["label", "detector", "sigma_bin_dn", "mtf_bin"])
    return Drawing(figure, _alt(values), values)


def _alt(cells: pd.DataFrame) -> str:
    words = []
    for (label, name), own in cells.groupby(["label", "detector"]):
        rises = int(own["non_monotonic"].sum())
        words.append(
            f"{word(str(name))}, {word(str(label))}: {own['ap_percent'].min():.0f} to {own['ap_percent'].max():.0f} %"
            f" over {len(own)} cells, {rises} better than a milder one ({int(own['certainly'].sum())} certainly)"
        )
    return f"Average precision over estimated noise and MTF. {listing(words)}."
