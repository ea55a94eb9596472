"""Linear motion: the camera or the object moves at constant speed along a straight line during exposure.

The PSF is a line of the length travelled and one pixel wide. Every pixel holds the area that this rectangle covers
in it; for an odd whole length along an axis that is the familiar row of equal weights. Length L along the direction
of motion gives MTF(f) close to |sinc(L f)|, f in cycles per pixel.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pipeline.camera.psf.kernel import checked_size, finished
from pipeline.camera.psf.raster import quarter_turns
from pipeline.errors import InputError

ROWS_PER_PIXEL = 64


class Line(NamedTuple):
    """A straight motion: direction at rotation 0 (degrees, counter-clockwise), length and width (pixels)."""

    tilt_deg: float
    length_px: float
    width_px: float


PAPER_LINES = {
    3: Line(151.2, 1.52, 1.27),
    7: Line(53.6, 7.99, 1.36),
    11: Line(79.7, 10.69, 1.36),
    13: Line(1.7, 12.82, 1.38),
    15: Line(155.7, 13.46, 1.50),
    21: Line(88.7, 19.44, 1.41),
}
"""What the paper's linear kernels are: their "0 degrees" point anywhere. Least mean absolute MTF difference over the
four rotations of each kernel, by nominal size."""


def create(
    size_px: float,
    angle_deg: float = 0.0,
    generator: np.random.Generator | None = None,
    *,
    tilt_deg: float = 0.0,
    width_px: float = 1.0,
    match: str = "nominal",
) -> np.ndarray:
    """The PSF of linear motion.

    Args:
        size_px: length of the motion, pixels, >= 0; at most 1 px is no blur, and between 1 and 2 px the line fades
            in, so that nothing jumps at any angle.
        angle_deg: rotation, degrees, counter-clockwise as seen in the image; at 0 the motion is horizontal.
        generator: not used (nothing is random); here because all kinds are called alike.
        tilt_deg: direction at rotation 0, degrees.
        width_px: width of the line, pixels, > 0.
        match: ``"paper"`` replaces direction, length and width by those of the paper's kernel of this size
            (`PAPER_LINES`).

    Returns:
        (n, n) float32, non-negative, sum 1, point-symmetric, n odd.

    Raises:
        InputError: a negative or infinite size, a width that is not positive, or no paper kernel of this size.
    """
    line = Line(tilt_deg, checked_size(size_px, "linear_motion"), width_px)
    if match == "paper":
        if size_px not in PAPER_LINES:
            known = ", ".join(map(str, PAPER_LINES))
            raise InputError(
                f"no linear motion kernel of {size_px:g} px in the paper; it has {known}; use match='nominal'"
            )
        line = PAPER_LINES[int(size_px)]
        return segment(line.length_px, line.tilt_deg + angle_deg, line.width_px)
    elif match != "nominal":
        raise InputError(f"unknown match '{match}'; known: nominal, paper")
    psf = segment(line.length_px, line.tilt_deg + angle_deg, line.width_px)
    # Even a unit square covers its neighbours once it is turned.
    share = min(max(line.length_px - 1.0, 0.0), 1.0)
    sharp = np.zeros_like(psf)
    sharp[len(psf) // 2, len(psf) // 2] = 1.0
    return finished(share * psf + (1 - share) * sharp)


def segment(length_px: float, angle_deg: float, width_px: float = 1.0) -> np.ndarray:
    """A centred rectangle, area-sampled.

    Each pixel row is cut into `ROWS_PER_PIXEL` thin rows; along a thin row the covered stretch is exact.

    Args:
        length_px: length, pixels; raised to 1.
        angle_deg: direction, degrees, counter-clockwise from the x axis.
        width_px: width across, pixels, > 0.

    Returns:
        (n, n) float32, sum 1; a rotation by 90 degrees is exactly ``numpy.rot90``.

    Raises:
        InputError: the width is not positive or the angle not finite.
    """
    if not (math.isfinite(width_px) and width_px > 0):
        raise InputError(f"width_px of a linear motion is {width_px!r}; expected a positive number of pixels")
    turns, rest_deg = quarter_turns(angle_deg)
    length_px = max(length_px, 1.0)
    cosine, sine = math.cos(math.radians(rest_deg)), math.sin(math.radians(rest_deg))
    half = math.ceil((length_px * max(cosine, sine) + width_px * max(cosine, sine)) / 2)
    edges = np.arange(2 * half + 2) - half - 0.5
    # Thin rows, from the top; y points up so that angles run counter-clockwise.
    y = half + 0.5 - (np.arange((2 * half + 1) * ROWS_PER_PIXEL) + 0.5) / ROWS_PER_PIXEL
    low = np.full_like(y, -np.inf)
    high = np.full_like(y, np.inf)
    for along_x, along_y, reach in ((cosine, sine, length_px / 2), (-sine, cosine, width_px / 2)):
        if abs(along_x) < 1e-12:
            high[np.abs(along_y * y) > reach] = -np.inf
            continue
        ends = np.stack([(-reach - along_y * y) / along_x, (reach - along_y * y) / along_x])
        low, high = np.maximum(low, ends.min(axis=0)), np.minimum(high, ends.max(axis=0))
    inside = high > low
    low, high = np.where(inside, low, 0.0), np.where(inside, high, 0.0)
    covered = np.diff(np.clip(edges[None, :], low[:, None], high[:, None]), axis=1)
    weights = covered.reshape(2 * half + 1, ROWS_PER_PIXEL, 2 * half + 1).mean(axis=1)
    return finished(np.rot90(weights, turns))
