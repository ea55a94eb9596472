"""One look for every figure, and files that are the same bytes on every run.

Sizes follow IEEE columns (88 mm and 182 mm). Colours are Okabe and Ito's palette (Color Universal Design,
2008), told apart by readers with any colour vision; series also differ in marker and line style. Text is drawn
as outlines with the font that comes with matplotlib, so a figure does not depend on the fonts of a machine.
"""

from __future__ import annotations

import functools
import io
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

import numpy as np

from pipeline.report.display_names import word
from pipeline.report.svg import compact
from pipeline.report.yaml_files import content
from pipeline.store import replacing, write_text

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ONE_COLUMN_IN = 3.46
TWO_COLUMNS_IN = 7.16
PNG_DPI = 150
COLOUR_STEPS = 2  # of k-means, after the palette that spans the colours of a picture
_STYLE = content(resources.files(__package__), "style.yaml")
INK, MUTED, GRID, PAPER = (_STYLE["colours"][name] for name in ("ink", "muted", "grid", "paper"))
PALETTE: Sequence[str] = _STYLE["palette"]
_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "h")
_DASHES = (
    "-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (5, 1.5, 1.2, 1.5)), (0, (8, 2)), (0, (3, 1)), (0, (1, 2)),
    (0, (6, 1)), (0, (2, 2)), (0, (8, 1.5, 1.2, 1.5)),
)  # fmt: skip

Look = dict[str, Any]
"""Keyword arguments of matplotlib's ``plot``: colour, marker, line style."""

_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")


@dataclass(frozen=True)
class Drawing:
    """A figure, a description of it with its numbers for readers who do not see it, and the numbers plotted.

    ``values`` is long, or None where the figure shows pictures only; ``series``: name, word and colour of each series
    that a reader may switch off, see `series_id`.
    """

    figure: Figure
    alt: str
    values: pd.DataFrame | None = None
    series: tuple[tuple[str, str, str], ...] = ()


def styled(draw: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """Decorator: draw under this style, leaving matplotlib's global settings as they were."""

    @functools.wraps(draw)
    def wrapper(*args: _Arguments.args, **kwargs: _Arguments.kwargs) -> _Result:
        import matplotlib as mpl

        with mpl.rc_context():
            mpl.rcdefaults()  # a user's matplotlibrc must not change the bytes
            for group, settings in _STYLE["rc"].items():
                mpl.rc(group, **settings)
            return draw(*args, **kwargs)

    return wrapper


def new_figure(width_in: float, height_in: float) -> Figure:
    """An empty figure on the Agg canvas, outside pyplot's global list, with constrained layout."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def sheet(
    columns: int,
    row_heights: Sequence[float],
    *,
    left_in: float = 0.02,
    right_in: float = 0.02,
    top_in: float = 0.2,
    bottom_in: float = 0.05,
    gap_in: float = 0.06,
    row_gap_in: float = 0.06,
) -> tuple[Figure, np.ndarray]:
    """A contact sheet over two columns of print: axes without a layout engine, which is slow for so many.

    Columns are equally wide, ``row_heights`` as fractions of that width. Returns the figure and (rows, columns) axes.
    """
    cell_in = (TWO_COLUMNS_IN - left_in - right_in - (columns - 1) * gap_in) / columns
    mean_in, rows = cell_in * float(np.mean(row_heights)), len(row_heights)
    height_in = top_in + rows * mean_in + (rows - 1) * row_gap_in + bottom_in
    figure = new_figure(TWO_COLUMNS_IN, height_in)
    figure.set_layout_engine("none")
    edges = {
        "left": left_in / TWO_COLUMNS_IN, "right": 1 - right_in / TWO_COLUMNS_IN, "top": 1 - top_in / height_in,
        "bottom": bottom_in / height_in, "wspace": gap_in / cell_in, "hspace": row_gap_in / mean_in,
    }  # fmt: skip
    return figure, figure.subplots(rows, columns, squeeze=False, height_ratios=row_heights, gridspec_kw=edges)


def series_look(name: str, position: int = 0) -> Look:
    """Colour, marker and line style of a series: fixed for the project's names, else by position."""
    index = _STYLE["positions"].get(name, position) % len(PALETTE)
    return {"color": PALETTE[index], "marker": _MARKERS[index], "linestyle": _DASHES[index]}


def series_looks(names: Iterable[str], **changes: Any) -> dict[str, Look]:
    """`series_look` of each name in order, with the same changes to all, e.g. ``linestyle="-"``."""
    return {name: series_look(name, position) | changes for position, name in enumerate(names)}


def ordinal_looks(values: Iterable[float]) -> dict[float, Look]:
    """Colour and marker of each value of an ordered quantity, e.g. kernel size, from light to dark; zero is grey."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    ascending = sorted(set(values))
    positive = [value for value in ascending if value != 0]
    looks: dict[float, Look] = {0: {"color": MUTED, "marker": "."}} if 0 in ascending else {}
    for rank, value in enumerate(positive):
        depth = 0.88 * (1 - rank / max(len(positive) - 1, 1))  # viridis without its yellow, the largest darkest
        looks[value] = {"color": to_hex(colormaps["viridis"](depth)), "marker": _MARKERS[rank % len(_MARKERS)]}
    return looks


def switches(names: Iterable[str]) -> tuple[tuple[str, str, str], ...]:
    """`Drawing.series` of the project's own names, in the order given."""
    return tuple((name, word(name), str(look["color"])) for name, look in series_looks(names).items())


def series_id(name: str, part: str) -> str:
    """The SVG id of one artist of a series; the page's switches find all of a series by it."""
    safe = "".join(letter if letter.isalnum() else "_" for letter in f"{part}")
    return f"series--{name}--{safe}"


def bare(axes: Axes) -> None:
    """Leave only the picture: no ticks, no grid, a hairline frame."""
    axes.set_xticks([])
    axes.set_yticks([])
    axes.grid(False)
    for spine in axes.spines.values():
        spine.set_visible(True)
        spine.set_linewidth(0.4)


def picture(axes: Axes, image: np.ndarray, lowest: float = 0.0, highest: float = 255.0, **more: Any) -> None:
    """A grey picture, pixel for pixel, with nothing beside it."""
    axes.imshow(image, cmap="gray", vmin=lowest, vmax=highest, **more)
    bare(axes)


def outline(axes: Axes, box: Sequence[float], **look: Any) -> None:
    """The outline of a box of a picture: left, top, right and bottom."""
    from matplotlib.patches import Rectangle

    left, top, right, bottom = box
    axes.add_patch(Rectangle((left, top), right - left, bottom - top, fill=False, **look))


def middle(image: np.ndarray, height_px: int, width_px: int) -> np.ndarray:
    """The middle of a picture, at most so large. Shrinking it instead would average the noise away."""
    top, left = (max(0, (side - part) // 2) for side, part in zip(image.shape, (height_px, width_px), strict=True))
    return image[top : top + height_px, left : left + width_px]


def colour_bar(figure: Figure, mappable: Any, axes: Any, label: str, **where: Any) -> None:
    """A colour bar without a frame, beside ``axes``."""
    bar = figure.colorbar(mappable, ax=axes, **where)
    bar.set_label(label)
    bar.outline.set_visible(False)


def shrunk(image: np.ndarray, side_px: int) -> tuple[np.ndarray, float]:
    """A picture with its longest side at most so long, and the scale used (area averages, no aliasing)."""
    import cv2

    scale = min(1.0, side_px / max(image.shape))
    size = (max(1, round(image.shape[1] * scale)), max(1, round(image.shape[0] * scale)))
    return (image if scale == 1.0 else cv2.resize(image, size, interpolation=cv2.INTER_AREA)), scale


def _save_png(figure: Figure, path: Path) -> None:
    """A PNG with a palette of 256 colours, among them those of thin lines beside photographs and of colour maps."""
    from PIL import Image

    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=PNG_DPI)
    picture = Image.open(drawn).convert("RGB")
    method = Image.Quantize.MAXCOVERAGE
    picture = picture.quantize(256, method=method, kmeans=COLOUR_STEPS, dither=Image.Dither.NONE)
    picture.save(path, "PNG", optimize=True, dpi=(PNG_DPI, PNG_DPI))


@styled
def save(figure: Figure, stem: str | Path, values: pd.DataFrame | None = None) -> list[Path]:
    """Write ``stem.svg``, ``stem.png`` and, where values are given, ``stem.csv``; atomically, same bytes each time.

    The figure was drawn under `styled`; values are written with six significant digits. Returns the files written.
    """
    stem = Path(stem)
    svg, png, csv = (stem.with_name(f"{stem.name}.{suffix}") for suffix in ("svg", "png", "csv"))
    drawn = io.StringIO()
    # No date and no version: a new matplotlib that draws the same gives the same file.
    figure.savefig(drawn, format="svg", metadata={"Date": None, "Creator": None})
    write_text(svg, compact(drawn.getvalue()))
    with replacing(png) as temporary:
        _save_png(figure, temporary)
    written = [svg, png]
    if values is not None:
        write_text(csv, values.to_csv(index=False, float_format="%.6g", lineterminator="\n"))
        written.append(csv)
    return written
