"""Non-linear motion: a hand, a gimbal or a rough road moves the camera along a bent path during exposure.

A smooth random walk of our own, stated in full. With arc length s in [0, 1] and two independent smooth Gaussian
processes g, h of mean 0, variance 1 and autocorrelation exp(-(s - s')^2 / (4 w^2)),

    heading   phi(s) = 2 pi u + i pi a g(s)              u uniform in [0, 1)
    position  z(s)   = integral of exp(j phi) ds
    dwell     p(s)   = exp(i b h(s))                     light per unit length: the speed varies smoothly too

where i in [0, 1] is the intensity, a the bend (largest turns) and w the smoothness (length of a bend as a share
of the path). With i = 0 the path is a straight line. The path is scaled so that the longer side of its bounding
box, plus the one pixel of its width, is `size_px` before rotation, and moved so that its centre of light is the
centre pixel. Rotation acts on the path, not on pixels.
"""

from __future__ import annotations

import math

import numpy as np

from pipeline.camera import mtf
from pipeline.camera.psf.kernel import checked_size, finished
from pipeline.camera.psf.raster import quarter_turns, splat
from pipeline.errors import InputError

STEPS = 1024

PAPER_MTF = {
    3: (0.992, 0.968, 0.943, 0.895, 0.789, 0.635, 0.501, 0.360),
    7: (0.954, 0.825, 0.707, 0.511, 0.347, 0.317, 0.221, 0.137),
    11: (0.929, 0.744, 0.589, 0.399, 0.361, 0.287, 0.218, 0.140),
    15: (0.819, 0.431, 0.301, 0.306, 0.157, 0.137, 0.121, 0.094),
    21: (0.710, 0.377, 0.355, 0.256, 0.135, 0.120, 0.126, 0.103),
}
"""MTF of the paper's non-linear kernels by nominal size, averaged over horizontal, vertical and four rotations, at
`pipeline.camera.mtf.FREQUENCIES`."""


def create(
    size_px: float,
    angle_deg: float = 0.0,
    generator: np.random.Generator | None = None,
    *,
    intensity: float = 1.0,
    bend: float = 0.4,
    smoothness: float = 0.06,
    dwell: float = 0.4,
    match: str = "nominal",
    candidates: int = 64,
) -> np.ndarray:
    """The PSF of one random bent motion.

    Args:
        size_px: longer side of the bounding box at rotation 0, pixels, >= 0; at most 1 px is no blur.
        angle_deg: rotation, degrees, counter-clockwise as seen in the image. The same generator state and another
            angle give the same motion, rotated.
        generator: source of randomness (`pipeline.streams.stream`).
        intensity: i in [0, 1]; 0 is straight.
        bend: a, standard deviation of the heading as a share of pi at intensity 1, >= 0.
        smoothness: w, correlation length as a share of the path, in [0.005, 1].
        dwell: b, standard deviation of the logarithm of light per unit length at intensity 1, >= 0.
        match: ``"paper"`` draws `candidates` motions and keeps the one whose MTF, averaged over directions, is nearest
            to that of the paper's kernel of this size (`PAPER_MTF`): random motions of one size differ widely in
            strength, and the paper's were picked by hand.
        candidates: how many to choose from with ``match="paper"``, >= 1.

    Returns:
        (n, n) float32, non-negative, sum 1, n odd: the smallest array that holds the motion about its centre of light.

    Raises:
        InputError: no generator, a parameter outside its range, or no kernel of this size in the paper.
    """
    size_px = checked_size(size_px, "nonlinear_motion")
    if generator is None:
        raise InputError("nonlinear_motion is random: pass generator=streams.stream(seed, 'psf', ...)")
    shape = {"intensity": intensity, "bend": bend, "smoothness": smoothness, "dwell": dwell}
    if match == "nominal":
        return drawn(*walk(generator, **shape), size_px, angle_deg)
    if match != "paper":
        raise InputError(f"unknown match '{match}'; known: nominal, paper")
    if size_px not in PAPER_MTF or candidates < 1:
        known = ", ".join(map(str, PAPER_MTF))
        raise InputError(
            f"match='paper' for a nonlinear motion of {size_px:g} px out of {candidates} candidates; expected a "
            f"size of the paper ({known}) and at least one candidate"
        )
    walks = [walk(generator, **shape) for _ in range(candidates)]
    # Turns by 90 degrees only swap the horizontal and the vertical curve.
    curves = [np.mean([mtf.sample(drawn(*item, size_px, angle)) for angle in (0, 45)], axis=(0, 1)) for item in walks]
    distances = np.abs(np.array(curves) - PAPER_MTF[int(size_px)]).mean(axis=1)
    return drawn(*walks[int(distances.argmin())], size_px, angle_deg)


def drawn(path: np.ndarray, light: np.ndarray, size_px: float, angle_deg: float) -> np.ndarray:
    """A path as a PSF: scaled to its size, centred on its light, rotated, in pixels.

    Args:
        path: (k,) complex, y upwards, any scale.
        light: (k,) positive.
        size_px: longer side of the bounding box at rotation 0, pixels, including the path's width of 1.
        angle_deg: rotation, degrees, counter-clockwise.

    Returns:
        (n, n) float32, sum 1, n odd.
    """
    turns, rest_deg = quarter_turns(angle_deg)
    extent = max(np.ptp(path.real), np.ptp(path.imag))
    path = path * (max(size_px - 1.0, 0.0) / extent)
    path = (path - np.average(path, weights=light)) * np.exp(1j * math.radians(rest_deg))
    return finished(np.rot90(splat(path.real, path.imag, light), turns))


def walk(
    generator: np.random.Generator, *, intensity: float, bend: float, smoothness: float, dwell: float
) -> tuple[np.ndarray, np.ndarray]:
    """A path of unit length and the light on it; see the module's equations and `create` for the arguments.

    Returns:
        position: (STEPS,) complex, y upwards, starts near 0.
        light: (STEPS,) positive.

    Raises:
        InputError: a parameter outside its range.
    """
    for name, value, low, high in (
        ("intensity", intensity, 0.0, 1.0),
        ("bend", bend, 0.0, 10.0),
        ("smoothness", smoothness, 0.005, 1.0),
        ("dwell", dwell, 0.0, 5.0),
    ):
        if not low <= value <= high:
            raise InputError(f"{name} of nonlinear_motion is {value!r}; expected a number in [{low:g}, {high:g}]")
    first = 2 * math.pi * generator.random()
    heading = first + intensity * math.pi * bend * _smooth_process(generator, smoothness)
    light = np.exp(intensity * dwell * _smooth_process(generator, smoothness))
    # Midpoints of the steps: the path's first and last half step carry no point of their own.
    steps = np.exp(1j * heading) / STEPS
    return np.cumsum(steps) - steps / 2, light


def _smooth_process(generator: np.random.Generator, smoothness: float) -> np.ndarray:
    """White noise filtered by a Gaussian of standard deviation `smoothness`, variance 1: (STEPS,)."""
    from scipy.fft import irfft, next_fast_len, rfft

    width = smoothness * STEPS
    margin = math.ceil(4 * width)
    count = next_fast_len(STEPS + 2 * margin, real=True)
    lags = np.arange(-margin, margin + 1)
    window = np.exp(-0.5 * (lags / width) ** 2)
    window /= math.sqrt(float(np.sum(window**2)))
    noise = generator.standard_normal(STEPS + 2 * margin)
    # Points whose whole window lies inside the noise: no end effects, so the process is stationary.
    return irfft(rfft(noise, count) * rfft(window, count), count)[2 * margin : 2 * margin + STEPS]
