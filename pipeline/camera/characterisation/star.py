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

Black and white rays centred between pixels alias where next to nothing blurs them: of a blur of 0.3 px the MTF is 0.07
too high at 0.49 of Nyquist.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import mtf
from pipeline.camera.clipping import ENDS, clipping, refuse_clipped, saturated_at
from pipeline.camera.correlated_sum import sum_variance
from pipeline.errors import InputError, did_you_mean

DIRECTIONS = ("all", *mtf.DIRECTIONS)
SECTOR_DEG = 10.0  # half the opening of a sector
FULL_SECTOR_PERIODS = 60  # of stars with fewer rays `measure_mtf` widens sectors, to hold as many rays as of this one
LEAST_PERIODS = 24  # fewer leave too few pixels in a sector of the circle of the highest of the eight frequencies
RING_STEPS = 5  # pixels, towards the centre, over which the rays of a circle are averaged before they are counted
SAMPLES_PER_RAY = 16
CLIPPING_RING_PX, CLIPPING_BINS, CLIPPING_SECTORS = 2.5, 96, 18  # half the ring, bins of a ray, sectors to align rays
MOST_CLIPPING = 0.25  # errors of the MTF are below 0.03 up to there; sharp rays of white at exactly 255 DN give 0.24
HALF_BAND_FRACTION, LEAST_HALF_BAND = 0.04, 3  # of the number of rays: room for a shifted or slightly tilted star


def measure(
    image: np.ndarray,
    centre_px: tuple[float, float],
    periods: int,
    frequencies_cycles_per_px: Any,
    *,
    amplitude: float,
    direction: str = "all",
    ring_px: float = 1.5,
    sector_deg: float = SECTOR_DEG,
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
    return _contrast(
        image, centre_px, periods, frequencies_cycles_per_px,
        amplitude=amplitude, direction=direction, ring_px=ring_px, sector_deg=sector_deg,
    )[0]  # fmt: skip


def _contrast(
    image: np.ndarray,
    centre_px: tuple[float, float],
    periods: int,
    frequencies_cycles_per_px: Any,
    *,
    amplitude: float,
    direction: str,
    ring_px: float = 1.5,
    sector_deg: float,
) -> tuple[np.ndarray, np.ndarray]:
    """(k,) contrast as `measure` gives it, and its standard error by the scatter of the pixels about the fits."""
    image = np.asarray(image, dtype=np.float64)
    frequencies = np.atleast_1d(np.asarray(frequencies_cycles_per_px, dtype=np.float64))
    _check(image, periods, frequencies, amplitude, direction)
    x = np.arange(image.shape[1])[None, :] - float(centre_px[0])
    y = float(centre_px[1]) - np.arange(image.shape[0])[:, None]
    radius, angle = np.hypot(x, y), np.arctan2(y, x)
    contrast, error = np.empty(frequencies.size), np.empty(frequencies.size)
    for index, frequency in enumerate(frequencies):
        circle_px = periods / (2 * math.pi * frequency)
        _check_circle(circle_px, centre_px, image.shape, frequency, direction)
        ring = np.abs(radius - circle_px) <= ring_px
        across, turn, values = (radius[ring] - circle_px) / ring_px, angle[ring], image[ring]
        amplitudes, variances = [], []
        for middle in _sector_middles(direction, sector_deg):
            along = ((turn - middle + math.pi) % (2 * math.pi) - math.pi) / math.radians(sector_deg)
            inside = np.abs(along) <= 1
            fit = _amplitude(
                values[inside], periods * turn[inside], across[inside], along[inside],
                circle_px * math.radians(sector_deg),
            )  # fmt: skip
            amplitudes.append(fit[0])
            variances.append(fit[1])
        contrast[index] = np.mean(amplitudes) / amplitude
        error[index] = math.sqrt(sum(variances)) / len(variances) / amplitude
    return contrast, error


def _sector_middles(direction: str, sector_deg: float) -> np.ndarray:
    """Directions from the centre to the middles of the sectors to fit, radians."""
    if direction == "horizontal":
        return np.array([math.pi / 2, -math.pi / 2])
    if direction == "vertical":
        return np.array([0.0, math.pi])
    return np.linspace(0, 2 * math.pi, math.ceil(180 / sector_deg), endpoint=False)


def _amplitude(
    values: np.ndarray, phase: np.ndarray, across: np.ndarray, along: np.ndarray, half_arc_px: float
) -> tuple[float, float]:
    """Least-squares amplitude of a sinusoid in the middle of a patch where it varies slowly, and its variance.

    Pixels may be correlated with their neighbours (`pipeline.camera.correlated_sum`).

    Args:
        values: (n,) brightness.
        phase: (n,) of the sinusoid, radians.
        across: (n,) position across the ring, [-1, 1].
        along: (n,) position along it, [-1, 1].
        half_arc_px: half the patch's length, pixels.

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
    pair = [slow.shape[1], 2 * slow.shape[1]]
    amplitude = math.hypot(*solution[pair])
    towards = solution[pair] / max(amplitude, 1e-300)
    change = (towards @ np.linalg.pinv(design)[pair]) * _noise(values, design, slow, phase)
    columns = ((along + 1) * half_arc_px).astype(np.int64)
    by_column = np.zeros(columns.max() + 1)
    np.add.at(by_column, columns, change)
    return amplitude, max(float(sum_variance(by_column[:, None])[0]), float(np.square(change).sum()))


def _noise(values: np.ndarray, design: np.ndarray, slow: np.ndarray, phase: np.ndarray) -> np.ndarray:
    """Deviations (n,) of the pixels of a patch from the fit of its rays, scaled up by what the fit takes of them.

    The third harmonic of black and white rays is none. Where a patch has too few pixels for that harmonic, near the
    centre, pixels or blur have averaged it out.
    """
    third = np.concatenate([slow * np.sin(3 * phase)[:, None], slow * np.cos(3 * phase)[:, None]], axis=1)
    if len(values) >= 2 * (design.shape[1] + third.shape[1]):
        design = np.concatenate([design, third], axis=1)
    residual = values - design @ np.linalg.lstsq(design, values, rcond=None)[0]
    return np.asarray(residual * math.sqrt(len(values) / (len(values) - design.shape[1])))


def measure_mtf(image: np.ndarray, centre_px: tuple[float, float], periods: int, *, amplitude: float) -> np.ndarray:
    """The horizontal and vertical MTF at the paper's eight frequencies.

    Sectors open by 10 degrees to either side, of stars with fewer than `FULL_SECTOR_PERIODS` rays by 600 / n. Each then
    holds at least 3.3 rays, which keeps the odd harmonics of black and white rays out of the fit, and, from
    `LEAST_PERIODS` rays, enough pixels on the smallest circle.

    Args:
        image: (H, W) linear brightness.
        centre_px: see `measure`.
        periods: see `measure`.
        amplitude: see `measure`.

    Returns:
        (2, 8) float64 contrast at `pipeline.camera.mtf.FREQUENCIES`; rows horizontal, vertical.

    Raises:
        InputError: see `measure`.
    """
    return measure_mtf_with_error(image, centre_px, periods, amplitude=amplitude)[0]


def measure_mtf_with_error(
    image: np.ndarray, centre_px: tuple[float, float], periods: int, *, amplitude: float
) -> tuple[np.ndarray, np.ndarray]:
    """As `measure_mtf`, with the standard error.

    Returns:
        (2, 8) float64 contrast and (2, 8) its standard error by the scatter of the pixels about the fitted rays; of
        noise that is correlated over several pixels about two thirds of it, since fits to short arcs take a part.
    """
    cycles_per_px = mtf.FREQUENCIES / 2
    sector_deg = SECTOR_DEG * max(1.0, FULL_SECTOR_PERIODS / periods)
    parts = [
        _contrast(
            image, centre_px, periods, cycles_per_px, amplitude=amplitude, direction=direction, sector_deg=sector_deg
        )
        for direction in mtf.DIRECTIONS
    ]
    return np.stack([contrast for contrast, _ in parts]), np.stack([error for _, error in parts])


def lowest_circle_px(periods: int) -> float:
    """Radius of the circle on which a star of so many rays has the lowest of the paper's eight frequencies, pixels."""
    return float(periods / (math.pi * mtf.FREQUENCIES[0]))


@dataclass(frozen=True)
class RayEvidence:
    """How much the circles of a picture look like those of a star with a given number of rays.

    Attributes:
        explained: (k,) fraction of the variance along each circle that lies within a few orders of the ray frequency.
        extra_rays: (k,) turns that the phase of those orders makes about the centre: rays counted less rays expected.
        agreement: (k - 1,) correlation, -1 to 1, of the rays on neighbouring circles; 1 where their phases are equal.
        likely_rays: number of rays that explains most of the outermost circle.
        likely_explained: fraction of its variance that those explain.
    """

    explained: NDArray[np.float64]
    extra_rays: NDArray[np.int64]
    agreement: NDArray[np.float64]
    likely_rays: int
    likely_explained: float


def ray_evidence(
    image: np.ndarray, centre_px: tuple[float, float], periods: int, radii_px: NDArray[np.float64]
) -> RayEvidence:
    """Whether a picture shows a Siemens star of a number of rays.

    The brightness L(t) along a circle has the Fourier coefficients c_k. A star of n rays has its power at k = n, and
    close to it where its centre is misplaced or the star tilted, which modulate the phase slowly. With a half band
    b = max(3, 0.04 n),

        z(t) = sum over |k - n| <= b of c_k exp(j (k - n) t),    explained = sum |c_k|^2 in the band / sum |c_k|^2

    where the second sum runs from n / 4, which leaves out uneven light, to 4 n, which leaves out noise. The phase of z
    is the same on all circles, and does not turn about the centre unless the number of rays differs from n.

    Args:
        image: (H, W) linear brightness.
        centre_px: (x, y) of the star's centre; (0, 0) is the middle of the top left pixel.
        periods: n, bright rays in a full turn, at least 4.
        radii_px: (k,) circles, from the outermost inwards; each inside the picture, above `RING_STEPS` px.

    Returns:
        the evidence; 0 explained and 0 agreement for a circle without any structure.
    """
    from scipy.ndimage import map_coordinates

    count = SAMPLES_PER_RAY * periods
    turn = 2 * math.pi * np.arange(count) / count
    steps = np.arange(RING_STEPS)[:, None]
    half_band = _half_band(periods)
    picture = np.asarray(image, dtype=np.float64)
    explained, extra, rays, power = [], [], [], np.zeros(0)
    for radius_px in radii_px:
        x = centre_px[0] + (radius_px - steps) * np.cos(turn)
        y = centre_px[1] - (radius_px - steps) * np.sin(turn)
        profile = map_coordinates(picture, [y, x], order=1, mode="nearest").mean(axis=0)
        spectrum = np.fft.rfft(profile) / count
        squares = np.abs(spectrum) ** 2
        squares[: periods // 4], squares[4 * periods + 1 :] = 0.0, 0.0
        power = squares if not power.size else power
        band = np.arange(periods - half_band, periods + half_band + 1)
        explained.append(float(squares[band].sum() / max(squares.sum(), 1e-300)))
        envelope = np.exp(1j * np.outer(turn, band - periods)) @ spectrum[band]
        steps_of_phase = np.angle(np.roll(envelope, -1) * envelope.conj())
        extra.append(round(float(steps_of_phase.sum()) / (2 * math.pi)))
        rays.append(envelope)
    agreement = [
        float(np.vdot(inner, outer).real / max(np.linalg.norm(inner) * np.linalg.norm(outer), 1e-300))
        for outer, inner in pairwise(rays)
    ]
    likely = int(power.argmax())
    half_band = _half_band(likely)
    near = power[max(likely - half_band, 0) : likely + half_band + 1].sum()
    return RayEvidence(
        np.array(explained), np.array(extra, dtype=np.int64), np.array(agreement), likely,
        float(near / max(power.sum(), 1e-300)),
    )  # fmt: skip


def check_clipping(image: np.ndarray, centre_px: tuple[float, float], periods: int) -> None:
    """Refuse a star whose rays are cut off at black or white, whose contrast at the lowest frequency is too low then.

    The rays on the circle of the lowest frequency are laid over each other by their phase, sector by sector; a ray has
    two transitions.

    Args:
        image: (H, W) brightness in [0, 1].
        centre_px: (x, y) of the star's centre; (0, 0) is the middle of the top left pixel.
        periods: n, bright rays in a full turn.

    Raises:
        InputError: `pipeline.camera.clipping.clipping` exceeds `MOST_CLIPPING`.
    """
    x = np.arange(image.shape[1])[None, :] - float(centre_px[0])
    y = float(centre_px[1]) - np.arange(image.shape[0])[:, None]
    ring = np.abs(np.hypot(x, y) - lowest_circle_px(periods)) <= CLIPPING_RING_PX
    turn = np.arctan2(y, x)[ring]
    values = np.asarray(image, dtype=np.float64)[ring]
    phase = np.empty_like(turn)
    sectors = ((turn + math.pi) * CLIPPING_SECTORS / (2 * math.pi)).astype(np.int64) % CLIPPING_SECTORS
    for sector in range(CLIPPING_SECTORS):
        inside = sectors == sector
        wave = np.exp(-1j * periods * turn[inside]) @ (values[inside] - values[inside].mean())
        phase[inside] = periods * turn[inside] + np.angle(wave)
    index = (phase / (2 * math.pi) % 1 * CLIPPING_BINS).astype(np.int64) % CLIPPING_BINS
    count = np.maximum(np.bincount(index, minlength=CLIPPING_BINS), 1)
    levels, *saturated = (
        np.bincount(index, weights=part, minlength=CLIPPING_BINS) / count
        for part in (values, *(saturated_at(values, end) for end in ENDS))
    )
    refuse_clipped("star", [clipping(levels, fraction) / 2 for fraction in saturated], MOST_CLIPPING)


def _half_band(periods: int) -> int:
    """Orders on either side of the ray frequency that belong to the rays."""
    return max(LEAST_HALF_BAND, round(HALF_BAND_FRACTION * periods))


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
