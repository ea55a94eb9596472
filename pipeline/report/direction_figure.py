"""Average precision by the direction of the blur: one panel per detector and noise level, one line per angle."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from pipeline.report import style
from pipeline.report.style import Drawing
from pipeline.report.wording import DETECTORS, in_order, word

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

PANEL_IN = 1.55


def _look(position: int) -> dict[str, Any]:
    return style.series_look("", position) | {"linestyle": "-"}


def _panel(axes: Axes, rows: pd.DataFrame, angles: Sequence[float]) -> None:
    for position, angle in enumerate(angles):
        own = rows[rows["angle_deg"] == angle].sort_values("size_px")
        look = _look(position)
        axes.plot(own["size_px"], own["ap_percent"], zorder=3, **look)
        axes.fill_between(
            own["size_px"], own["low_percent"], own["high_percent"], color=look["color"], alpha=0.08, linewidth=0
        )
        marked = own[own["rises_with_size"] | own["rises_with_sigma"]]
        ring: dict[str, Any] = {"facecolors": "none", "edgecolors": look["color"], "linewidths": 0.7}
        axes.scatter(marked["size_px"], marked["ap_percent"], s=30, zorder=4, **ring)


@style.styled
def draw(table: pd.DataFrame, label: str) -> Drawing:
    """Rows: detectors; columns: noise levels.

    Args:
        table: `pipeline.curves.directions.TABLE` with a column ``detector``.
        label: the class shown.
    """
    from matplotlib.lines import Line2D

    rows = table[table["label"] == label]
    detectors, levels = in_order(rows["detector"], DETECTORS), sorted(set(rows["level_dn"]))
    angles = sorted(set(rows["angle_deg"]))
    figure = style.new_figure(style.TWO_COLUMNS_IN, PANEL_IN * len(detectors) + 0.5)
    panels = figure.subplots(len(detectors), len(levels), squeeze=False, sharex=True, sharey=True)
    for down, name in enumerate(detectors):
        for across, level in enumerate(levels):
            axes = panels[down, across]
            _panel(axes, rows[(rows["detector"] == name) & (rows["level_dn"] == level)], angles)
            axes.set(ylim=(0, 103), xticks=sorted(set(rows["size_px"])))
            if down == 0:
                axes.set_title(f"noise of {level:g} DN")
            if down == len(detectors) - 1:
                axes.set_xlabel("length of the blur [px]")
        panels[down, 0].set_ylabel(f"{word(name)}\n{word(label).lower()} AP [%]")
    lines = [Line2D([], [], label=f"{angle:g}°", **_look(place)) for place, angle in enumerate(angles)]
    ring: dict[str, Any] = {"marker": "o", "markersize": 6, "markerfacecolor": "none", "markeredgecolor": style.MUTED}
    lines.append(Line2D([], [], linestyle="none", label="better than with less blur or noise", **ring))
    figure.legend(handles=lines, loc="outside upper center", ncols=len(lines))
    return Drawing(figure, _alt(rows, label), rows.sort_values(["detector", "level_dn", "angle_deg", "size_px"]))


def _alt(rows: pd.DataFrame, label: str) -> str:
    quiet = rows[(rows["level_dn"] == rows["level_dn"].min()) & (rows["size_px"] == rows["size_px"].max())]
    words = []
    for name, own in quiet.groupby("detector"):
        best, worst = own.loc[own["ap_percent"].idxmax()], own.loc[own["ap_percent"].idxmin()]
        words.append(
            f"{word(str(name))} {best['ap_percent']:.0f} % at {best['angle_deg']:g} degrees and"
            f" {worst['ap_percent']:.0f} % at {worst['angle_deg']:g} degrees"
        )
    return (
        f"Average precision of {label} over length and direction of the blur. With the longest blur and the least"
        f" noise: {'; '.join(words)}."
    )
