"""One blur under growing noise: the patch as recorded, and the MTF read, one row per experiment.

Curves are medians over all patches of the dataset, the mean of horizontal and vertical, as the paper draws them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.camera.mtf import FREQUENCIES
from pipeline.report import style
from pipeline.report.grades import grade_handles, grades
from pipeline.report.ledger_sources import NOMINAL_FREQUENCIES
from pipeline.report.sharp_curves_figure import PAPER_DASH
from pipeline.report.style import Drawing
from pipeline.report.wording import listing, word

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

ROW_IN = 1.5
SHOWN = 3  # pictures in a row


def _curves(axes: Axes, rows: pd.DataFrame, looks: Mapping[float, dict[str, Any]]) -> None:
    for level, look in looks.items():
        curve = rows[rows["level_dn"] == level].sort_values("place")
        axes.plot(curve["frequency"], curve["median"], zorder=3, linewidth=0.9, markersize=2.2, **look)
    truth = rows[rows["level_dn"] == rows["level_dn"].min()].sort_values("place")
    axes.plot(truth["frequency"], truth["true_mtf"], color=style.INK, linewidth=1.3, zorder=4)


@style.styled
def draw(
    curves: pd.DataFrame,
    arrays: Mapping[str, np.ndarray],
    said: Mapping[str, Any],
    published: Mapping[str, pd.DataFrame] | None = None,
) -> Drawing:
    """One dataset's example.

    Args:
        curves: rows of `pipeline.condition.combined_tables.CURVES` of one dataset and estimator, raw.
        arrays: ``level_<experiment>_<number>``.
        said: ``example.json`` of the stage `combined`.
        published: experiment -> columns series, sigma_dn, frequency, mtf: the paper's.
    """
    from matplotlib.lines import Line2D

    entries: Sequence[Mapping[str, Any]] = said["experiments"]
    looks = grades(curves["level_dn"])
    mean = curves[curves["axis"] == "HV"]
    filters = sorted(set(mean["filter_px"]))[:2]
    figure = style.new_figure(style.TWO_COLUMNS_IN, ROW_IN * len(entries) + 0.5)
    widths = [1.0] * SHOWN + [1.55] * len(filters)
    panels = figure.subplots(len(entries), len(widths), squeeze=False, width_ratios=widths)
    shown_paper = False
    for down, entry in enumerate(entries):
        levels = list(entry["levels_dn"])
        for cell, number in enumerate(np.linspace(0, len(levels) - 1, SHOWN).round().astype(int)):
            axes = panels[down, cell]
            axes.imshow(arrays[f"level_{entry['experiment']}_{number}"], cmap="gray", vmin=0, vmax=255)
            style.bare(axes)
            axes.set_xlabel(f"σ {levels[number]:g} DN", fontsize=5.6, labelpad=1.5)
        panels[down, 0].set_ylabel(word(entry["experiment"]), fontsize=6.0)
        for cell, filter_px in enumerate(filters, SHOWN):
            axes = panels[down, cell]
            rows = mean[(mean["experiment"] == entry["experiment"]) & (mean["filter_px"] == filter_px)]
            if not rows.empty:
                _curves(axes, rows, looks)
            paper = (published or {}).get(entry["experiment"])
            if paper is not None and filter_px == 0:
                shown_paper = True
                for level, look in looks.items():
                    curve = paper[(paper["series"] == "cnn") & (paper["sigma_dn"] == level)].sort_values("frequency")
                    places = [NOMINAL_FREQUENCIES.index(value) for value in curve["frequency"]]
                    axes.plot(FREQUENCIES[places], curve["mtf"], color=look["color"], linestyle=PAPER_DASH, lw=0.7)
            axes.set(xlim=(0, 0.62), ylim=(0, 1.03), xticks=np.arange(0, 0.61, 0.2), yticks=np.arange(0, 1.01, 0.5))
            if down == 0:
                axes.set_title("as recorded" if filter_px == 0 else f"smoothed before ({filter_px:g} px)",
                               fontsize=6.2)  # fmt: skip
            if down == len(entries) - 1:
                axes.set_xlabel("frequency [fraction of Nyquist]", fontsize=6.0)
            if cell == SHOWN:
                axes.set_ylabel("MTF", labelpad=1)
    lines = grade_handles(looks, "DN", "no noise")
    lines.append(Line2D([], [], color=style.INK, linewidth=1.3, label="truth"))
    if shown_paper:
        line = {"color": style.MUTED, "linestyle": PAPER_DASH, "linewidth": 0.7}
        lines.append(Line2D([], [], label="the paper's CNN, Udacity", **line))  # type: ignore[arg-type]
    figure.legend(handles=lines, loc="outside upper center", ncols=min(len(lines), 8))
    keys = ["experiment", "filter_px", "level_dn", "axis", "place"]
    values = curves[[*keys, "frequency", "true_mtf", "median", "minimum", "maximum", "count"]].sort_values(keys)
    return Drawing(figure, _alt(mean[mean["filter_px"] == 0], said, looks), values.drop(columns="place"))


def _alt(mean: pd.DataFrame, said: Mapping[str, Any], looks: Mapping[float, Any]) -> str:
    highest = max(looks)
    words = []
    for entry in said["experiments"]:
        rows = mean[(mean["experiment"] == entry["experiment"]) & (mean["level_dn"] == highest)]
        if len(rows):
            error = (rows["median"] - rows["true_mtf"]).abs().max()
            words.append(f"{word(entry['experiment'])} {error:.2f}")
    return (
        f"A patch of {word(said['dataset'])} under a blur of {said['size_px']:g} px and growing noise, with the MTF "
        f"read. Largest distance of the median from the truth at {highest:g} DN: {listing(words)}."
    )
