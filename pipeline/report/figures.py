"""One mechanism for figures of small multiples: rows and columns of panels, and what one panel draws.

`grid` selects the rows of a data frame for each panel and places titles, axis labels, the legend, a colour bar and the
note on panels without data, as a description says; `lines` draws one line per series, with its band. A section
describes its figures in its YAML file and draws them by `pipeline.report.descriptions.Descriptions.grid`.
"""

from __future__ import annotations

import itertools
import math
import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pipeline.report import style
from pipeline.report.display_names import NAMES, in_order, short_word, word
from pipeline.report.style import Drawing, Look
from pipeline.report.tables import format_number, where

PAPER_DASH = (0, (3, 1.6))
PAPER: Look = {"linestyle": PAPER_DASH, "linewidth": 0.9, "marker": ""}
"""Changes to the look of a series for the paper's values."""

ROW_CHARACTERS = 30
"""In a line of a row's name, which stands along the panel's side."""

Panel = Callable[["Axes", "pd.DataFrame", str], Any]
Legend = Sequence[tuple[str, Look]]


@style.styled
def grid(
    about: Mapping[str, Any],
    frame: pd.DataFrame,
    alt: str,
    looks: Mapping[Any, Look],
    *,
    down: Sequence[Any] = (),
    across: Sequence[Any] = (),
    under: Panel | None = None,
    over: Panel | None = None,
    beside: pd.DataFrame | None = None,
    axes: Mapping[str, Any] | None = None,
    values: pd.DataFrame | None = None,
    legend: Legend = (),
    title: str = "",
    y: str = "",
    panel_in: float = 0.0,
    width_in: float = style.TWO_COLUMNS_IN,
) -> Drawing:
    """A grid of panels with common axes, each of the rows with one value down and one across.

    Args:
        about: ``down`` and ``across``: columns of the frame; ``headings``: of the values across (their display names by
            default; a text to fill in, or by value); ``lines``: arguments of `lines`, such as ``by``, ``x``, ``y`` and
            ``band`` (none without it); ``beside``: columns ``x`` and ``y`` of the paper's values, and changes to their
            ``look``; ``x`` (one, or by value across) and ``y``: labels; ``axes`` and ``axes_across``:
            settings of every panel (`Axes.set`), and by value across; ``bar``: label of a colour bar; ``values`` and
            ``sort``: columns of the numbers plotted, and those to sort them by; ``panel_in`` and ``margin_in``: height
            of a row of panels and of everything else, inches; ``title_size`` of the headings and ``title_pad`` below
            them, points; ``share_x`` and ``share_y``: whether panels share an axis (all by default); ``absent``: text
            in a panel without rows.
        frame: long table.
        alt: description for readers who do not see the figure.
        looks: look of each series of the lines; a reader may switch off those that have a name.
        down: values down, in order; those of the frame by default.
        across: likewise across.
        under: draws into each panel before the lines; gets a key that is unique to the panel, for SVG ids.
        beside: the paper's values, drawn in the panels that they belong to.
        over: draws after them; may return what the colour bar is of.
        axes: further settings of every panel.
        values: the numbers plotted, where these are not the frame; see `Drawing`.
        legend: label and look of every entry.
        title: of the legend; none by default.
        y: label, in place of that of the description.
        panel_in: in place of that of the description.
        width_in: of the figure.
    """
    rows, columns = (
        list(chosen) or in_order(frame[about[side]], NAMES.get(about[side], ()))
        for side, chosen in (("down", down), ("across", across))
    )
    x = about["x"]
    height_in = (panel_in or about.get("panel_in", 1.72)) * len(rows) + about.get("margin_in", 0.55)
    figure = style.new_figure(width_in, height_in)
    share_x, share_y = (about.get(f"share_{axis}", True) for axis in "xy")
    panels = figure.subplots(len(rows), len(columns), squeeze=False, sharex=share_x, sharey=share_y)
    look = {key: about[name] for key, name in (("fontsize", "title_size"), ("pad", "title_pad")) if name in about}
    mappable = None
    for (row, upper), (column, left) in itertools.product(enumerate(rows), enumerate(columns)):
        spot, key, sides = panels[row, column], f"{upper} {left}", {about["down"]: upper, about["across"]: left}
        shown = where(frame, **sides)
        if under is not None:
            under(spot, shown, key)
        if "lines" in about:
            lines(spot, shown, looks=looks, key=key, **about["lines"])
        if beside is not None:
            _paper_lines(
                spot, where(beside, **{name: sides[name] for name in sides if name in beside}), about, looks, key
            )
        if over is not None:
            mappable = over(spot, shown, key) or mappable
        if shown.empty:
            absent = about.get("absent", "not run")
            spot.text(0.5, 0.5, absent, transform=spot.transAxes, ha="center", va="center", color=style.MUTED)
        spot.set(**{**about.get("axes", {}), **(axes or {}), **about.get("axes_across", {}).get(left, {})})
        if row == 0:
            spot.set_title(_heading(about, left), **look)
        if row == len(rows) - 1:
            spot.set_xlabel(x[left] if isinstance(x, dict) else x)
        if column == 0:
            spot.set_ylabel(f"{textwrap.fill(word(upper), ROW_CHARACTERS)}\n{y or about['y']}")
    add_legend(figure, legend, title)
    if "bar" in about and mappable is not None:
        style.colour_bar(figure, mappable, panels, about["bar"], shrink=0.9, pad=0.01)
    plotted = frame if values is None else values
    plotted = plotted[about["values"]] if "values" in about else plotted
    series = style.switches(name for name in looks if isinstance(name, str))
    return Drawing(figure, alt, plotted.sort_values(about["sort"]) if "sort" in about else plotted, series)


def _paper_lines(
    spot: Axes, values: pd.DataFrame, about: Mapping[str, Any], looks: Mapping[Any, Look], key: str
) -> None:
    """Draw the paper's values into a panel, in the looks of our lines, changed."""
    ends = {end: about["beside"][end] for end in ("x", "y")}
    change = PAPER | about["beside"].get("look", {})
    lines(spot, values, about["lines"]["by"], looks, **ends, change=change, part="paper", key=key, zorder=2)


def _heading(about: Mapping[str, Any], value: Any) -> str:
    """What stands above the panels of a value across."""
    headings = about.get("headings") or {value: word(value)}
    return headings.format(value) if isinstance(headings, str) else headings[value]


HANDLE_IN, CHARACTER_IN = 0.5, 0.05
"""Widths in a legend: of an entry's handle with its margins, and of a character."""

MOST_COLUMNS = 8
"""Of a legend."""


def add_legend(figure: Figure, legend: Legend, title: str = "") -> None:
    """One legend above all panels, under its title where it has one."""
    if legend:
        handles = [Line2D([], [], label=label, **look) for label, look in legend]
        columns = legend_columns([label for label, _ in legend], figure.get_figwidth())
        figure.legend(handles=handles, loc="outside upper center", ncols=columns, title=title or None)


def legend_columns(labels: Sequence[str], width_in: float) -> int:
    """The number of columns with which a legend has the fewest rows that fit into a width.

    Args:
        labels: of the entries, in order; a column is as wide as its longest.
        width_in: inches.

    Returns:
        at most `MOST_COLUMNS`; 1 where nothing fits.
    """
    for rows in range(1, len(labels)):
        columns = math.ceil(len(labels) / rows)
        longest = [max(map(len, part)) for part in np.array_split(list(labels), columns)]  # as matplotlib fills them
        width = sum(HANDLE_IN + CHARACTER_IN * length for length in longest)
        if columns <= MOST_COLUMNS and width <= width_in:
            return columns
    return 1


def lines(
    axes: Axes,
    rows: pd.DataFrame,
    by: str,
    looks: Mapping[Any, Look],
    x: str,
    y: str,
    *,
    band: tuple[str, str] | None = None,
    alpha: float = 0.13,
    ring: Sequence[str] = (),
    change: Look | None = None,
    zorder: float = 3,
    part: str = "line",
    key: str = "",
) -> None:
    """One line per series that has rows, with its band and rings about marked points.

    ``by``, ``x`` and ``y`` are columns: of the series, and of the two axes; ``looks``: series -> look, in the order
    drawn, with a ``change`` to all, e.g. `PAPER`; ``band``: columns of its edges; ``ring``: boolean columns, a point is
    ringed where any holds; ``part`` and ``key`` (of the panel) are in the SVG ids by which a series is switched off.
    """
    for name, look in looks.items():
        own = rows[rows[by] == name].sort_values(x, kind="stable")
        if own.empty:
            continue
        at = own[x].to_numpy(float)

        def gid(kind: str, name: Any = name) -> str | None:
            return style.series_id(name, f"{kind} {key}") if isinstance(name, str) else None

        if band is not None:
            low, high = (own[edge].to_numpy(float) for edge in band)
            if len(at) > 1:
                axes.fill_between(at, low, high, color=look["color"], alpha=alpha, linewidth=0, gid=gid("band"))
            else:  # a band has no width here
                axes.vlines(at, low, high, color=look["color"], alpha=3 * alpha, linewidth=0.8, gid=gid("band"))
        axes.plot(at, own[y].to_numpy(float), zorder=zorder, gid=gid(part), **(look | (change or {})))
        if ring:
            marked = own[list(ring)].any(axis=1).to_numpy()
            axes.scatter(
                at[marked], own[y].to_numpy(float)[marked], s=30, zorder=4, facecolors="none",
                edgecolors=look["color"], linewidths=0.7, gid=gid("rise"),
            )  # fmt: skip


def small_mtf_axes(axes: Axes) -> None:
    """Limits and small ticks of a panel of MTF curves over the paper's frequencies, beneath a picture."""
    axes.set(xlim=(0, 0.62), ylim=(0, 1.03), yticks=[0, 0.5, 1])
    axes.set_xticks([0, 0.3, 0.6], ["0", "0.3", "0.6"])
    for label, side in zip(axes.get_xticklabels(), ("left", "center", "right"), strict=True):
        label.set(horizontalalignment=side)  # so that labels of neighbouring panels do not touch
    axes.tick_params(labelsize=4.8, pad=1, length=1.5)


LIGHT_BELOW = 55.0  # percent up to which a number in a cell is white


def ink_on(percent: float) -> str:
    """Colour in which a number is readable on a cell of `cell_map`."""
    return style.PAPER if percent < LIGHT_BELOW else style.INK


def cell_map(axes: Axes, percent: np.ndarray, x: Sequence[str], y: Sequence[str]) -> Any:
    """A heat map of (rows, columns) from 0 to 100 with its number in every cell, white where it is NaN.

    ``x`` and ``y`` name columns and rows. Returns what a colour bar is of.
    """
    colours = mpl.colormaps["viridis"].with_extremes(bad=style.PAPER)
    image = axes.pcolormesh(np.ma.masked_invalid(percent), vmin=0, vmax=100, cmap=colours, linewidth=0)
    for (row, column), value in np.ndenumerate(percent):
        if np.isfinite(value):
            axes.text(column + 0.5, row + 0.5, f"{value:.0f}", ha="center", va="center", fontsize=5.7,
                      color=ink_on(value))  # fmt: skip
    axes.set_xticks(np.arange(len(x)) + 0.5, x)
    axes.set_yticks(np.arange(len(y)) + 0.5, y)
    axes.grid(False)
    return image


RING: Look = {
    "linestyle": "none", "marker": "o", "markersize": 6, "markerfacecolor": "none", "markeredgecolor": style.MUTED,
}  # fmt: skip
"""Legend entry of the rings that `lines` draws."""


def beside_the_paper(looks: Mapping[str, Look], ours: Sequence[str], has_paper: bool) -> list[tuple[str, Look]]:
    """Legend of estimators: solid where they ran, dashed where only the paper has them."""
    entries = [
        (word(name), look) if name in ours else (f"{word(name)} (paper's only)", look | PAPER)
        for name, look in looks.items()
    ]
    return [*entries, ("the paper's", PAPER | {"color": style.MUTED})] if has_paper else entries


def ordinal_legend(looks: Mapping[float, Look], unit: str, zero: str) -> list[tuple[str, Look]]:
    """Legend of an ordered quantity (`style.ordinal_looks`)."""
    return [(f"{format_number(value)} {unit}" if value else zero, look) for value, look in looks.items()]


def legend_of(looks: Mapping[str, Look]) -> list[tuple[str, Look]]:
    """Legend of named series."""
    return [(word(name), look) for name, look in looks.items()]


def abstentions(axes: Axes, rows: pd.DataFrame, key: str, estimators: Sequence[str], *, at_top: bool = True) -> None:
    """Text in a corner of the panel: how many patches each estimator abstained from, where it did."""
    counts = rows.groupby("estimator")[["abstained", "count"]].sum()
    shown = [name for name in estimators if name in counts.index and counts["abstained"][name]]
    for line, name in enumerate(shown):
        abstained = int(counts["abstained"][name])
        total = abstained + int(counts["count"][name])
        height = 0.97 - 0.085 * line if at_top else 0.04 + 0.085 * (len(shown) - 1 - line)
        axes.text(
            0.03, height, f"{short_word(name)} abstained {abstained:,} of {total:,}", fontsize=4.6, color=style.MUTED,
            transform=axes.transAxes, va="top" if at_top else "bottom", gid=style.series_id(name, f"abstained {key}"),
        )  # fmt: skip
