"""Defocus: a uniform disc, the shadow of a round aperture (geometric optics).

    h(x, y) = s  where  x^2 + y^2 <= (d / 2)^2,  else 0,

with d the diameter of the circle of confusion (paper, Sec. III) and s making the sum 1.
Every pixel holds the exact area that the disc covers in it, so d may be any real number, the kernel is symmetric
and its centroid is the centre pixel. A disc of at most one pixel is a single pixel: no blur.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from pipeline.camera.psf.kernel import checked_size, finished
from pipeline.errors import InputError, did_you_mean

DIAMETERS = ("nominal", "effective")


def create(
    size_px: float,
    angle_deg: float = 0.0,
    generator: np.random.Generator | None = None,
    *,
    camera: str = "physical",
    diameter: Literal["nominal", "effective"] = "nominal",
    canvas_px: int = 33,
) -> np.ndarray:
    """The PSF of defocus.

    Args:
        size_px: diameter d of the disc, pixels, >= 0; at most 1 px is no blur, but with ``camera="authors"``.
        angle_deg: not used (the kernel is round); here because all kinds are called alike.
        generator: not used (nothing is random).
        camera: ``"authors"`` gives the array of the paper's program (`authors_disc`): half a pixel off centre.
        diameter: ``"nominal"`` draws a disc of diameter d; ``"effective"`` a centred disc of the area that the
            paper's program covers when asked for d (`effective_diameter_px`, about d + 1).
        canvas_px: side of the array with ``camera="authors"``.

    Returns:
        (n, n) float32, non-negative, sum 1, n odd.

    Raises:
        InputError: a negative or infinite size, an unknown diameter rule, or a canvas that is too small.
    """
    size_px = checked_size(size_px, "defocus")
    if camera == "authors":
        return authors_disc(size_px, canvas_px)
    if diameter not in DIAMETERS:
        raise InputError(f"unknown diameter rule '{diameter}'; {did_you_mean(diameter, DIAMETERS)}")
    return disc(effective_diameter_px(size_px) if diameter == "effective" and size_px > 1 else size_px)


def disc(diameter_px: float) -> np.ndarray:
    """A disc of any diameter, area-sampled exactly.

    Args:
        diameter_px: diameter, pixels, >= 0.

    Returns:
        (n, n) float32, sum 1, equal to its own transpose and mirror images; n is the smallest odd size that holds it.
    """
    radius = max(diameter_px, 1.0) / 2
    half = math.ceil(radius - 0.5)
    # Pixel edges to the right of the centre: 0, 0.5, 1.5 ... The first cell is half a pixel and counts twice.
    edges = np.concatenate([[0.0], np.arange(half + 1) + 0.5])
    corner = _area_beyond(edges[:, None], edges[None, :], radius)
    quadrant = corner[:-1, :-1] - corner[1:, :-1] - corner[:-1, 1:] + corner[1:, 1:]
    quadrant[0] *= 2
    quadrant[:, 0] *= 2
    upper = np.concatenate([quadrant[:0:-1], quadrant])
    return finished(np.clip(np.concatenate([upper[:, :0:-1], upper], axis=1), 0.0, None))


def _area_beyond(x: np.ndarray, y: np.ndarray, radius: float) -> np.ndarray:
    """Area of the disc's part with abscissa above x and ordinate above y, for x, y >= 0.

    The integral of sqrt(r^2 - t^2) - y over t from x to sqrt(r^2 - y^2), zero where the corner lies outside.
    """
    x, y = np.broadcast_arrays(np.minimum(x, radius), np.minimum(y, radius))
    end = np.sqrt(np.maximum(radius**2 - y**2, 0.0))

    def primitive(t: np.ndarray) -> np.ndarray:
        return 0.5 * (t * np.sqrt(np.maximum(radius**2 - t**2, 0.0)) + radius**2 * np.arcsin(t / radius))

    return np.where(x < end, primitive(end) - primitive(x) - y * (end - x), 0.0)


def authors_disc(size_px: float, canvas_px: int = 33) -> np.ndarray:
    """The disc as the paper's program draws it (for explaining differences; not for new work).

    The size is truncated to a whole number and made odd upwards; OpenCV draws an anti-aliased circle in half-pixel
    units about (canvas / 2, canvas / 2), which is half a pixel right of and below the centre pixel, and about one
    pixel wider than asked. The array is neither trimmed nor centred.

    Args:
        size_px: nominal diameter, pixels, >= 0.
        canvas_px: odd side of the array.

    Returns:
        (canvas_px, canvas_px) float32, sum 1.

    Raises:
        InputError: the canvas is even or does not hold the disc.
    """
    grey = authors_disc_grey(size_px, canvas_px)
    return (grey / grey.sum(dtype=np.float64)).astype(np.float32)


def authors_disc_grey(size_px: float, canvas_px: int = 33) -> np.ndarray:
    """The 8-bit picture behind `authors_disc`: (canvas_px, canvas_px) uint8; same arguments and errors."""
    import cv2

    odd = int(checked_size(size_px, "defocus")) // 2 * 2 + 1
    if canvas_px % 2 == 0 or canvas_px < odd + 4:
        raise InputError(
            f"canvas_px is {canvas_px}; expected an odd number of at least {odd + 4} for a disc of {odd} px"
        )
    canvas = np.zeros((canvas_px, canvas_px), np.uint8)
    cv2.circle(canvas, (canvas_px, canvas_px), odd, 255, thickness=-1, lineType=cv2.LINE_AA, shift=1)
    return canvas


def effective_diameter_px(size_px: float) -> float:
    """Diameter of the round disc with the area that the paper's program fills when asked for `size_px`.

    2 sqrt(A / pi), A the sum of the anti-aliased picture: 3.89, 8.23, 12.07, 15.94, 22.08 px for 3, 7, 11, 15, 21.
    """
    canvas_px = (int(checked_size(size_px, "defocus")) // 2 + 3) * 2 + 1
    area = authors_disc_grey(size_px, canvas_px).sum(dtype=np.float64) / 255
    return float(2 * math.sqrt(area / math.pi))
