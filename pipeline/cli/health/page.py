"""The page of one run of ``camera-monitor health``: one HTML file with everything inside, no script, no network."""

from __future__ import annotations

import base64
import heapq
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import isinf, isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pipeline.condition import Condition

THUMBNAIL_PX = 240  # longer side
MOST_THUMBNAILS = 48
MAP_PX = 1000
WORST_FRAMES = 6
JPEG_QUALITY = 80
MOST_ROWS = 500
LEAST_SIGMA_DN, LEAST_MTF50 = 5.0, 0.62  # that the vertical axes reach
MEDIAN_NOISE = ("median_sigma_dn", "median_white_sigma_dn", "median_noise_correlation")
MOST_SOURCES = 50  # whose beginnings are marked; of more, the marks would hide the lines


@dataclass(frozen=True)
class Thumbnail:
    """A small picture of a frame.

    Attributes:
        row: the frame's.
        picture: ``data:`` address of a JPEG.
        width_px, height_px: its size.
    """

    row: dict[str, Any]
    picture: str
    width_px: int
    height_px: int


@dataclass(frozen=True)
class _Kept:
    """A frame kept to be drawn: its row, its picture (H, W) in grey levels of 8 bit, its condition."""

    row: dict[str, Any]
    picture: NDArray[np.uint8]
    condition: Condition


class PageFrames:
    """Keeps what the page shows of the frames; its memory does not grow with their number.

    Thumbnails are of evenly spaced frames: whenever there are too many, every second one goes. Of the worst frames so
    far the pictures are kept; their maps are drawn when they are asked for.

    Args:
        draw: (H, W) picture in [0, 1] and condition of a frame -> (h, w, 3) RGB with its maps.
    """

    def __init__(self, draw: Callable[[NDArray[np.float32], Condition], NDArray[np.uint8]]) -> None:
        self.thumbnails: list[Thumbnail] = []
        self._draw = draw
        self._worst: list[tuple[tuple[float, ...], int, _Kept]] = []
        self._count, self._step = 0, 1

    def add(self, row: dict[str, Any], image: NDArray[np.float32], condition: Condition) -> None:
        """Take a frame.

        Args:
            row: of the frame.
            image: (H, W) float in [0, 1].
            condition: its blur and noise.
        """
        import cv2
        import numpy as np

        from pipeline.cli.health.ranking import badness

        score, shown = badness(row), self._count % self._step == 0
        kept = len(self._worst) < WORST_FRAMES or score > self._worst[0][0]
        self._count += 1
        if not (shown or kept):
            return
        picture = np.asarray(cv2.convertScaleAbs(image, alpha=255), dtype=np.uint8)  # rounded, limited to 0..255
        if shown:
            self.thumbnails.append(_thumbnail(row, picture, THUMBNAIL_PX))
            if len(self.thumbnails) > MOST_THUMBNAILS:
                self.thumbnails = self.thumbnails[::2]
                self._step *= 2
        if kept:
            entry = (score, -self._count, _Kept(row, picture, condition))
            (heapq.heappush if len(self._worst) < WORST_FRAMES else heapq.heapreplace)(self._worst, entry)

    @property
    def worst(self) -> list[Thumbnail]:
        """The worst frames with their maps, worst first; drawn now."""
        import numpy as np

        ranked = [entry[2] for entry in sorted(self._worst, key=lambda entry: entry[:2], reverse=True)]
        drawn = [self._draw((kept.picture / np.float32(255)).astype(np.float32), kept.condition) for kept in ranked]
        return [_thumbnail(kept.row, maps, MAP_PX) for kept, maps in zip(ranked, drawn, strict=True)]


def page(content: dict[str, Any], frames: PageFrames) -> str:
    """The page.

    Args:
        content: the run (`pipeline.cli.health.run.HealthRun.content`).
        frames: pictures of it.

    Returns:
        HTML.
    """
    from pipeline.cli.health.row_words import row_words
    from pipeline.cli.results.numbers import text_number
    from pipeline.report.templates import environment

    rows = content["pictures"]
    table = [
        {
            "name": row["picture"], "words": row_words(row, flags=False), "sigma": text_number(row["sigma_dn"], 2),
            "horizontal": text_number(row["mtf50_horizontal"], 2), "vertical": text_number(row["mtf50_vertical"], 2),
            "flags": row["flags"].replace("_", "-"), "alarms": row["alarms"],
        }
        for row in rows[:MOST_ROWS]
    ]  # fmt: skip
    return environment("pipeline.cli.health").get_template("page.html.j2").render(
        content=content, verdict=content["verdict"], table=table, rows=len(rows), plots=_plots(content),
        sources=1 + len(_source_starts(rows)), thumbnails=frames.thumbnails, worst=frames.worst, words=row_words,
        noise_parts=_noise_parts(content["verdict"]),
    )  # fmt: skip


def _noise_parts(verdict: dict[str, Any]) -> str:
    """What the noise of the run is made of, in words; empty where that is unknown."""
    from pipeline.condition.verdict import noise_parts_words

    return noise_parts_words(*(verdict.get(name, float("nan")) for name in MEDIAN_NOISE))  # no medians of no frame


def _plots(content: dict[str, Any]) -> list[Any]:
    """Noise, blur and, where known, expected precision over the frames."""
    from pipeline.camera.mtf import FREQUENCIES
    from pipeline.cli.health.trend_plot import Line, plot

    rows: Sequence[dict[str, Any]] = content["pictures"]
    if len(rows) < 2:
        return []
    thresholds = content["thresholds"]
    index = {row["picture"]: item for item, row in enumerate(rows)}
    marks = [index[alarm["picture"]] for alarm in content["trend_alarms"] if alarm["picture"] in index]
    starts = _source_starts(rows)
    top = float(FREQUENCIES[-1])
    halves = [
        Line(axis, [top if isinf(row[f"mtf50_{axis}"]) else row[f"mtf50_{axis}"] for row in rows], style)
        for axis, style in (("horizontal", "first"), ("vertical", "second"))
    ]
    noise = Line("noise", [row["sigma_dn"] for row in rows], "first")
    precision = Line("AP", [row["ap_percent"] for row in rows], "first")
    shown: list[tuple[str, list[Line], dict[str, Any]]] = [
        ("Noise σ [DN]", [noise], {"threshold": thresholds["sigma_dn"], "least_high": LEAST_SIGMA_DN}),
        ("MTF50 [fraction of Nyquist]", halves, {"threshold": thresholds["mtf50"], "least_high": LEAST_MTF50}),
        ("Expected AP [%]", [precision], {"least_high": 100.0}),
    ]
    return [
        plot(title, lines, marks=marks, starts=starts, **options)
        for title, lines, options in shown
        if any(not isnan(value) for line in lines for value in line.values)
    ]


def _source_starts(rows: Sequence[dict[str, Any]]) -> list[int]:
    """Frames at which the next video or folder begins; none where there are more than `MOST_SOURCES`."""
    from pipeline.cli.frames.names import stream_of

    sources = [stream_of(row["picture"]) or str(Path(row["picture"]).parent) for row in rows]
    starts = [index for index, (last, source) in enumerate(pairwise(sources), 1) if source != last]
    return starts if len(starts) < MOST_SOURCES else []


def _thumbnail(row: dict[str, Any], picture: NDArray[np.uint8], longest_px: int) -> Thumbnail:
    """A picture, grey or RGB, made smaller and encoded as JPEG."""
    import cv2

    height, width = picture.shape[:2]
    scale = min(1.0, longest_px / max(height, width))
    size = max(1, round(width * scale)), max(1, round(height * scale))
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    encoded = cv2.imencode(
        ".jpg", small if small.ndim == 2 else small[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
    )
    data = base64.b64encode(encoded[1].tobytes()).decode("ascii")
    return Thumbnail(row, f"data:image/jpeg;base64,{data}", *size)
