"""Learning curves as small multiples: one panel per network, held-out samples over training samples."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.report import style
from pipeline.report.learning_curves import LearningCurve
from pipeline.report.style import Drawing
from pipeline.report.wording import listing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ACROSS = 3
PANEL_IN = 1.75


def _panel(axes: Axes, one: LearningCurve) -> None:
    training, held_out = one.training(), one.held_out()
    if training is not None and len(training):
        axes.plot(training.index, training.to_numpy(), color=style.MUTED, linewidth=0.7, label="training samples")
    place = style.series_look(one.name.partition("_")[2])
    axes.plot(held_out.index, held_out.to_numpy(), color=place["color"], linewidth=1.2, label="held out")
    if one.chosen is not None and one.chosen in held_out.index:
        axes.plot(
            [one.chosen], [held_out[one.chosen]], marker="o", markersize=4, color=place["color"], linestyle="none",
            label="released",
        )  # fmt: skip
    seen = np.concatenate([held_out.to_numpy(), training.to_numpy() if training is not None else np.empty(0)])
    if seen.size and seen.min() > 0 and seen.max() > 8 * seen.min():
        from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.yaxis.set_minor_formatter(NullFormatter())
    unit = f" [{one.unit}]" if one.unit else ""
    axes.set(title=one.title, xlabel="step", ylabel=f"{one.measure_title}{unit}", xlim=(0, 1.03 * one.steps))
    axes.legend(loc="best", fontsize=5.4)


@style.styled
def draw(curves: Sequence[LearningCurve]) -> Drawing:
    """One panel per network.

    Args:
        curves: at least one.
    """
    import pandas as pd

    across = min(ACROSS, len(curves))
    down = -(-len(curves) // across)
    width = style.TWO_COLUMNS_IN * across / ACROSS
    figure = style.new_figure(max(width, style.ONE_COLUMN_IN), PANEL_IN * down + 0.1)
    panels = np.ravel(figure.subplots(down, across, squeeze=False))
    for axes, one in zip(panels, curves, strict=False):
        _panel(axes, one)
    for axes in panels[len(curves) :]:
        axes.set_axis_off()
    rows: list[dict[str, Any]] = []
    words = []
    for one in curves:
        parts = {"held out": one.held_out(), "training": one.training()}
        for which, values in parts.items():
            if values is not None:
                rows += [
                    {"network": one.name, "measure": one.measure, "samples": which, "step": step, "value": value}
                    for step, value in zip(values.index.tolist(), values.tolist(), strict=True)
                ]
        value = one.at_release(f"validation_{one.measure}")
        unit = f" {one.unit}" if one.unit else ""
        words.append(f"{one.title}, {one.measure_title} {value:.3g}{unit} after {one.steps:,} steps")
    alt = f"Learning curves on held-out and on training samples. At release: {listing(words)}."
    return Drawing(figure, alt, pd.DataFrame(rows))
