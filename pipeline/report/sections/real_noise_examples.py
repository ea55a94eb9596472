"""Three pictures as cameras and codecs deliver them, with the estimate for white noise and the default one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pipeline.report import style
from pipeline.report.real_noise_records import Examples
from pipeline.report.spec import Figure
from pipeline.report.style import Drawing
from pipeline.report.tables import records

BEFORE, NOW = "cellwise", "adaptive"
LABELS = {BEFORE: "white noise only", NOW: "default"}


def answer(row: Mapping[str, Any]) -> str:
    """An estimate in words: the median with its interval, or the reason of the abstentions."""
    patches, answered = int(row["patches"]), int(row["answered"])
    reasons = f"; abstained: {row['reasons']}" if row["reasons"] else ""
    if 2 * answered < patches:
        return f"abstained in {patches - answered} of {patches} ({str(row['reasons']).split(':')[0]})"
    estimate = f"{row['sigma_dn']:.2f} DN ({row['low_dn']:.2f} to {row['high_dn']:.2f})"
    return f"{estimate}{reasons}"


@style.styled
def crops(made: Examples) -> Drawing:
    """Crops side by side, with the noise present and both estimates below each.

    Args:
        made: the examples.
    """
    names = list(dict.fromkeys(made.table["example"]))
    figure = style.new_figure(style.TWO_COLUMNS_IN, 3.05)
    words = []
    for axes, name, crop in zip(figure.subplots(1, len(names), squeeze=False)[0], names, made.crops, strict=True):
        axes.imshow(np.asarray(crop), cmap="gray", vmin=0, vmax=255, interpolation="nearest")
        style.bare(axes)
        axes.set_title(name, fontsize=6.5)
        rows = {row["estimator"]: row for row in records(made.table[made.table["example"] == name])}
        lines = [f"present: {rows[NOW]['true_sigma_dn']:.2f} DN"]
        lines += [f"{LABELS[estimator]}: {answer(rows[estimator])}" for estimator in (BEFORE, NOW)]
        axes.set_xlabel("\n".join(lines), fontsize=5.6, linespacing=1.5)
        words.append(f"{name}: {'; '.join(lines)}")
    return Drawing(figure, f"Crops of three pictures with their noise estimates. {'. '.join(words)}.", made.table)


def block(made: Examples) -> Figure:
    """The figure with its caption."""
    caption = (
        "Pictures as cameras and codecs deliver them, 128 px of each, pixel for pixel. Present: median over patches of "
        "the noise in the picture. White noise only: the cell-wise estimator alone, whose answer on such pictures is "
        "near zero with a narrow interval. Default: the adaptive estimator. Medians over patches with their 95 % "
        f"intervals. Pictures: {made.source}."
    )
    return Figure("real_noise_examples", crops(made), caption)
