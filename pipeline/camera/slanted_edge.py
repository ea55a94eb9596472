"""The MTF of a camera from a picture of a slanted edge.

After ISO 12233: a straight line is fitted to the edge's position in every row; all pixels are projected onto its normal
and averaged in bins of 1/4 px, which gives the edge-spread function (ESF); its derivative, windowed, is the line-spread
function, and

    MTF(f) = |sum LSF(d) exp(-2 pi j f d)| / |sum LSF(d)| / sinc^2(f / 4)

where one sinc belongs to the bins and one to the difference of neighbours. A nearly vertical edge gives the horizontal
MTF, a nearly horizontal one the vertical.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.camera.mtf import DIRECTIONS, FREQUENCIES
from pipeline.camera.quantise import check_finite
from pipeline.errors import InputError

BINS_PER_PX = 4
LEAST_SIDE_PX = 24
LEAST_CONTRAST_DN = 20.0
LEAST_TILT_DEG, MOST_TILT_DEG = 1.5, 30.0
LARGEST_DEVIATION_PX = 1.0  # median distance of the rows' edge positions from the line
WINDOW_PX = 24.0  # half-width of the window on the line-spread function
ROUNDS = 3


@dataclass(frozen=True)
class EdgeMtf:
    """The MTF that one edge gives.

    Attributes:
        direction: ``horizontal`` or ``vertical``.
        mtf: (8,) at `pipeline.camera.mtf.FREQUENCIES`.
        tilt_deg: angle of the edge to the nearest axis.
        contrast_dn: difference of both sides, DN.
    """

    direction: str
    mtf: NDArray[np.float64]
    tilt_deg: float
    contrast_dn: float


def measure(image: NDArray[np.floating]) -> EdgeMtf:
    """The MTF across the one edge of a picture.

    Args:
        image: (H, W) float in [0, 1], with a single straight edge, 1.5 to 30 degrees from the vertical or horizontal,
            that crosses the whole picture.

    Raises:
        InputError: the picture is too small, holds values that are not finite, or no such edge.
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
    return EdgeMtf(DIRECTIONS[0 if upright else 1], _transfer(rows, offset, slope), tilt, contrast_dn)


def _contrast(rows: NDArray[np.float64]) -> float:
    """Median difference between the outer eighths of the rows."""
    width = max(2, rows.shape[1] // 8)
    return float(abs(np.median(rows[:, :width].mean(axis=1) - rows[:, -width:].mean(axis=1))))


def _line(rows: NDArray[np.float64]) -> tuple[float, float]:
    """Offset and slope of the edge's column over the row, by centroids of the derivative, windowed around the line.

    Raises:
        InputError: the positions do not lie on a straight line.
    """
    slopes = np.abs(np.diff(rows, axis=1))
    columns, lines = np.arange(slopes.shape[1]) + 0.5, np.arange(len(rows))
    smooth = np.stack([np.convolve(line, np.ones(5) / 5, mode="same") for line in slopes])
    centre = smooth.argmax(axis=1).astype(np.float64) + 0.5
    fit = _robust_line(lines, centre)
    for _ in range(ROUNDS):
        distance = columns[None] - (fit[0] + fit[1] * lines)[:, None]
        weight = slopes * (np.abs(distance) < WINDOW_PX / 3)
        total = weight.sum(axis=1)
        centre = np.where(total > 0, (weight * columns).sum(axis=1) / np.maximum(total, 1e-12), centre)
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


def _transfer(rows: NDArray[np.float64], offset: float, slope: float) -> NDArray[np.float64]:
    """(8,) MTF from the oversampled edge-spread function."""
    columns, lines = np.arange(rows.shape[1]), np.arange(rows.shape[0])
    distance = (columns[None] - (offset + slope * lines)[:, None]) * math.cos(math.atan(slope))
    index = np.floor(distance * BINS_PER_PX).astype(np.int64)
    reach = int(WINDOW_PX * BINS_PER_PX)
    inside = np.abs(index) <= reach
    location, values = index[inside] + reach, rows[inside]
    count = np.bincount(location, minlength=2 * reach + 1)
    total = np.bincount(location, weights=values, minlength=2 * reach + 1)
    position = np.arange(2 * reach + 1)
    filled = count > 0
    spread = np.interp(position, position[filled], total[filled] / count[filled])
    line = np.diff(spread)
    where = (np.arange(len(line)) - reach + 1) / BINS_PER_PX
    centroid = float((np.abs(line) * where).sum() / np.abs(line).sum())
    window = 0.5 + 0.5 * np.cos(np.pi * np.clip((where - centroid) / WINDOW_PX, -1, 1))  # Hann
    line = line * window
    cycles_per_px = FREQUENCIES / 2
    transfer = np.abs(np.exp(-2j * np.pi * np.outer(cycles_per_px, where)) @ line) / abs(line.sum())
    return np.clip(transfer / np.sinc(cycles_per_px / BINS_PER_PX) ** 2, 0.0, 1.0)
