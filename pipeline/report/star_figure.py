"""The figure of Sim's sharpness: a Siemens star through the same rays; its MTF measured, by formula, as published."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from pipeline.errors import InputError
from pipeline.report import style
from pipeline.report.style import Drawing

if TYPE_CHECKING:
    import pandas as pd


@style.styled
def draw(
    image: np.ndarray,
    frequency: ArrayLike,
    measured: ArrayLike,
    formula: ArrayLike,
    published: pd.DataFrame | None = None,
) -> Drawing:
    """The star beside its MTF curves, with the difference between measurement and formula in the caption's numbers.

    Args:
        image: (H, W) star, uint8 or float in [0, 1].
        frequency: (K,) fractions of Nyquist.
        measured: (K,) contrast measured on the star.
        formula: (K,) contrast the renderer's sampling and lens imply.
        published: columns frequency, mtf: the star of the paper's Sim.

    Raises:
        InputError: the three curves differ in length.
    """
    import cv2
    import pandas as pd

    curve = {"frequency": frequency, "measured": measured, "formula": formula}
    curves = {name: np.asarray(values, dtype=float) for name, values in curve.items()}
    if len({values.shape for values in curves.values()}) != 1:
        shapes = {name: values.shape for name, values in curves.items()}
        raise InputError(f"star.json: frequency, measured and formula must have one length, not {shapes}")
    figure = style.new_figure(style.TWO_COLUMNS_IN, 2.7)
    left, right = figure.subplots(1, 2, width_ratios=[1, 1.5])
    picture = np.asarray(image)
    if max(picture.shape) > 512:
        size = tuple(round(side * 512 / max(picture.shape)) for side in picture.shape[1::-1])
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    left.imshow(picture, cmap="gray", vmin=0, vmax=1 if picture.dtype.kind == "f" else 255)
    style.bare(left)
    right.plot(
        curves["frequency"], curves["formula"], color=style.INK, linewidth=0.9, label="formula",
        gid=style.series_id("formula", "line"),
    )  # fmt: skip
    right.plot(
        curves["frequency"], curves["measured"], color=style.PALETTE[0], marker="o", linestyle="none",
        label="measured on the star", gid=style.series_id("measured", "points"),
    )  # fmt: skip
    series = [("formula", "formula", style.INK), ("measured", "measured", style.PALETTE[0])]
    if published is not None and not published.empty:
        right.plot(
            published["frequency"], published["mtf"], color=style.PALETTE[1], marker="s", linestyle=(0, (3, 2)),
            linewidth=0.8, label="the paper's Sim", gid=style.series_id("published", "line"),
        )  # fmt: skip
        series.append(("published", "the paper's Sim", style.PALETTE[1]))
    right.set(xlabel="spatial frequency [fraction of Nyquist]", ylabel="MTF", ylim=(0, 1.05), xlim=(0, None))
    right.legend(loc="lower left")
    error = np.abs(curves["measured"] - curves["formula"])
    worst = int(np.nanargmax(error))
    alt = (
        f"Siemens star and its MTF: measured {np.interp(0.5, curves['frequency'], curves['measured']):.3f} at half "
        f"Nyquist; measurement and formula differ by at most {error[worst]:.4f}, at "
        f"{curves['frequency'][worst]:.2f} of Nyquist."
    )
    return Drawing(figure, alt, pd.DataFrame(curves), tuple(series))
