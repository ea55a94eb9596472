"""The Siemens star: the MTF of a whole camera, measured from one picture.

The star's brightness is a sinusoid in the angle about its centre, n periods to a turn:

    L(r, t) = m + a sin(n t),

so that on the circle of radius r the local frequency is n / (2 pi r) cycles per pixel along the tangent. On the
circle of radius n / (2 pi f) the sinusoid's amplitude, found by least squares, over the known amplitude a is the
MTF at frequency f. Near the top and bottom of the circle, where the tangent is horizontal, it is the horizontal MTF,
near the left and right the vertical one. Each sector of a circle is fitted by itself, so neither an asymmetric blur nor
an error of the centre, both of which shift the phase differently in different directions, lowers the answer. What
stays is the bend of the rays within the blur: a blur of s pixels wants a circle of about 10 s pixels for errors below
0.005, hence many rays for high frequencies under strong blur.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pipeline.camera import mtf
from pipeline.errors import InputError, did_you_mean

DIRECTIONS = ("all", *mtf.DIRECTIONS)


def measure(
    image: np.ndarray,
    centre_px: tuple[float, float],
    periods: int,
    frequencies_cycles_per_px: Any,
    *,
    amplitude: float,
    direction: str = "all",
    ring_px: float = 1.5,
    sector_deg: float = 10.0,
) -> np.ndarray:
    """Contrast left at each frequency.

    In each sector of a ring the picture is fitted by sin and cos of n t, whose amplitudes may change linearly across
    the ring and quadratically along it; the answer is the amplitude in the sector's middle, averaged over sectors.

    Args:
        image: (H, W) linear brightness.
        centre_px: (x, y) of the star's centre; (0, 0) is the middle of the top left pixel.
        periods: n, bright rays in a full turn.
        frequencies_cycles_per_px: (k,) spatial frequencies, in (0, 0.5).
        amplitude: a, of the sinusoid in a perfectly sharp picture, in the image's own units; for black and white rays
            that of their first harmonic (4 / pi times half their difference).
        direction: ``"all"`` (mean over all directions), ``"horizontal"`` or ``"vertical"`` (two opposite sectors).
        ring_px: half the width of a ring, pixels.
        sector_deg: half the opening of a sector, degrees.

    Returns:
        (k,) float64 contrast, 1 for a perfect picture.

    Raises:
        InputError: a wrong argument, or a frequency whose circle does not lie in the image.
    """
    image = np.asarray(image, dtype=np.float64)
    frequencies = np.atleast_1d(np.asarray(frequencies_cycles_per_px, dtype=np.float64))
    _check(image, periods, frequencies, amplitude, direction)
    x = np.arange(image.shape[1])[None, :] - float(centre_px[0])
    y = float(centre_px[1]) - np.arange(image.shape[0])[:, None]
    radius, angle = np.hypot(x, y), np.arctan2(y, x)
    contrast = np.empty(frequencies.size)
    for index, frequency in enumerate(frequencies):
        circle_px = periods / (2 * math.pi * frequency)
        _check_circle(circle_px, centre_px, image.shape, frequency, direction)
        ring = np.abs(radius - circle_px) <= ring_px
        across, turn, values = (radius[ring] - circle_px) / ring_px, angle[ring], image[ring]
        amplitudes = []
        for middle in _sector_middles(direction, sector_deg):
            along = ((turn - middle + math.pi) % (2 * math.pi) - math.pi) / math.radians(sector_deg)
            inside = np.abs(along) <= 1
            amplitudes.append(_amplitude(values[inside], periods * turn[inside], across[inside], along[inside]))
        contrast[index] = np.mean(amplitudes) / amplitude
    return contrast


def _sector_middles(direction: str, sector_deg: float) -> np.ndarray:
    """Directions from the centre to the middles of the sectors to fit, radians."""
    if direction == "horizontal":
        return np.array([math.pi / 2, -math.pi / 2])
    if direction == "vertical":
        return np.array([0.0, math.pi])
    return np.linspace(0, 2 * math.pi, math.ceil(180 / sector_deg), endpoint=False)


def _amplitude(values: np.ndarray, phase: np.ndarray, across: np.ndarray, along: np.ndarray) -> float:
    """Least-squares amplitude of a sinusoid in the middle of a patch where it varies slowly.

    Args:
        values: (n,) brightness.
        phase: (n,) of the sinusoid, radians.
        across: (n,) position across the ring, [-1, 1].
        along: (n,) position along it, [-1, 1].

    Raises:
        InputError: too few pixels.
    """
    slow = np.stack([np.ones_like(across), across, along, along**2], axis=1)
    design = np.concatenate([slow, slow * np.sin(phase)[:, None], slow * np.cos(phase)[:, None]], axis=1)
    if len(values) < 2 * design.shape[1]:
        raise InputError(
            f"a sector of the star has {len(values)} pixels, too few to fit; use more periods, lower frequencies, or a "
            "larger ring_px or sector_deg"
        )
    solution = np.linalg.lstsq(design, values, rcond=None)[0]
    return math.hypot(solution[slow.shape[1]], solution[2 * slow.shape[1]])


def measure_mtf(image: np.ndarray, centre_px: tuple[float, float], periods: int, *, amplitude: float) -> np.ndarray:
    """The horizontal and vertical MTF at the paper's eight frequencies: (2, 8). See `measure` for the arguments."""
    cycles_per_px = mtf.FREQUENCIES / 2
    return np.stack(
        [
            measure(image, centre_px, periods, cycles_per_px, amplitude=amplitude, direction=direction)
            for direction in mtf.DIRECTIONS
        ]
    )


def synthesise(
    height_px: int,
    width_px: int,
    periods: int,
    *,
    centre_px: tuple[float, float] | None = None,
    mean: float = 0.5,
    amplitude: float = 0.35,
    supersample: int = 1,
) -> np.ndarray:
    """A perfect star on a pixel grid.

    Args:
        height_px: height of the picture.
        width_px: width of the picture.
        periods: n, bright rays in a full turn.
        centre_px: (x, y), by default the middle of the picture.
        mean: m, brightness about which the rays swing, [0, 1].
        amplitude: a, of the rays, [0, 1].
        supersample: points per pixel and axis, averaged; 1 takes the value at the pixel's middle, many give the MTF
            sinc(fx) sinc(fy) of a square pixel.

    Returns:
        (H, W) float32. Inside the radius where rays are finer than half a cycle per point it is plain `mean`.

    Raises:
        InputError: sizes, periods or supersample below 1.
    """
    if min(height_px, width_px, periods, supersample) < 1:
        raise InputError("height_px, width_px, periods and supersample of a star must be at least 1")
    if centre_px is None:
        centre_px = ((width_px - 1) / 2, (height_px - 1) / 2)
    step = (np.arange(supersample) + 0.5) / supersample - 0.5
    x = (np.arange(width_px)[:, None] + step).reshape(1, -1) - centre_px[0]
    finest_px = periods / math.pi / supersample
    image = np.empty((height_px, width_px), np.float32)
    for row in range(height_px):
        y = centre_px[1] - (row + step[:, None])
        value = np.where(np.hypot(x, y) < finest_px, 0.0, np.sin(periods * np.arctan2(y, x)))
        image[row] = mean + amplitude * value.reshape(supersample, width_px, supersample).mean(axis=(0, 2))
    return image


def _check(image: np.ndarray, periods: int, frequencies: np.ndarray, amplitude: float, direction: str) -> None:
    """Raises InputError for arguments of `measure` that no star has."""
    if image.ndim != 2:
        raise InputError(f"the picture of a star has shape {image.shape}; expected (H, W)")
    if periods < 4:
        raise InputError(f"periods is {periods!r}; expected at least 4 rays in a turn")
    if not np.all((frequencies > 0) & (frequencies < 0.5)):
        raise InputError("frequencies_cycles_per_px must lie between 0 and 0.5 (Nyquist)")
    if not (math.isfinite(amplitude) and amplitude > 0):
        raise InputError(f"amplitude is {amplitude!r}; expected the positive amplitude of the sharp star")
    if direction not in DIRECTIONS:
        raise InputError(f"unknown direction '{direction}'; {did_you_mean(direction, DIRECTIONS)}")


def _check_circle(
    circle_px: float, centre_px: tuple[float, float], shape: tuple[int, ...], frequency: float, direction: str
) -> None:
    """Raises InputError where a circle leaves the picture."""
    room_x = min(centre_px[0], shape[1] - 1 - centre_px[0])
    room_y = min(centre_px[1], shape[0] - 1 - centre_px[1])
    room = {"all": min(room_x, room_y), "horizontal": room_y, "vertical": room_x}[direction]
    if circle_px > room:
        raise InputError(
            f"frequency {frequency:g} cycles/px lies on a circle of {circle_px:.0f} px about the star's centre, but "
            f"the picture ends after {room:.0f} px; use fewer periods or a higher frequency"
        )
