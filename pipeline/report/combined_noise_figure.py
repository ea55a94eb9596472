"""Noise read from blurred frames: estimated over true level, coloured by the size of the blur, one row per estimator.

Noise that comes after the optics is as sharp as ever, whatever the blur, and should be read at its level. Noise that
was in the light has been blurred with the picture: what is left of it (dashed) is little.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipeline.report import style
from pipeline.report.grades import grade_handles, grades
from pipeline.report.style import Drawing
from pipeline.report.wording import ESTIMATORS, EXPERIMENTS, in_order, listing, word

if TYPE_CHECKING:
    import pandas as pd

PANEL_IN = 1.7


@style.styled
def draw(cells: pd.DataFrame, dataset: str) -> Drawing:
    """Small multiples of one dataset: estimators down, experiments across.

    Args:
        cells: `pipeline.condition.combined_tables.NOISE_CELLS`.
        dataset: name.
    """
    from matplotlib.lines import Line2D

    own = cells[cells["dataset"] == dataset]
    estimators = in_order(own["estimator"], ESTIMATORS)
    experiments = in_order(own["experiment"], EXPERIMENTS)
    looks = grades(own["size_px"])
    highest = float(own["level_dn"].max())
    top = 1.06 * float(np.nanmax([highest, *own["median_dn"], *own["added_median_dn"]]))
    figure = style.new_figure(style.TWO_COLUMNS_IN, PANEL_IN * len(estimators) + 0.55)
    panels = figure.subplots(len(estimators), len(experiments), squeeze=False, sharex=True, sharey=True)
    for down, estimator in enumerate(estimators):
        for across, experiment in enumerate(experiments):
            axes = panels[down, across]
            axes.plot([0, highest], [0, highest], color=style.MUTED, linewidth=0.6, zorder=1)
            here = own[(own["estimator"] == estimator) & (own["experiment"] == experiment)]
            for size, look in looks.items():
                rows = here[here["size_px"] == size].sort_values("level_dn")
                level = rows["level_dn"].to_numpy()
                axes.plot(
                    level, rows["added_median_dn"], color=look["color"], linewidth=0.7, linestyle=(0, (2, 1.5)),
                    zorder=2,
                )  # fmt: skip
                axes.plot(level, rows["median_dn"], zorder=3, **look)
            axes.set(xlim=(0, highest), ylim=(0, top))
            if down == 0:
                axes.set_title(word(experiment), fontsize=6.6)
            if down == len(estimators) - 1:
                axes.set_xlabel("noise level σ [DN]")
        panels[down, 0].set_ylabel(f"{word(estimator)}\nestimated σ [DN]")
    lines = grade_handles(looks, "px", "no blur")
    lines.append(Line2D([], [], color=style.INK, linestyle=(0, (2, 1.5)), linewidth=0.7, label="present, unclipped"))
    lines.append(Line2D([], [], color=style.MUTED, linewidth=0.6, label="level asked for"))
    figure.legend(handles=lines, loc="outside upper center", ncols=min(len(lines), 8))
    shown = ["estimator", "experiment", "size_px", "level_dn"]
    values = own[[*shown, "median_dn", "low_dn", "high_dn", "added_median_dn", "true_median_dn", "count", "abstained"]]
    return Drawing(figure, _alt(own, dataset, estimators), values.sort_values(shown))


def _alt(own: pd.DataFrame, dataset: str, estimators: list[str]) -> str:
    blurred = own[(own["level_dn"] == own["level_dn"].max()) & (own["size_px"] > 0)]
    words = []
    for name in estimators:
        rows = blurred[blurred["estimator"] == name]
        for effect in in_order(rows["effect"], ["dcsn", "photon"]):
            median = rows.loc[rows["effect"] == effect, "median_dn"]
            words.append(f"{word(name)} reads {median.min():.1f} to {median.max():.1f} DN of {word(effect)} noise")
    level = float(own["level_dn"].max())
    return f"Noise read from blurred frames of {word(dataset)}. At a level of {level:g} DN {listing(words)}."
