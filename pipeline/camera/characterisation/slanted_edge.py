"""The MTF of a camera from a picture of a slanted edge.

After ISO 12233: a straight line is fitted to the edge's position in every row; all pixels are projected onto its normal
and averaged in bins of 1/4 px, which gives the edge-spread function (ESF); its derivative is the line-spread function
(LSF), under a window of 1 within 14.4 px of the edge (discs of up to 28 px keep their width), which falls to 0 at 24 px
as a cosine (a Tukey window), and

    MTF(f) = |sum LSF(d) exp(-2 pi j f d)| / |sum LSF(d)| / sinc^2(f / 4)

where one sinc belongs to the bins and one to the difference of neighbours. The scatter of the pixels about the ESF,
taken through these sums row by row, gives the standard error of the MTF: pixels of a row, and of rows near each other,
may be correlated, as behind demosaicing, denoising or JPEG (`pipeline.camera.correlated_sum`). A nearly vertical edge
gives the horizontal MTF, a nearly horizontal one the vertical.

Light that changes across the edge counts as part of its transition: 10 % over 120 px lower the MTF by up to .027 where
it grows towards the bright side, and raise it by as much where it falls.

A tone curve bends the transition: of an edge between 5 and 80 % of the light, encoded with a gamma of 2.2, the MTF is
up to .045 below that of the lens, between 10 and 40 % .012.

That is the MTF along the edge's normal, and that of the axis where blur is round. Of other blur it is near that of the
axis at tilts of about 5 degrees, the standard's: with a motion of 7 px across the edge errors are up to .004 at 5, .015
at 10, .034 at 15 and .09 at 25 degrees; with one along the edge .04, .17, .35 and .74.

An edge with an end of its transition cut off at black or white looks sharper than it is: its ESF is then refused
(`pipeline.camera.clipping`). A white of exactly 255 DN that the edge approaches smoothly is no harm.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.clipping import ENDS, clipping, refuse_clipped, saturated_at
from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.camera.correlated_sum import sum_variance
from pipeline.camera.mtf import DIRECTIONS, FREQUENCIES
from pipeline.camera.quantise import check_finite
from pipeline.errors import InputError

BINS_PER_PX = 4
LEAST_SIDE_PX = 24
LEAST_CONTRAST_DN = 20.0
LEAST_TILT_DEG, MOST_TILT_DEG = 1.5, 30.0
ROUND_BLUR_TILT_DEG = 10.0  # beyond it the MTF is that of the axis for round blur only
LARGEST_DEVIATION_PX = 1.0  # median distance of the rows' edge positions from the line
WINDOW_PX = 24.0  # half-width of the window on the line-spread function
LAST_BIN = int(2 * WINDOW_PX * BINS_PER_PX) + 1
FLAT_FRACTION = 0.6  # of it, where the window is 1; beyond it falls to 0 as a cosine
START_PX = 8  # sides of the edge whose means are compared, for the first positions
LINE_SIGMA_PX = 8.0  # of the window on the derivative that gives the positions
LEAST_INSIDE = 0.3  # of an edge's step, in that window
ROUNDS = 8
MOST_CLIPPING = 0.15  # errors of the MTF are below 0.05 up to there


@dataclass(frozen=True)
class EdgeMtf:
    """The MTF that one edge gives.

    Attributes:
        direction: ``horizontal`` or ``vertical``.
        mtf: (8,) at `pipeline.camera.mtf.FREQUENCIES`, >= 0; above 1 where the camera sharpens.
        tilt_deg: angle of the edge to the nearest axis.
        contrast_dn: difference of both sides, DN.
        error: (8,) standard error of the MTF by the noise of the pixels.
    """

    direction: str
    mtf: NDArray[np.float64]
    tilt_deg: float
    contrast_dn: float
    error: NDArray[np.float64]


def measure(image: NDArray[np.floating]) -> EdgeMtf:
    """The MTF across the one edge of a picture.

    Args:
        image: (H, W) float in [0, 1], with a single straight edge, 1.5 to 30 degrees from the vertical or horizontal,
            that crosses the whole picture; about 5 degrees unless the blur is round.

    Returns:
        the MTF, not limited to 1.

    Raises:
        InputError: the picture is too small, holds values that are not finite, or no such edge, or the edge is clipped
            at black or white.
    """
    picture = np.asarray(image, dtype=np.float64)
    if picture.ndim != 2 or min(picture.shape) < LEAST_SIDE_PX:
        raise InputError(f"edge: a picture of shape {picture.shape}; expected (H, W), at least {LEAST_SIDE_PX} px each")
    check_finite(picture, "edge")
    upright = _contrast(picture) >= _contrast(picture.T)
    rows = picture if upright else picture.T
    contrast_dn = _contrast(rows) * FULL_SCALE_DN
    if contrast_dn < LEAST_CONTRAST_DN:
        raise InputError(f"edge: its sides differ by {contrast_dn:.0f} DN; expected at least {LEAST_CONTRAST_DN:.0f}")
    offset, slope = _line(rows)
    tilt = abs(math.degrees(math.atan(slope)))
    if not LEAST_TILT_DEG <= tilt <= MOST_TILT_DEG:
        raise InputError(
            f"edge: tilted by {tilt:.1f} degrees; expected {LEAST_TILT_DEG:g} to {MOST_TILT_DEG:g}, "
            "so that rows sample it at different positions"
        )
    position = _positions(rows.shape, offset, slope)
    levels, *saturated = _spread([rows, *(saturated_at(rows, end) for end in ENDS)], position)
    refuse_clipped("edge", [clipping(levels, fraction) for fraction in saturated], MOST_CLIPPING)
    transfer, change = _transfer(levels)
    error = _error(rows, position, levels, change)
    return EdgeMtf(DIRECTIONS[0 if upright else 1], transfer, tilt, contrast_dn, error)


def _contrast(rows: NDArray[np.float64]) -> float:
    """Size of the edge's step."""
    return abs(_step(rows))


def _step(rows: NDArray[np.float64]) -> float:
    """Median difference of the last eighth of the rows and the first."""
    width = max(2, rows.shape[1] // 8)
    return float(np.median(rows[:, -width:].mean(axis=1) - rows[:, :width].mean(axis=1)))


def _line(rows: NDArray[np.float64]) -> tuple[float, float]:
    """Offset and slope of the edge's column over the row, by centroids of the derivative, windowed around the line.

    Differences keep their sign, so that noise adds nothing on average; the absolute value of noise has a mean, which
    would draw centroids to the middle of the window. Rows whose edge lies outside of the window keep their position.

    Raises:
        InputError: the positions do not lie on a straight line.
    """
    step = _step(rows)
    slopes = np.diff(rows, axis=1) / step  # of sum 1 a row
    columns, lines = np.arange(slopes.shape[1]) + 0.5, np.arange(len(rows))
    # a triangle takes the difference of the means on either side, within a distance of its half-width
    triangle = np.bartlett(2 * START_PX + 1)
    smooth = np.stack([np.convolve(line, triangle, mode="full")[START_PX:-START_PX] for line in slopes])
    centre = smooth.argmax(axis=1).astype(np.float64) + 0.5
    fit = _robust_line(lines, centre)
    for _ in range(ROUNDS):
        distance = columns[None] - (fit[0] + fit[1] * lines)[:, None]
        weight = slopes * np.exp(-0.5 * (distance / LINE_SIGMA_PX) ** 2)
        total = weight.sum(axis=1)
        inside = total > LEAST_INSIDE
        shift = (weight * distance).sum(axis=1) / np.where(inside, total, 1.0)
        centre = np.where(inside, fit[0] + fit[1] * lines + shift, centre)
        fit = _robust_line(lines, centre)
    deviation = float(np.median(np.abs(centre - (fit[0] + fit[1] * lines))))
    if deviation > LARGEST_DEVIATION_PX:
        raise InputError(
            f"edge: positions in the rows deviate by {deviation:.1f} px from a line; name the area of one straight edge"
        )
    return fit


def _robust_line(lines: NDArray[np.int64], centre: NDArray[np.float64]) -> tuple[float, float]:
    """Least squares line through the positions whose residual is small, from the median slope."""
    half = len(lines) // 2
    slope = float(np.median((centre[half : 2 * half] - centre[:half]) / half))
    offset = float(np.median(centre - slope * lines))
    residual = np.abs(centre - offset - slope * lines)
    kept = residual <= max(2.0, 2.5 * float(np.median(residual)))
    slope, offset = (float(value) for value in np.polyfit(lines[kept], centre[kept], 1))
    return offset, slope


def _positions(shape: tuple[int, ...], offset: float, slope: float) -> NDArray[np.float64]:
    """Distance (H, W) of every pixel across the edge, in bins of 1/4 px, of which -24 to 24 px are 0 to `LAST_BIN`."""
    columns, lines = np.arange(shape[1]), np.arange(shape[0])
    distance = (columns[None] - (offset + slope * lines)[:, None]) * math.cos(math.atan(slope))
    return distance * BINS_PER_PX + WINDOW_PX * BINS_PER_PX + 0.5


def _inside(position: NDArray[np.float64]) -> tuple[NDArray[np.bool_], NDArray[np.int64], NDArray[np.int64]]:
    """Which pixels (H, W) lie in bins, the bins of those, and the number of pixels in each bin."""
    index = np.rint(position).astype(np.int64)
    inside = (index >= 0) & (index <= LAST_BIN)
    return inside, index[inside], np.bincount(index[inside], minlength=LAST_BIN + 1)


def _spread(pictures: Sequence[NDArray[Any]], position: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Means of pictures of one edge in bins across it; of grey levels it is the ESF."""
    inside, index, count = _inside(position)
    *values, positions = (
        np.bincount(index, weights=part[inside], minlength=LAST_BIN + 1)[count > 0] / count[count > 0]
        for part in (*pictures, position)
    )
    # pixels of a bin are not spread evenly over it where the tilt's tangent is near a ratio of small numbers
    return [np.interp(np.arange(LAST_BIN + 1), positions, part) for part in values]


def _error(
    rows: NDArray[np.float64],
    position: NDArray[np.float64],
    levels: NDArray[np.float64],
    change: NDArray[np.float64],
) -> NDArray[np.float64]:
    """(8,) standard error of the MTF by the scatter of all pixels about the ESF.

    Light that changes along the edge, which averages out of the ESF, is no scatter.

    Args:
        rows: (H, W) grey levels.
        position: of `_positions`.
        levels: the ESF, of `_spread`.
        change: (8, bins) of the MTF by each of its bins, of `_transfer`.
    """
    inside, index, count = _inside(position)
    bins, full = np.arange(LAST_BIN + 1), count > 0
    spread = np.interp(position[inside], bins, levels)
    line = np.nonzero(inside)[0]
    along = line - (len(rows) - 1) / 2
    light = np.stack([along, along * spread], axis=1)
    residual = rows[inside] - spread
    residual = residual - light @ np.linalg.lstsq(light, residual, rcond=None)[0]
    centres = np.bincount(index, weights=position[inside], minlength=LAST_BIN + 1)[full] / count[full]
    interpolated = np.stack([np.interp(bins, centres, mean) for mean in np.eye(len(centres))])  # see `_spread`
    by_pixel = np.zeros_like(change)
    by_pixel[:, full] = change @ interpolated.T / np.sqrt(count * np.maximum(count - 1, 1))[full]
    by_row = [np.bincount(line, weights=residual * part[index], minlength=len(rows)) for part in by_pixel]
    return np.sqrt(sum_variance(np.stack(by_row, axis=1)))


def _transfer(levels: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(8,) MTF from the oversampled edge-spread function, and its linear change (8, bins) by each of its bins."""
    line = np.diff(levels)
    where = (np.arange(len(line)) - len(line) // 2) / BINS_PER_PX
    beyond = (np.abs(where) / WINDOW_PX - FLAT_FRACTION) / (1 - FLAT_FRACTION)
    window = 0.5 + 0.5 * np.cos(np.pi * np.clip(beyond, 0, 1))
    cycles_per_px = FREQUENCIES / 2
    waves = np.exp(-2j * np.pi * np.outer(cycles_per_px, where))
    line = line * window
    total, wave = line.sum(), waves @ line
    transfer = np.abs(wave) / abs(total)
    by_level, total_by_level = (-np.diff(part * window, prepend=0, append=0) for part in (waves, np.ones(len(line))))
    phase = np.exp(-1j * np.angle(wave))
    change = (phase[:, None] * by_level).real / abs(total) - np.outer(transfer, total_by_level / total)
    restored = np.sinc(cycles_per_px / BINS_PER_PX) ** 2
    return transfer / restored, change / restored[:, None]
