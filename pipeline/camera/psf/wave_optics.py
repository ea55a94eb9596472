"""Point-spread functions of real optics, rendered by wave optics.

A lens is a pupil and a wavefront error W. Each wavelength forms |FFT(pupil exp(i 2 pi W / wavelength))|^2 on a grid
finer than its diffraction limit; wavelengths are averaged, and the light is moved by hand shake, integrated over square
pixels and centred by factors on its spectrum, so that nothing is interpolated:

    pupil      round, with a central obstruction (mirror lens), a polygon (iris of flat blades), or the overlap of two
               discs (vignetted: "cat's eye")
    W          defocus, as the diameter of the disc of geometric optics, with a share that differs by colour; and
               astigmatism, coma, spherical aberration: Zernike polynomials normalised to unit rms (Noll 1976), in waves
    shake      tremor of 8-12 Hz in both directions that dies away, and drift, over the exposure
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.psf.kernel import centroid_px
from pipeline.streams import stream

PIXEL_UM = 5.0  # as the study's sensor
WAVELENGTHS_UM = (0.47, 0.55, 0.63)
SHARES = (0.25, 0.5, 0.25)  # of the light
REFERENCE_UM = 0.55  # that aberrations are counted in
LEAST_FIELD_PX = 64  # side of the rendered square
SAMPLES = 640  # about its side in samples
LARGEST_PX = 33  # side of a kernel
KEPT = 0.995  # of the light, unless that takes more than `LARGEST_PX`
EDGE_SAMPLES = 4  # per sample of the pupil and direction, for smooth edges
INSTANTS = 600  # of an exposure

Array = NDArray[Any]


@dataclass(frozen=True)
class Lens:
    """A lens at one place of its image.

    Attributes:
        f_number: focal length over diameter.
        blades: corners of the iris; 0 is round.
        iris_deg: rotation of the iris.
        obstruction: diameter of the central obstruction, as a share.
        vignetting: shift of the second disc that cuts the pupil, in radii; 0 is none.
        vignetting_deg: direction of that shift.
        defocus_px: diameter of the geometric disc at the full diameter; negative beyond focus.
        colour_px: how much more of it at the longest wavelength, and less at the shortest.
        astigmatism, coma, spherical: rms waves at 0.55 um.
        astigmatism_deg, coma_deg: their directions.
    """

    f_number: float
    blades: int = 0
    iris_deg: float = 0.0
    obstruction: float = 0.0
    vignetting: float = 0.0
    vignetting_deg: float = 0.0
    defocus_px: float = 0.0
    colour_px: float = 0.0
    astigmatism: float = 0.0
    astigmatism_deg: float = 0.0
    coma: float = 0.0
    coma_deg: float = 0.0
    spherical: float = 0.0


@dataclass(frozen=True)
class Shake:
    """A hand's motion: longer side of its bounding box in pixels, and the exposure in seconds."""

    travel_px: float
    exposure_s: float


@dataclass(frozen=True)
class Optics:
    """A named lens, held still or shaken, of a named group."""

    name: str
    group: str
    lens: Lens = field(repr=False)
    shake: Shake | None = None


def render(optics: Optics, seed: int) -> tuple[NDArray[np.float32], float]:
    """One kernel.

    Args:
        optics: what forms it.
        seed: root of the shake's stream.

    Returns:
        (n, n) float32 of unit sum, n odd and at most 33, centroid in the middle; and the diameter of the circle about
        the centroid with 90 % of the light, pixels.
    """
    light = Light.of(optics, seed)
    shift_px, half = 0j, LARGEST_PX // 2
    for turn in range(4):
        if turn == 1:  # once centred: how large it is
            half = _half_side(light.at(shift_px))
        psf = _middle(light.at(shift_px), half)
        shift_px += complex(*centroid_px(psf))
    psf = _middle(light.at(shift_px), half)
    return (psf / psf.sum()).astype(np.float32), _diameter_px(light.at(shift_px, light.fineness), light.fineness)


@dataclass(frozen=True)
class Light:
    """The light of one point on an even square, by its spectrum, seen through square pixels.

    Attributes:
        spectrum: (n, n) complex, frequencies as `numpy.fft`, 1 at 0.
        fineness: samples per pixel.
    """

    spectrum: Array
    fineness: int

    @classmethod
    def of(cls, optics: Optics, seed: int) -> Light:
        """Render; see `render` for the arguments."""
        lens = optics.lens
        # Two samples or more per finest fringe of intensity; a field large enough for many samples over the pupil.
        fineness = int(np.ceil(2 * PIXEL_UM / (min(WAVELENGTHS_UM) * lens.f_number)))
        field_px = LEAST_FIELD_PX * max(1, round(SAMPLES / (LEAST_FIELD_PX * fineness)))
        intensity = np.zeros((field_px * fineness,) * 2)
        for step, (wavelength_um, share) in enumerate(zip(WAVELENGTHS_UM, SHARES, strict=True)):
            defocus_px = lens.defocus_px + (step - 1) * lens.colour_px
            intensity += share * _monochromatic(lens, wavelength_um, defocus_px, field_px, fineness)
        spectrum = np.fft.fft2(intensity)
        f = np.fft.fftfreq(len(spectrum), 1 / fineness)  # cycles per pixel
        spectrum *= np.sinc(f)[:, None] * np.sinc(f)
        if optics.shake is not None:
            path = shake_path(optics.shake, stream(seed, "hand shake", optics.name))
            across, down = (np.exp(-2j * np.pi * np.outer(f, part)) for part in (path.real, path.imag))
            spectrum *= down @ across.T / len(path)
        return cls(spectrum, fineness)

    def at(self, shift_px: complex = 0j, each_px: int = 1) -> Array:
        """What square pixels gather, (m, m) of sum each_px^2.

        Args:
            shift_px: which place of the image comes to lie on the middle pixel, [m // 2, m // 2]; x right, y down.
            each_px: values per pixel and direction, a divisor of `fineness`.
        """
        f = np.fft.fftfreq(len(self.spectrum), 1 / self.fineness)
        moved = np.outer(np.exp(2j * np.pi * f * shift_px.imag), np.exp(2j * np.pi * f * shift_px.real))
        step = self.fineness // each_px
        side = len(f) // step
        # To take every so many values is to add up the frequencies that then look alike.
        folded = (self.spectrum * moved).reshape(step, side, step, side).sum(axis=(0, 2))
        return np.maximum(np.fft.fftshift(np.fft.ifft2(folded).real), 0.0) * each_px**2


def shake_path(shake: Shake, generator: np.random.Generator) -> Array:
    """Where the image is at even instants of an exposure: (600,) complex, pixels, x right and y down, about 0."""
    time_s = (np.arange(INSTANTS) + 0.5) / INSTANTS * shake.exposure_s
    heading = 2 * np.pi * generator.random()
    path = generator.uniform(2, 6) * time_s * np.exp(1j * heading)  # drift; tremor's amplitude is about 1
    for direction in (1, 1j):
        for _ in range(2):
            hertz, phase = generator.uniform(8, 12), generator.uniform(0, 2 * np.pi)
            fading_s = generator.uniform(0.1, 0.4)
            wave = np.sin(2 * np.pi * hertz * time_s + phase) * np.exp(-time_s / fading_s)
            path = path + direction * generator.uniform(0.3, 1) * wave
    path = path * (shake.travel_px / max(np.ptp(path.real), np.ptp(path.imag)))
    return path - path.mean()


def diffraction_mtf(f_number: float, cycles_per_px: Array) -> Array:
    """MTF of a clear round lens without error, wavelengths averaged: 2/pi (acos v - v sqrt(1 - v^2)), v = f L N."""
    total = np.zeros(np.shape(cycles_per_px))
    for wavelength_um, share in zip(WAVELENGTHS_UM, SHARES, strict=True):
        v = np.minimum(np.asarray(cycles_per_px) * wavelength_um * f_number / PIXEL_UM, 1.0)
        total += share * 2 / np.pi * (np.arccos(v) - v * np.sqrt(1 - v**2))
    return total


def _monochromatic(lens: Lens, wavelength_um: float, defocus_px: float, field_px: int, fineness: int) -> Array:
    """Intensity of unit sum on (field_px fineness)^2 samples, the axis at [0, 0]."""
    side = field_px * fineness
    across = field_px * PIXEL_UM / (wavelength_um * lens.f_number)  # samples over the pupil's diameter
    half = int(across / 2) + 2
    steps = np.arange(-half, half + 1)
    parts = (np.arange(EDGE_SAMPLES) + 0.5) / EDGE_SAMPLES - 0.5
    fine = (steps[:, None] + parts).ravel() * 2 / across
    inside = _aperture(lens, fine[None, :], fine[:, None])
    amplitude = inside.reshape(len(steps), EDGE_SAMPLES, len(steps), EDGE_SAMPLES).mean(axis=(1, 3))
    x = steps * 2 / across
    waves = wavefront_um(lens, defocus_px, x[None, :], x[:, None]) / wavelength_um
    pupil = np.zeros((side, side), complex)
    position = slice(side // 2 - half, side // 2 + half + 1)
    pupil[position, position] = amplitude * np.exp(2j * np.pi * waves)
    intensity = np.abs(np.fft.fft2(np.fft.ifftshift(pupil))) ** 2
    return intensity / intensity.sum()


def _aperture(lens: Lens, x: Array, y: Array) -> Array:
    """Whether light passes at a place of the pupil, radii from its middle."""
    squared = x**2 + y**2
    inside = (squared <= 1) & (squared >= lens.obstruction**2)
    if lens.blades:
        for blade in range(lens.blades):
            normal = np.radians(lens.iris_deg) + 2 * np.pi * blade / lens.blades
            inside &= x * np.cos(normal) + y * np.sin(normal) <= np.cos(np.pi / lens.blades)
    if lens.vignetting:
        angle = np.radians(lens.vignetting_deg)
        inside &= (x - lens.vignetting * np.cos(angle)) ** 2 + (y - lens.vignetting * np.sin(angle)) ** 2 <= 1
    return inside


def wavefront_um(lens: Lens, defocus_px: float, x: Array, y: Array) -> Array:
    """W in micrometres at a place of the pupil, radii from its middle.

    A wavefront w r^2 sends rays to 2 N dW/dr, so a geometric disc of diameter d has w = d / (8 N).
    """
    r = np.hypot(x, y)
    angle = np.arctan2(y, x)
    aberrations = (
        lens.astigmatism * np.sqrt(6) * r**2 * np.cos(2 * (angle - np.radians(lens.astigmatism_deg)))
        + lens.coma * np.sqrt(8) * (3 * r**3 - 2 * r) * np.cos(angle - np.radians(lens.coma_deg))
        + lens.spherical * np.sqrt(5) * (6 * r**4 - 6 * r**2 + 1)
    )
    return defocus_px * PIXEL_UM / (8 * lens.f_number) * r**2 + REFERENCE_UM * aberrations


def _half_side(whole: Array) -> int:
    """Pixels on each side of the middle that a kernel needs."""
    held = np.array([_middle(whole, half).sum() for half in range(LARGEST_PX // 2 + 1)])
    return int(min(np.searchsorted(held, KEPT * whole.sum()), LARGEST_PX // 2))


def _middle(whole: Array, half: int) -> Array:
    centre = len(whole) // 2
    return whole[centre - half : centre + half + 1, centre - half : centre + half + 1]


def _diameter_px(fine: Array, fineness: int, share: float = 0.9) -> float:
    """Diameter of the circle about the middle with a share of the light, pixels."""
    position = (np.arange(len(fine)) - len(fine) // 2) / fineness
    radius = np.hypot(position[:, None], position).ravel()
    order = np.argsort(radius, kind="stable")
    held = np.cumsum(fine.ravel()[order])
    return 2 * float(radius[order][np.searchsorted(held, share * held[-1])])
