"""Looks of an ordered quantity, such as a kernel's size or a noise level: from light to dark, told apart in grey."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from pipeline.report import style
from pipeline.report.tables import format_number

if TYPE_CHECKING:
    from matplotlib.lines import Line2D

MARKERS = ("o", "s", "^", "D", "v", "P", "X")


def grades(values: Iterable[float]) -> dict[float, dict[str, Any]]:
    """Colour and marker of each value, in ascending order; zero, the absence of something, is grey.

    Args:
        values: what is told apart.
    """
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    ordered = sorted(set(values))
    positive = [value for value in ordered if value != 0]
    looks: dict[float, dict[str, Any]] = {}
    for value in ordered:
        if value == 0:
            looks[value] = {"color": style.MUTED, "marker": "."}
            continue
        place = positive.index(value)
        depth = 0.88 * (1 - place / max(len(positive) - 1, 1))  # viridis without its yellow, the largest darkest
        looks[value] = {"color": to_hex(colormaps["viridis"](depth)), "marker": MARKERS[place % len(MARKERS)]}
    return looks


def grade_handles(looks: dict[float, dict[str, Any]], unit: str, nothing: str) -> list[Line2D]:
    """The legend's lines.

    Args:
        looks: from `grades`.
        unit: of the values.
        nothing: what the value zero is called.
    """
    from matplotlib.lines import Line2D

    return [
        Line2D([], [], label=f"{format_number(value)} {unit}" if value else nothing, **look)
        for value, look in looks.items()
    ]
