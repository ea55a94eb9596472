"""A small line plot of a quantity over frames as inline SVG: no script, scales to any width, follows light and dark."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import isfinite

WIDTH, HEIGHT = 1000.0, 100.0
DASH = 4.0
MOST_BINS = 600  # of frames; of each, the least and the greatest value are drawn


@dataclass(frozen=True)
class Line:
    """One series.

    Attributes:
        name: for the legend.
        values: of every frame; NaN where unknown.
        style: class of the style sheet.
    """

    name: str
    values: Sequence[float]
    style: str


@dataclass(frozen=True)
class Plot:
    """A plot for the page.

    Attributes:
        title: with unit.
        svg: markup of the lines, without text.
        low, high: ends of the vertical axis.
        legend: (name, style) of the lines.
    """

    title: str
    svg: str
    low: float
    high: float
    legend: tuple[tuple[str, str], ...]


def plot(
    title: str,
    lines: Sequence[Line],
    *,
    threshold: float | None = None,
    marks: Iterable[int] = (),
    starts: Sequence[int] = (),
    least_high: float = 0.0,
) -> Plot:
    """Draw lines over frames.

    Args:
        title: with unit.
        lines: of equal length.
        threshold: drawn as a dashed line.
        marks: frames with a vertical line, e.g. alarms.
        starts: frames, rising, at which the next source begins: a vertical line before them, which no line crosses.
        least_high: that the vertical axis reaches in any case.
    """
    count = max((len(line.values) for line in lines), default=0)
    known = [value for line in lines for value in line.values if isfinite(value)]
    high = max([least_high, *known, *([threshold] if threshold is not None else [])]) * 1.05 or 1.0
    step = max(1, -(-count // MOST_BINS))
    x_of = [WIDTH * (index + 0.5) / max(count, 1) for index in range(count)]
    parts = [
        f'<line class="mark" x1="{x_of[index]:.1f}" x2="{x_of[index]:.1f}" y1="0" y2="{HEIGHT:.0f}"/>'
        for index in marks if index < count
    ]  # fmt: skip
    for index in starts:
        x = WIDTH * index / max(count, 1)
        parts.append(f'<line class="source" x1="{x:.1f}" x2="{x:.1f}" y1="0" y2="{HEIGHT:.0f}"/>')
    if threshold is not None:
        y = _y(threshold, high)
        parts.append(f'<line class="threshold" x1="0" x2="{WIDTH:.0f}" y1="{y:.1f}" y2="{y:.1f}"/>')
    for line in lines:
        for first, end in pairwise([0, *starts, count]):
            for run in _runs(line.values[first:end], high, x_of[first:end], step):
                parts.append(f'<polyline class="{line.style}" points="{run}"/>')
    svg = (
        f'<svg viewBox="0 0 {WIDTH:.0f} {HEIGHT:.0f}" preserveAspectRatio="none" aria-hidden="true">'
        f"{''.join(parts)}</svg>"
    )
    return Plot(title, svg, 0.0, high, tuple((line.name, line.style) for line in lines))


def _runs(values: Sequence[float], high: float, x_of: Sequence[float], step: int) -> Iterable[str]:
    """Points of every unbroken run of known values; of each bin of several frames the least and the greatest remain."""
    points: list[tuple[float, float]] = []
    for start in range(0, len(values), step):
        frames = range(start, min(start + step, len(values)))
        known = [(values[frame], x_of[frame]) for frame in frames if isfinite(values[frame])]
        if known:
            ends = sorted({min(known), max(known)}, key=lambda end: end[1])
            points += [(x, _y(value, high)) for value, x in ends]
        elif points:
            yield _drawn(points)
            points = []
    if points:
        yield _drawn(points)


def _drawn(points: Sequence[tuple[float, float]]) -> str:
    """A run as short as a single point is drawn with a dash at both ends."""
    (first, start), (last, end) = points[0], points[-1]
    if last - first < 2 * DASH:
        points = [(first - DASH, start), *points, (last + DASH, end)]
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)


def _y(value: float, high: float) -> float:
    return HEIGHT * (1 - min(max(value / high, 0.0), 1.0))
