"""Figures of detection: isolated curves and heat maps (IOPC), AP by blur direction, regression over camera settings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.report import style
from pipeline.report.display_names import DETECTORS, in_order, listing, word
from pipeline.report.figures import RING, Facet, cell_map, ink_on, lines, small_multiples
from pipeline.report.style import Drawing
from pipeline.report.tables import records

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

QUANTITIES = {
    "sigma_dn": ("Noise alone", "noise", "estimated noise σ [DN]"),
    "mtf": ("Blur alone", "blur", "estimated MTF at 0.1 (sharp to blurred)"),
}


@style.styled
def iopc(curves: pd.DataFrame) -> Drawing:
    """The paper's isolated curves: AP over estimated noise and over estimated MTF; classes down, quantities across.

    A ring marks a point whose AP exceeds that of its less noisy or sharper neighbour.

    Args:
        curves: `pipeline.curves.precision.ISOLATED` with a column ``detector``.
    """
    labels = sorted(set(curves["label"]))
    looks = style.series_looks(in_order(curves["detector"], DETECTORS))

    def panel(axes: Axes, rows: pd.DataFrame, key: str) -> None:
        for name, look in looks.items():
            own = rows[rows["detector"] == name].sort_values("quantity_value")
            ends = np.flatnonzero(~own["joined"].to_numpy(bool)) + 1  # where the curve is interrupted
            for part in filter(len, np.split(np.arange(len(own)), ends)):
                lines(
                    axes, own.iloc[part], "detector", {name: look}, "quantity_value", "ap_percent",
                    band=("low_percent", "high_percent"), alpha=0.15, ring=["non_monotonic"], key=f"{key} {part[0]}",
                )  # fmt: skip

    words = []
    for label in labels:
        for name in looks:
            own = curves[(curves["label"] == label) & (curves["detector"] == name)]
            parts = []
            for quantity, (_, noun, _) in QUANTITIES.items():
                line = own[own["quantity"] == quantity].sort_values("quantity_value", ascending=quantity == "sigma_dn")
                if len(line):
                    parts.append(
                        f"{line['ap_percent'].iloc[0]:.0f} to {line['ap_percent'].iloc[-1]:.0f} % under {noun}"
                    )
            if parts:
                words.append(f"{word(name)}, {word(label)}: {listing(parts)}")
    return small_multiples(
        curves, Facet("label", labels), Facet("quantity", list(QUANTITIES), lambda name: QUANTITIES[name][0]), panel,
        x=lambda name: QUANTITIES[name][2], y="average precision [%]",
        axes=lambda name: {"ylim": (0, 103), "xlim": (-0.7, 27) if name == "sigma_dn" else (1.03, 0.0)},
        alt=f"Average precision over estimated noise and MTF. From the mildest to the strongest: {'; '.join(words)}.",
        legend=[*((word(name), look) for name, look in looks.items()),
                ("better than its sharper or less noisy neighbour", RING)],
        values=curves.sort_values(["label", "quantity", "detector", "quantity_value"]), series=style.switches(looks),
        panel_in=1.75, margin_in=0.5, share_x=False,
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


@style.styled
def heat(cells: pd.DataFrame) -> Drawing:
    """Heat maps of AP over estimated noise and MTF, the paper's combined curves: classes down, detectors across.

    A cell is the mean of its conditions. A triangle marks cells whose AP exceeds that of a less noisy or sharper one, a
    filled triangle those that do so with certainty (`pipeline.curves.surface.Surface.certainty`).

    Args:
        cells: `pipeline.curves.precision.HEAT` with a column ``detector``.
    """
    labels, detectors = sorted(set(cells["label"])), in_order(cells["detector"], DETECTORS)
    for name in ("sigma_bin_dn", "mtf_bin"):  # bins that no panel measured would be empty stripes
        cells = cells[cells[name].isin(cells.loc[cells["count"] > 0, name])]
    values = cells[cells["count"] > 0].sort_values(["label", "detector", "sigma_bin_dn", "mtf_bin"])
    words = [
        f"{word(str(name))}, {word(str(label))}: {own['ap_percent'].min():.0f} to {own['ap_percent'].max():.0f} %"
        f" over {len(own)} cells, {int(own['non_monotonic'].sum())} better than a milder one"
        f" ({int(own['certainly'].sum())} certainly)"
        for (label, name), own in values.groupby(["label", "detector"])
    ]
    return small_multiples(
        cells, Facet("label", labels), Facet("detector", detectors), _heat_panel,
        x="estimated MTF at 0.1 (bin)", y="estimated noise σ [DN] (bin)", bar="average precision [%]",
        alt=f"Average precision over estimated noise and MTF. {listing(words)}.", values=values, margin_in=0.35,
        width_in=style.TWO_COLUMNS_IN * (1.0 if len(detectors) > 1 else 0.6), absent="too few cells",
    )  # fmt: skip


@style.styled
def direction(cells: pd.DataFrame, label: str) -> Drawing:
    """AP over the length of the blur, one line per direction: detectors down, noise levels across.

    Args:
        cells: `pipeline.curves.directions.TABLE` with a column ``detector``.
        label: the class shown.
    """
    rows = cells[cells["label"] == label]
    angles = sorted(set(rows["angle_deg"]))
    looks = {angle: style.series_look("", position) | {"linestyle": "-"} for position, angle in enumerate(angles)}

    def panel(axes: Axes, own: pd.DataFrame, key: str) -> None:
        lines(
            axes, own, "angle_deg", looks, "kernel_size_px", "ap_percent", band=("low_percent", "high_percent"),
                alpha=0.08,
            ring=["rises_with_size", "rises_with_sigma"],
        )  # fmt: skip

    words = []
    quiet = rows[
        (rows["target_sigma_dn"] == rows["target_sigma_dn"].min())
        & (rows["kernel_size_px"] == rows["kernel_size_px"].max())
    ]
    for name, own in quiet.groupby("detector"):
        best, worst = own.loc[own["ap_percent"].idxmax()], own.loc[own["ap_percent"].idxmin()]
        words.append(
            f"{word(str(name))} {best['ap_percent']:.0f} % at {best['angle_deg']:g} degrees and"
            f" {worst['ap_percent']:.0f} % at {worst['angle_deg']:g} degrees"
        )
    alt = (
        f"Average precision of {label} over length and direction of the blur. With the longest blur and the least"
        f" noise: {'; '.join(words)}."
    )
    levels = Facet("target_sigma_dn", sorted(set(rows["target_sigma_dn"])), lambda level: f"noise of {level:g} DN")
    return small_multiples(
        rows, Facet("detector", in_order(rows["detector"], DETECTORS)), levels, panel,
        x="length of the blur [px]", y=f"{word(label).lower()} AP [%]", alt=alt,
        axes={"ylim": (0, 103), "xticks": sorted(set(rows["kernel_size_px"]))},
        legend=[*((f"{angle:g}°", look) for angle, look in looks.items()),
                ("better than with less blur or noise", RING)],
        values=rows.sort_values(["detector", "target_sigma_dn", "angle_deg", "kernel_size_px"]), panel_in=1.55,
            margin_in=0.5,
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
        data["iso"], data["exposure_ms"], c=data["residual"], s=48, cmap="RdBu", vmin=-reach, vmax=reach,
        edgecolors=style.MUTED, linewidths=0.4,
    )  # fmt: skip
    for row in records(data):
        ink = style.PAPER if abs(row["residual"]) > 0.6 * reach else style.INK
        axes.text(row["iso"], row["exposure_ms"], f"{row['residual']:.1f}", ha="center", va="center", fontsize=3.6,
                  color=ink)  # fmt: skip
    return dots


def _limits(values: pd.Series) -> tuple[float, float]:
    """Limits with a margin for the marks of the outermost cells."""
    margin = 0.08 * float(values.max() - values.min())
    return float(values.min()) - margin, float(values.max()) + margin


@style.styled
def regression(fitted: pd.DataFrame, titles: Mapping[str, str]) -> Drawing:
    """Two panels per fit: fitted AP over ISO and exposure time (dots: measured cells), and measured less fitted.

    Args:
        fitted: `pipeline.curves.iso_exposure.FITTED` with a column ``fit``.
        titles: fit -> its title, in the order shown.
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
        reached = f"{data['fitted_percent'].min():.0f} to {data['fitted_percent'].max():.0f} %"
        words.append(f"{title} {reached}, residuals up to {data['residual'].abs().max():.1f} points")
    for axes in panels.ravel()[2 * len(titles) :]:
        axes.set_visible(False)
    for mappable, title in ((image, "average precision [%]"), (dots, "residual [points]")):
        style.colour_bar(figure, mappable, panels, title, shrink=0.85, pad=0.01, aspect=28)
    alt = f"Fitted average precision over ISO and exposure time: {listing(words)}."
    return Drawing(figure, alt, known.sort_values(["fit", "iso", "exposure_ms"]))
