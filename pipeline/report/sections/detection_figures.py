"""Figures of detection: isolated curves and heat maps (IOPC), AP by blur direction, regression over camera settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.path import Path

from pipeline.report import style
from pipeline.report.descriptions import Descriptions
from pipeline.report.display_names import DETECTORS, in_order, listing
from pipeline.report.figures import RING, cell_map, ink_on, legend_of, lines
from pipeline.report.tables import format_number, ordered, records, where

PAGE = Descriptions("detection")
LEAST_APART_PX = 4
RESIDUAL_PT = 10.5
"""Width of the mark of a residual, which holds a sign and two digits."""

WIDE = Path([(-1.0, -0.6), (1.0, -0.6), (1.0, 0.6), (-1.0, 0.6), (-1.0, -0.6)])
"""Outline of that mark, a lying rectangle."""

CAUSES = {"sigma_dn": "noise", "mtf": "blur"}


def iopc(curves: pd.DataFrame) -> style.Drawing:
    """The paper's isolated curves: AP over estimated noise and over estimated MTF; classes down, quantities across.

    A ring marks a point whose AP exceeds that of its less noisy or sharper neighbour.

    ``curves``: `pipeline.curves.precision.ISOLATED` with a column ``detector``.
    """
    looks = style.series_looks(in_order(curves["detector"], DETECTORS))

    def joined(axes: Axes, rows: pd.DataFrame, key: str) -> None:
        for name, look in looks.items():
            own = where(rows, detector=name).sort_values("quantity_value")
            ends = np.flatnonzero(~own["joined"].to_numpy(bool)) + 1  # where the curve is interrupted
            for part in filter(len, np.split(np.arange(len(own)), ends)):
                lines(
                    axes, own.iloc[part], "detector", {name: look}, "quantity_value", "ap_percent",
                    band=("low_percent", "high_percent"), alpha=0.15, ring=["non_monotonic"], key=f"{key} {part[0]}",
                )  # fmt: skip

    words: list[dict[str, Any]] = []
    for (label, name), own in ordered(curves, label=(), detector=DETECTORS).groupby(["label", "detector"], sort=False):
        parts = []
        for quantity, cause in CAUSES.items():
            line = where(own, quantity=quantity).sort_values("quantity_value", ascending=quantity == "sigma_dn")
            if len(line):
                first, last = line["ap_percent"].iloc[0], line["ap_percent"].iloc[-1]
                parts.append(f"{first:.0f} to {last:.0f} % under {cause}")
        words.append({"label": label, "detector": name, "parts": listing(parts)})
    return PAGE.grid(
        "iopc", curves, PAGE.alt("iopc", words), looks, across=list(CAUSES), over=joined,
        legend=[*legend_of(looks), ("better than its sharper or less noisy neighbour", RING)],
    )  # fmt: skip


def _heat_panel(axes: Axes, rows: pd.DataFrame, key: str) -> Any:
    if rows.empty:
        return None
    cells = rows.pivot(index="sigma_bin_dn", columns="mtf_bin", values="ap_percent").sort_index()
    cells = cells[sorted(cells.columns, reverse=True)]
    x, y = list(cells.columns), list(cells.index)
    image = cell_map(axes, cells.to_numpy(float), [f"{name:g}" for name in x], [f"{name:g}" for name in y])
    for row in records(rows[(rows["count"] > 0) & rows["non_monotonic"]]):
        ink = ink_on(row["ap_percent"])
        spot = x.index(row["mtf_bin"]) + 0.82, y.index(row["sigma_bin_dn"]) + 0.8
        face = ink if row["certainly"] else "none"
        axes.scatter(*spot, marker="^", s=6, facecolors=face, edgecolors=ink, linewidths=0.5)
    return image


def heat(cells: pd.DataFrame) -> style.Drawing:
    """Heat maps of AP over estimated noise and MTF, the paper's combined curves: classes down, detectors across.

    A cell is the mean of its conditions. A triangle marks cells whose AP exceeds that of a less noisy or sharper one, a
    filled triangle those that do so with certainty (`pipeline.curves.surface.Surface.certainty`).

    ``cells``: `pipeline.curves.precision.HEAT` with a column ``detector``.
    """
    for name in ("sigma_bin_dn", "mtf_bin"):  # bins that no panel measured would be empty stripes
        cells = cells[cells[name].isin(cells.loc[cells["count"] > 0, name])]
    values = cells[cells["count"] > 0]
    words = values.groupby(["label", "detector"], as_index=False).agg(
        least=("ap_percent", "min"), most=("ap_percent", "max"), cells=("ap_percent", "size"),
        rises=("non_monotonic", "sum"), certain=("certainly", "sum"),
    )  # fmt: skip
    wide = cells["detector"].nunique() > 1
    return PAGE.grid(
        "iopc_heat", cells, PAGE.alt("iopc_heat", words), {}, over=_heat_panel, values=values,
        width_in=style.TWO_COLUMNS_IN * (1.0 if wide else 0.6),
    )  # fmt: skip


def _apart(sizes: Sequence[float]) -> list[float]:
    """Sizes whose labels do not touch in a narrow panel: at least `LEAST_APART_PX` from the one before."""
    shown: list[float] = []
    for size in sizes:
        if not shown or size - shown[-1] >= LEAST_APART_PX:
            shown.append(size)
    return shown


def direction(cells: pd.DataFrame, label: str) -> style.Drawing:
    """AP over the length of the blur, one line per direction: detectors down, noise levels across.

    ``cells``: `pipeline.curves.directions.TABLE` with a column ``detector``.
    """
    rows = cells[cells["label"] == label]
    angles = sorted(set(rows["angle_deg"]))
    looks = {angle: style.series_look("", position) | {"linestyle": "-"} for position, angle in enumerate(angles)}
    quiet = rows[rows["target_sigma_dn"] == rows["target_sigma_dn"].min()]
    groups = where(quiet, kernel_size_px=rows["kernel_size_px"].max()).groupby("detector")["ap_percent"]
    ends = zip(groups.idxmax().items(), groups.idxmin(), strict=True)
    words = [{"detector": name, "best": quiet.loc[best], "worst": quiet.loc[worst]} for (name, best), worst in ends]
    return PAGE.grid(
        "direction", rows, PAGE.alt("direction", words, label=label), looks, y=PAGE.text("ap_of", label=label),
        axes={"xticks": _apart(sorted(set(rows["kernel_size_px"])))},
        legend=[*((f"{angle:g}°", look) for angle, look in looks.items()),
                ("better than with less blur or noise", RING)],
    )  # fmt: skip


def _fitted(axes: Axes, rows: pd.DataFrame) -> Any:
    grid = rows[rows["ap_percent"].isna()].pivot(index="exposure_ms", columns="iso", values="fitted_percent")
    grid = grid.sort_index()
    x, y = grid.columns.to_numpy(float), grid.index.to_numpy(float)
    value = np.clip(grid.to_numpy(float), 0.0, 100.0)
    image = axes.pcolormesh(x, y, value, vmin=0, vmax=100, cmap="viridis", shading="nearest", rasterized=True)
    contours = axes.contour(x, y, value, levels=[20, 40, 60, 80], colors=style.PAPER, linewidths=0.5)
    axes.clabel(contours, fontsize=5, fmt="%g")
    data = rows[rows["ap_percent"].notna()]
    axes.scatter(data["iso"], data["exposure_ms"], s=3, color=style.PAPER, edgecolors=style.INK, linewidths=0.3)
    return image


def _residuals(axes: Axes, rows: pd.DataFrame, reach: float) -> Any:
    data = rows[rows["ap_percent"].notna()]
    dots = axes.scatter(
        data["iso"], data["exposure_ms"], c=data["residual"], s=RESIDUAL_PT**2, marker=WIDE, cmap="RdBu", vmin=-reach,
        vmax=reach, edgecolors=style.MUTED, linewidths=0.4,
    )  # fmt: skip
    for row in records(data):
        ink = style.PAPER if abs(row["residual"]) > 0.5 * reach else style.INK
        axes.text(row["iso"], row["exposure_ms"], format_number(row["residual"], 0), ha="center", va="center",
                  fontsize=4.4, color=ink)  # fmt: skip
    return dots


def _limits(values: pd.Series) -> tuple[float, float]:
    """Limits with a margin for the marks of the outermost cells."""
    margin = 0.08 * float(values.max() - values.min())
    return float(values.min()) - margin, float(values.max()) + margin


def regression(fitted: pd.DataFrame, titles: Mapping[str, str]) -> style.Drawing:
    """Two panels per fit: fitted AP over ISO and exposure time (dots: measured cells), and measured less fitted.

    ``fitted``: `pipeline.curves.iso_exposure.FITTED` with a column ``fit``, a key of ``titles``.
    """
    known = fitted[fitted["ap_percent"].notna()]
    reach = max(1.0, float(np.nanmax(np.abs(known["residual"]))))
    columns = 2 if len(titles) > 1 else 1
    down = -(-len(titles) // columns)
    figure = style.new_figure(style.TWO_COLUMNS_IN * (1.0 if columns == 2 else 0.6), 1.7 * down + 0.4)
    panels = figure.subplots(down, 2 * columns, squeeze=False, sharey=True)
    words, image, dots = [], None, None
    for number, (name, title) in enumerate(titles.items()):
        row, pair = divmod(number, columns)
        left, right = panels[row, 2 * pair], panels[row, 2 * pair + 1]
        own = fitted[fitted["fit"] == name]
        image, dots = _fitted(left, own), _residuals(right, own, reach)
        left.set_title("\n".join(title.rsplit(", ", 1)))
        right.set_title("measured − fitted")
        for axes in (left, right):
            axes.grid(False)
            axes.set(xlabel="ISO", xlim=_limits(known["iso"]), ylim=_limits(known["exposure_ms"]))
        if pair == 0:
            left.set_ylabel("exposure time [ms]")
        data = known[known["fit"] == name]
        ends = {"least": data["fitted_percent"].min(), "most": data["fitted_percent"].max()}
        words.append({"title": title, **ends, "residual": data["residual"].abs().max()})
    for axes in panels.ravel()[2 * len(titles) :]:
        axes.set_visible(False)
    for mappable, title in ((image, "average precision [%]"), (dots, "residual [points]")):
        style.colour_bar(figure, mappable, panels, title, shrink=0.85, pad=0.01, aspect=28)
    return style.Drawing(figure, PAGE.alt("regression", words), known.sort_values(["fit", "iso", "exposure_ms"]))
