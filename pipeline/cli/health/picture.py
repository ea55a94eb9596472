"""A frame's condition as a picture: its noise cell by cell, its blur patch by patch, and the mean curves beside."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

import numpy as np

from pipeline.camera.mtf import FREQUENCIES
from pipeline.condition.summary import half_contrast
from pipeline.condition.verdict import REASONS, bound_words
from pipeline.report import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from pipeline.condition import Condition

LEAST_TOP_DN = 5.0  # of the noise's colours: a clean frame shall look clean
SHARPEST = FREQUENCIES[-1]
STRENGTH = 0.55  # of the colours over the frame
ACROSS_IN, DPI = 4.2, 240  # on the page a picture is half as wide: text of 6 pt is then 10 px high
NUMBERS_PT, LEAST_NUMBERS_PT = 6.0, 4.0  # in the patches; smaller numbers cannot be read and are left out
CHARACTER_EM, LINE_EM = 0.62, 1.3  # width of a digit and height of a line with its margin, in font sizes
LEFT_IN, RIGHT_IN, BOTTOM_IN = 0.3, 0.62, 0.4  # margins, inches, with the labels of axes and colour bars
TITLE_IN, GAP_IN = 0.25, 0.06  # above each panel, and above the curves' title
TITLE_LINE_IN, TITLE_CHARACTERS = 0.13, 58  # of each more line of a title, and characters that a line holds
CURVES_IN = 1.65
BAR_IN, BAR_GAP_IN = 0.16, 0.07  # width of a colour bar, and distance to its panel


@style.styled
def draw(image: NDArray[np.float32], condition: Condition) -> NDArray[np.uint8]:
    """The picture.

    Args:
        image: (H, W) in [0, 1], the frame.
        condition: its condition.

    Returns:
        (h, w, 3) RGB.
    """
    # Panels of fixed sizes: a layout engine takes a third of the time.
    across_in = ACROSS_IN
    panel_in = across_in - LEFT_IN - RIGHT_IN
    tall_in = min(max(panel_in * image.shape[0] / image.shape[1], 1.2), 7.0)
    heights_in = (tall_in, tall_in, CURVES_IN)
    more_in = TITLE_LINE_IN * _noise_title(condition).count("\n")
    total_in = sum(heights_in) + len(heights_in) * TITLE_IN + more_in + GAP_IN + BOTTOM_IN
    figure = style.new_figure(across_in, total_in)
    figure.set_layout_engine("none")
    panels, below_in = [], total_in
    for height_in, gap_in in zip(heights_in, (more_in, 0, GAP_IN), strict=True):
        below_in -= TITLE_IN + gap_in + height_in
        panels.append(
            figure.add_axes((LEFT_IN / across_in, below_in / total_in, panel_in / across_in, height_in / total_in))
        )
    _noise(panels[0], image, condition)
    _blur(panels[1], image, condition)
    _curves(panels[2], condition)
    figure.set_dpi(DPI)
    figure.canvas.draw()
    pixels: NDArray[np.uint8] = np.asarray(figure.canvas.buffer_rgba())[..., :3].copy()  # type: ignore[attr-defined]
    return pixels


def _noise(axes: Axes, image: NDArray[np.float32], condition: Condition) -> None:
    _over(axes, image, _noise_title(condition))
    cells = condition.noise.map_dn
    known_cells = cells[np.isfinite(cells)]
    top = max(LEAST_TOP_DN, float(np.percentile(known_cells, 99)) if known_cells.size else 0.0)
    _map(axes, image, cells, top, "viridis", "σ [DN]")


def _noise_title(condition: Condition) -> str:
    """Noise of the frame, or why it is unknown, in lines that are no longer than the picture is wide."""
    sigma = condition.sigma_dn
    known = np.isfinite(sigma.value)
    reasons = condition.reasons["noise"]
    why = max(reasons, key=lambda reason: reasons[reason]) if reasons else ""
    without = ", ".join(filter(None, ["no estimate", REASONS.get(why, why), bound_words(condition.noise.at_most_dn)]))
    interval = f" ({sigma.low:.2f} to {sigma.high:.2f})" if np.isfinite(sigma.high) else ""
    reported = f"σ {sigma.value:.2f} DN{interval}" if known else without
    return textwrap.fill(f"Noise: {reported}", TITLE_CHARACTERS)


def _blur(axes: Axes, image: NDArray[np.float32], condition: Condition) -> None:
    rows, columns = condition.blur.grid
    halves = half_contrast(condition.blur.map_mtf)
    reported = int((~np.isnan(halves).any(axis=-1)).sum()) if rows else 0
    _over(axes, image, f"Blur: {reported} of {rows * columns} patches; half contrast, H over V")
    if not rows:
        return
    halves = np.minimum(halves, SHARPEST)
    _map(axes, image, halves.mean(axis=-1), SHARPEST, "cividis", "half contrast [Nyquist]")
    height, width = image.shape
    size_pt = _numbers_pt(axes, rows, columns)
    for row, column in np.ndindex(rows, columns) if size_pt >= LEAST_NUMBERS_PT else ():
        pair = halves[row, column]
        words = "\n".join(f">{SHARPEST:.2f}" if value >= SHARPEST else f"{value:.2f}" for value in pair)
        axes.text(
            (column + 0.5) * width / columns - 0.5, (row + 0.5) * height / rows - 0.5,
            words if np.isfinite(pair).all() else "–", ha="center", va="center", fontsize=size_pt, color="white",
            bbox={"facecolor": (0, 0, 0, 0.45), "edgecolor": "none", "pad": 0.8},
        )  # fmt: skip


def _numbers_pt(axes: Axes, rows: int, columns: int) -> float:
    """Font size of the two numbers, one over the other, that fit into every patch."""
    figure, panel = axes.get_figure(root=True), axes.get_position()
    assert figure is not None
    across_in, tall_in = figure.get_size_inches()
    wide_pt, high_pt = 72 * across_in * panel.width / columns, 72 * tall_in * panel.height / rows
    return min(NUMBERS_PT, wide_pt / (len(f">{SHARPEST:.2f}") * CHARACTER_EM), high_pt / (2 * LINE_EM))


def _curves(axes: Axes, condition: Condition) -> None:
    for index, direction in enumerate(("horizontal", "vertical")):
        look = style.series_look("HV"[index], index)
        low, high = condition.mtf.low[index], condition.mtf.high[index]
        axes.fill_between(FREQUENCIES, low, high, color=look["color"], alpha=0.15, linewidth=0)
        axes.plot(FREQUENCIES, condition.mtf.value[index], label=direction, **look)
    axes.axhline(0.5, color=style.MUTED, linewidth=0.5)
    axes.set(xlim=(0, 0.62), ylim=(0, 1.03), xlabel="frequency [Nyquist]", title="MTF of the frame, 95 % interval")
    axes.legend(loc="lower left")


def _over(axes: Axes, image: NDArray[np.float32], title: str) -> None:
    height, width = image.shape
    axes.imshow(_shrunk(image), cmap="gray", vmin=0, vmax=1, extent=(-0.5, width - 0.5, height - 0.5, -0.5))
    style.bare(axes)
    axes.set_xlim(-0.5, image.shape[1] - 0.5)
    axes.set_ylim(image.shape[0] - 0.5, -0.5)
    axes.set_title(title, loc="left")


def _shrunk(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """The picture with no more pixels across than the drawing has; resampling more of them is most of the time."""
    import cv2

    scale = ACROSS_IN * DPI / image.shape[1]
    if scale >= 1:
        return image
    return np.asarray(cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), dtype=np.float32)


def _map(
    axes: Axes, image: NDArray[np.float32], cells: NDArray[np.floating], top: float, colours: str, unit: str
) -> None:
    """Colour the frame by an even grid of cells; where a cell knows nothing, the frame stays grey."""
    height, width = image.shape
    shown = axes.imshow(
        np.ma.masked_invalid(cells), cmap=colours, vmin=0, vmax=top, alpha=STRENGTH,
        extent=(-0.5, width - 0.5, height - 0.5, -0.5),
    )  # fmt: skip
    figure, panel = axes.get_figure(root=True), axes.get_position()
    assert figure is not None
    across_in = figure.get_size_inches()[0]
    bar = figure.add_axes((panel.x1 + BAR_GAP_IN / across_in, panel.y0, BAR_IN / across_in, panel.height))
    figure.colorbar(shown, cax=bar, label=unit)
