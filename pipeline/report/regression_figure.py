"""The regression as pictures: fitted average precision over ISO and exposure time, and what it leaves over."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.report import style
from pipeline.report.style import Drawing
from pipeline.report.wording import listing

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

PANEL_IN = 1.7


def _fitted(axes: Axes, rows: pd.DataFrame) -> Any:
    grid = rows[rows["ap_percent"].isna()]
    table = grid.pivot(index="exposure_ms", columns="iso", values="fitted_percent").sort_index()
    x, y = table.columns.to_numpy(float), table.index.to_numpy(float)
    value = np.clip(table.to_numpy(float), 0.0, 100.0)
    image = axes.pcolormesh(x, y, value, vmin=0, vmax=100, cmap="viridis", shading="nearest", rasterized=True)
    lines = axes.contour(x, y, value, levels=[20, 40, 60, 80], colors=style.PAPER, linewidths=0.5)
    axes.clabel(lines, fontsize=5, fmt="%g")
    data = rows[rows["ap_percent"].notna()]
    axes.scatter(data["iso"], data["exposure_ms"], s=3, color=style.PAPER, edgecolors=style.INK, linewidths=0.3)
    return image


def _left(axes: Axes, rows: pd.DataFrame, reach: float) -> Any:
    data = rows[rows["ap_percent"].notna()]
    dots = axes.scatter(
        data["iso"], data["exposure_ms"], c=data["residual"], s=48, cmap="RdBu", vmin=-reach, vmax=reach,
        edgecolors=style.MUTED, linewidths=0.4,
    )  # fmt: skip
    for row in data.to_dict("records"):
        strong = abs(row["residual"]) > 0.6 * reach
        ink = style.PAPER if strong else style.INK
        axes.text(row["iso"], row["exposure_ms"], f"{row['residual']:.1f}", ha="center", va="center", fontsize=3.6,
                  color=ink)  # fmt: skip
    return dots


def _room(values: pd.Series) -> tuple[float, float]:
    """Limits that leave room for the marks of the outermost cells."""
    room = 0.08 * float(values.max() - values.min())
    return float(values.min()) - room, float(values.max()) + room


@style.styled
def draw(fitted: pd.DataFrame, titles: dict[str, str]) -> Drawing:
    """Two panels per fit: the fit (dots: measured cells), and measured less fitted.

    Args:
        fitted: `pipeline.curves.by_settings.FITTED` with a column ``fit``.
        titles: fit -> its title, in the order shown.
    """
    known = fitted[fitted["ap_percent"].notna()]
    reach = max(1.0, float(np.nanmax(np.abs(known["residual"]))))
    columns = 2 if len(titles) > 1 else 1
    down = -(-len(titles) // columns)
    width = style.TWO_COLUMNS_IN if columns == 2 else style.TWO_COLUMNS_IN * 0.6
    figure = style.new_figure(width, PANEL_IN * down + 0.4)
    panels = figure.subplots(down, 2 * columns, squeeze=False, sharey=True)
    image: Any = None
    dots: Any = None
    for number, (name, title) in enumerate(titles.items()):
        row, pair = divmod(number, columns)
        left, right = panels[row, 2 * pair], panels[row, 2 * pair + 1]
        own = fitted[fitted["fit"] == name]
        image, dots = _fitted(left, own), _left(right, own, reach)
        left.set_title("\n".join(title.rsplit(", ", 1)))
        right.set_title("measured − fitted")
        for axes in (left, right):
            axes.grid(False)
            axes.set_xlabel("ISO")
            axes.set(xlim=_room(known["iso"]), ylim=_room(known["exposure_ms"]))
        if pair == 0:
            left.set_ylabel("exposure time [ms]")
    for axes in panels.ravel()[2 * len(titles) :]:
        axes.set_visible(False)
    for mappable, title in ((image, "average precision [%]"), (dots, "residual [points]")):
        bar = figure.colorbar(mappable, ax=panels, shrink=0.85, pad=0.01, aspect=28)
        bar.set_label(title)
        bar.outline.set_visible(False)
    words = []
    for name, title in titles.items():
        own = known[known["fit"] == name]
        spread = f"{own['fitted_percent'].min():.0f} to {own['fitted_percent'].max():.0f} %"
        words.append(f"{title} {spread}, residuals up to {own['residual'].abs().max():.1f} points")
    alt = f"Fitted average precision over ISO and exposure time: {listing(words)}."
    return Drawing(figure, alt, known.sort_values(["fit", "iso", "exposure_ms"]))
