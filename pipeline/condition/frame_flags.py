"""Faults of a frame: black, dark, over-exposed, obstructed, banded, dead lines, impulses, frozen; with measures.

The measures are plain statistics of grey levels (DN, 0..255), so that an operator can check them by eye:

| flag | measure | raised when |
|---|---|---|
| ``black`` | ``bright_dn``: 99th percentile | below 8 DN: lens cap, lost signal |
| ``dark`` | ``median_dn`` | below 16 DN, and not black |
| ``over_exposed`` | ``saturated_fraction``: pixels of at least 250 DN | above 0.25 |
| ``obstructed`` | ``obstructed_fraction``: largest area that is dark, without structure | above 0.1, and not black |
| ``banded`` | ``row_noise_dn``, ``column_noise_dn``: offsets of whole rows or columns | either above 1 DN |
| ``dead_lines`` | ``dead_lines``: rows and columns that stand out over their whole length | 1 or more, and not banded |
| ``impulses`` | ``impulse_fraction``: isolated pixels, far brighter or darker than all around | above 0.0003 |
| ``frozen`` | ``repeats``: earlier frames in a row that this one repeats | at least 3, and twice the usual run |

Noise makes the frames of a live camera differ, so that equal ones mean a stream that stands still. Behind a codec ten
frames that are alike within 0.02 DN do (`pipeline.condition.repeated_frames`). Where the last two runs of equal frames
had one length or more, as in a stream stored at a higher rate than its camera's, a run must be twice as long.

The estimate of noise leaves out noise of whole rows or columns (`pipeline.condition.row_noise`), single dead or hot
ones (`pipeline.condition.dead_lines`) and impulses (`pipeline.condition.impulses`). A measure that is NaN, as of a
frame too small or clipped, raises no flag.

Whatever is close to the lens (mud, tape, a hand) is out of focus and in the shade. An area counts as obstructed where
cells of 1/24 of the smaller side vary by less than 1.5 DN, once noise has been averaged out, and are darker than 0.35
of the median of the cells with structure, if that is at least 30 DN: the shadows of a dim frame show no structure
either. On clear street pictures (KITTI, Udacity, Penn-Fudan, the authors' *Sim*) the
largest such area is 0.06 of the frame. A bright obstruction, such as snow in the sun, resembles the sky and is not
recognised in a single frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.condition.dead_lines import dead_lines
from pipeline.condition.impulses import impulse_fraction
from pipeline.condition.picture_area import picture_area
from pipeline.condition.repeated_frames import RepeatCounter
from pipeline.condition.row_noise import column_noise_dn, row_noise_dn

BLACK_BELOW_DN = 8.0
DARK_BELOW_DN = 16.0
SATURATED_DN = 250.0
OVER_EXPOSED_FRACTION = 0.25
OBSTRUCTED_FRACTION = 0.1
BANDED_DN = 1.0
IMPULSE_FRACTION = 3e-4
FROZEN_REPEATS = 3
CELLS_PER_SIDE = 24
LEAST_CELL_PX = 8
SMOOTHING_PX = 1.5
STRUCTURE_DN = 1.5  # standard deviation within a cell below which it shows no structure
BLOCK_PIXELS = 65_536  # counted at once
DARK_RATIO = 0.35  # to the median of the cells with structure
LEAST_LIGHT_DN = 30.0  # of that median


@dataclass(frozen=True)
class FrameMeasures:
    """What one frame shows without those before it.

    Attributes:
        bright_dn: 99th percentile of grey levels, DN.
        median_dn: median grey level, DN.
        saturated_fraction: share of pixels of at least 250 DN, 0..1.
        obstructed_fraction: share of the frame in the largest dark area without structure, 0..1.
        row_noise_dn: standard deviation of the offsets of whole rows, DN; NaN where it cannot be measured.
        column_noise_dn: likewise of columns.
        dead_lines: rows and columns that stand out over their whole length.
        impulse_fraction: share of pixels that are impulses, 0..1; NaN where it cannot be measured.
    """

    bright_dn: float
    median_dn: float
    saturated_fraction: float
    obstructed_fraction: float
    row_noise_dn: float
    column_noise_dn: float
    dead_lines: int
    impulse_fraction: float


@dataclass(frozen=True)
class FrameFlags(FrameMeasures):
    """Measures of one frame and the flags they raise.

    Attributes:
        repeats: earlier frames in a row that this one repeats (`repeated_frames`); 0 for a picture.
        usual_repeats: how often each frame of the stream was repeated before, as where it is stored at a higher rate.
    """

    repeats: int
    usual_repeats: int = 0

    @property
    def names(self) -> tuple[str, ...]:
        """Flags raised, in the order of the module's table."""
        black = self.bright_dn < BLACK_BELOW_DN
        banded = self.row_noise_dn > BANDED_DN or self.column_noise_dn > BANDED_DN
        raised = {
            "black": black,
            "dark": not black and self.median_dn < DARK_BELOW_DN,
            "over_exposed": self.saturated_fraction > OVER_EXPOSED_FRACTION,
            "obstructed": not black and self.obstructed_fraction > OBSTRUCTED_FRACTION,
            "banded": banded,
            "dead_lines": not banded and self.dead_lines > 0,
            "impulses": self.impulse_fraction > IMPULSE_FRACTION,
            "frozen": self.repeats >= max(FROZEN_REPEATS, 2 * (self.usual_repeats + 1)),
        }
        return tuple(name for name, holds in raised.items() if holds)


class FrameInspector:
    """Measures frames one after the other; remembers the last frames of a stream, to count repeats."""

    def __init__(self) -> None:
        self._repeats = RepeatCounter()

    def inspect(
        self, image: NDArray[np.floating], stream: str = "", measures: FrameMeasures | None = None
    ) -> FrameFlags:
        """Measure one frame.

        Args:
            image: (H, W) float in [0, 1].
            stream: what it is a frame of, e.g. a video's name; empty for a single picture, which repeats nothing.
            measures: those of the frame, where they are known already.
        """
        repeats = self._repeats.count(image, stream)
        return FrameFlags(**vars(measures or measure(image)), repeats=repeats, usual_repeats=self._repeats.usual)


def measure(image: NDArray[np.floating]) -> FrameMeasures:
    """The measures of one frame, inside bars that are certain to be none of it (`pipeline.condition.picture_area`).

    Args:
        image: (H, W) float in [0, 1].
    """
    picture = np.asarray(image, dtype=np.float32)
    levels = 255.0 * picture[picture_area(picture, certain=True)]
    counts = _histogram(levels)
    # half a level of slack: grey levels of 8 bits come as multiples of 1/255, rounded to float32
    if counts is None:
        bright, median = _percentiles(levels, (99, 50))
        saturated = float(np.mean(levels >= SATURATED_DN - 0.5))
    else:
        bright, median = (_percentile(counts, percent) for percent in (99, 50))
        saturated = float(counts[int(SATURATED_DN) :].sum() / levels.size)
    rounded = _rounded(levels)
    return FrameMeasures(
        bright, median, saturated, obstructed_fraction(levels),
        row_noise_dn(rounded), column_noise_dn(rounded), dead_lines(rounded), impulse_fraction(rounded),
    )  # fmt: skip


def _rounded(levels: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Whole grey levels, limited to 0..255."""
    import cv2

    return np.asarray(cv2.convertScaleAbs(np.ascontiguousarray(levels)), dtype=np.uint8)


def _histogram(levels: NDArray[np.float32]) -> NDArray[np.int64] | None:
    """Number of pixels (256,) of each grey level, where all are whole numbers, as those of 8 bits are; else None."""
    if levels.size == 0 or not (levels.min() > -0.5 and levels.max() < 255.5):
        return None
    counts = np.zeros(256, np.int64)
    for lines in np.array_split(levels, max(1, levels.size // BLOCK_PIXELS)):
        whole = np.rint(lines)
        # multiples of 1/255, rounded to float32 and multiplied by 255, miss whole numbers by less than this
        if np.abs(lines - whole).max(initial=0) > 1e-4:
            return None
        counts += _counts(whole.astype(np.uint8))
    return counts


def _counts(levels: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Number of pixels (256,) of each grey level in lines (h, W) of fewer than 2^24 pixels."""
    import cv2

    return np.asarray(cv2.calcHist([levels], [0], None, [256], [0, 256]), dtype=np.int64).ravel()


def _percentiles(levels: NDArray[np.float32], percents: Sequence[float]) -> list[float]:
    """`numpy.percentile` of grey levels (H, W), 0..255: only pixels within a level of each are sorted."""
    if levels.size == 0 or not (levels.min() >= 0 and levels.max() < 256):
        return [float(value) for value in np.percentile(levels, percents)]
    whole = levels.astype(np.uint8)
    counts = sum(_counts(lines) for lines in np.array_split(whole, max(1, levels.size // BLOCK_PIXELS)))
    last = np.cumsum(counts) - 1  # index, in sorted order, of the last pixel of each whole level
    results = []
    for percent in percents:
        index = percent / 100 * last[-1]
        low, high = (int(np.searchsorted(last, end)) for end in (np.floor(index), np.ceil(index)))
        near = np.sort(levels[(whole == low) | (whole == high)])
        first = int(last[low - 1]) + 1 if low else 0
        below, above = (float(near[int(end) - first]) for end in (np.floor(index), np.ceil(index)))
        results.append(below + float(index - np.floor(index)) * (above - below))
    return results


def _percentile(counts: NDArray[np.int64], percent: float) -> float:
    """`numpy.percentile` of grey levels by their histogram."""
    last = np.cumsum(counts) - 1  # index, in sorted order, of the last pixel of each level
    index = percent / 100 * last[-1]
    low, high = (int(np.searchsorted(last, end)) for end in (np.floor(index), np.ceil(index)))
    return float(low + (index - np.floor(index)) * (high - low))


def obstructed_fraction(levels_dn: NDArray[np.floating]) -> float:
    """Share of a frame in its largest connected area that is dark and shows no structure.

    Args:
        levels_dn: (H, W) grey levels, DN.

    Returns:
        0..1; 0 where nothing in the frame has structure, or what has is dim, because an obstruction cannot be
        distinguished from darkness then.
    """
    import cv2

    levels = np.asarray(levels_dn, dtype=np.float32)
    side = max(LEAST_CELL_PX, round(min(levels.shape) / CELLS_PER_SIDE))
    rows, columns = levels.shape[0] // side, levels.shape[1] // side
    if not rows or not columns:
        return 0.0
    smooth = np.asarray(cv2.GaussianBlur(levels, (0, 0), SMOOTHING_PX), dtype=np.float32)
    mean, deviation = np.empty((rows, columns), np.float32), np.empty((rows, columns), np.float32)
    for row in range(rows):  # one row of cells at a time stays in the processor's cache
        lines = slice(row * side, (row + 1) * side)
        mean[row] = _cells(levels[lines], side, columns).mean(axis=1)
        deviation[row] = _cells(smooth[lines], side, columns).std(axis=1)
    flat = deviation < STRUCTURE_DN
    if flat.all():
        return 0.0
    light = np.median(mean[~flat])
    if light < LEAST_LIGHT_DN:
        return 0.0
    dark = flat & (mean < DARK_RATIO * light)
    count, _, statistics, _ = cv2.connectedComponentsWithStats(dark.astype(np.uint8), connectivity=4)
    largest = statistics[1:, cv2.CC_STAT_AREA].max() if count > 1 else 0
    return float(largest / dark.size)


def _cells(lines: NDArray[np.float32], side: int, columns: int) -> NDArray[np.float32]:
    """Pixels of the square cells of a row: (columns, side * side)."""
    inside = lines[:, : columns * side].reshape(side, columns, side)
    return inside.swapaxes(0, 1).reshape(columns, side * side)
