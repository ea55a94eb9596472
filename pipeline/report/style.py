"""One look for every figure, and files that are the same bytes on every run.

Sizes follow IEEE columns (88 mm and 182 mm). Colours are Okabe and Ito's palette (Color Universal Design,
2008), told apart by readers with any colour vision; series also differ in marker and line style. Text is drawn
as outlines with the font that comes with matplotlib, so a figure does not depend on the fonts of a machine.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from pipeline.store import replacing, write_text

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ONE_COLUMN_IN = 3.46
TWO_COLUMNS_IN = 7.16
PNG_DPI = 200

# Neutral colours; the page replaces them by its own, which follow light or dark.
INK, MUTED, GRID, PAPER = "#1b1f24", "#6b7280", "#d9dde3", "#ffffff"
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c6d31")
_MARKERS = ("o", "s", "^", "D", "v", "P", "X")
_DASHES = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (5, 1.5, 1.2, 1.5)), (0, (8, 2)), (0, (3, 1)), (0, (1, 2)))
# Each place in the palette belongs to one estimator, so that it has the same colour in every figure.
_PLACES = {
    "pca": 0, "bf": 1, "cnn": 2, "cellwise": 3, "wavelet": 4, "immerkaer": 5,
    "pmp": 0, "gbb": 1, "spectral": 3,
    "sim": 0, "photos": 4, "kitti": 1, "udacity": 2,
    "H": 0, "V": 1,
}  # fmt: skip

RC: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "mathtext.fontset": "dejavusans",
    "font.size": 7.0,
    "axes.titlesize": 7.5,
    "axes.titleweight": "bold",
    "axes.labelsize": 7.0,
    "xtick.labelsize": 6.2,
    "ytick.labelsize": 6.2,
    "legend.fontsize": 6.4,
    "figure.titlesize": 8.0,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.edgecolor": MUTED,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "axes.facecolor": PAPER,
    "figure.facecolor": PAPER,
    "savefig.facecolor": PAPER,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.5,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "lines.linewidth": 1.1,
    "lines.markersize": 2.8,
    "legend.frameon": False,
    "axes.unicode_minus": True,
    "image.interpolation": "none",
    "image.cmap": "gray",
    "svg.fonttype": "path",
    "svg.hashsalt": "camera-condition-pipeline",
    "path.simplify": True,
}

_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")


@dataclass(frozen=True)
class Drawing:
    """A figure with its words and numbers.

    Attributes:
        figure: the matplotlib figure, drawn in this style.
        alt: what it shows, said with numbers from the data, for readers who do not see it.
        values: the numbers plotted, long format; None where the figure shows pictures only.
        series: name -> word of the series that a reader may switch off; their artists' ids come from `series_id`.
    """

    figure: Figure
    alt: str
    values: pd.DataFrame | None = None
    series: tuple[tuple[str, str], ...] = ()


def styled(draw: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """Decorator: draw under this style, leaving matplotlib's global settings as they were."""

    @functools.wraps(draw)
    def wrapper(*args: _Arguments.args, **kwargs: _Arguments.kwargs) -> _Result:
        import matplotlib as mpl

        with mpl.rc_context():
            mpl.rcdefaults()  # a user's matplotlibrc must not change the bytes
            mpl.rcParams.update(RC)  # type: ignore[arg-type]  # checked by matplotlib itself
            return draw(*args, **kwargs)

    return wrapper


def new_figure(width_in: float, height_in: float, padding: dict[str, float] | None = None) -> Figure:
    """An empty figure on the Agg canvas, outside pyplot's global list, with constrained layout.

    Args:
        width_in, height_in: size in inches.
        padding: ``w_pad`` and ``h_pad`` in inches, ``wspace`` and ``hspace`` as shares; matplotlib's own if None.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    figure = Figure(figsize=(width_in, height_in), layout=ConstrainedLayoutEngine(**(padding or {})))
    FigureCanvasAgg(figure)
    return figure


def series_look(name: str, position: int = 0) -> dict[str, Any]:
    """Colour, marker and line style of a series: fixed for the project's own names, else by position."""
    place = _PLACES.get(name, position) % len(PALETTE)
    return {"color": PALETTE[place], "marker": _MARKERS[place], "linestyle": _DASHES[place]}


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


@styled
def save(figure: Figure, stem: str | Path, values: pd.DataFrame | None = None) -> list[Path]:
    """Write ``stem.svg``, ``stem.png`` and, where values are given, ``stem.csv``; atomically, same bytes each time.

    Args:
        figure: drawn under `styled`.
        stem: path without suffix.
        values: the numbers plotted, written with six significant digits.

    Returns:
        the files written.
    """
    stem = Path(stem)
    svg, png, csv = (stem.with_name(f"{stem.name}.{suffix}") for suffix in ("svg", "png", "csv"))
    with replacing(svg) as temporary:
        # No date and no version: a new matplotlib that draws the same gives the same file.
        figure.savefig(temporary, format="svg", metadata={"Date": None, "Creator": None})
    with replacing(png) as temporary:
        figure.savefig(temporary, format="png", dpi=PNG_DPI, metadata={"Software": None})
    written = [svg, png]
    if values is not None:
        write_text(csv, values.to_csv(index=False, float_format="%.6g", lineterminator="\n"))
        written.append(csv)
    return written
