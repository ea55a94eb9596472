"""Image formation in linear light: scene radiance, exposure time and gain to an 8-bit frame of a real camera.

Light that optics or motion have spread is still Poisson distributed at the pixel, so blur comes before shot noise::

    radiance x time -> motion, defocus -> photo-electrons ~ Poisson -> dark current ~ Poisson -> full well
        -> read noise before and after the gain -> gain -> converter -> tone curve -> 8 bit

With K = 255 g / N_fw (DN per electron at gain g, full well N_fw) and mean electrons e::

    variance_dn2 = K^2 (e + D + r(g)^2) + q,     r(g)^2 = r_before^2 + (r_after / g)^2

D dark electrons, q the variance of the converter's rounding. For a picture whose brightness the gain restores
(e ~ 1 / g) shot noise grows with sqrt(g) and read noise with g. ``noise_gain: linear`` replaces both by g, the
assumption of Wischow et al. 2023 (Sec. III, alpha * sigma). Source of the linear model: EMVA Standard 1288, release 4.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.arrays import as_array, refuse_masked
from pipeline.camera import draws
from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.camera.psf import create as create_psf
from pipeline.camera.sensor import Sensor, check_base_gain
from pipeline.camera.tone_curve import encode, noise_after_curve
from pipeline.camera.truth import through_optics
from pipeline.errors import InputError, did_you_mean
from pipeline.streams import KeyPart, stream

NoiseGain = Literal["physical", "linear"]
NOISE_GAINS = ("physical", "linear")
SATURATED_LEVEL = 0.98
"""Linear level from which a pixel counts as saturated: read noise spreads pixels of a full well below full scale."""

_TABULATED = 256  # levels at which the noise of a frame is computed

_MOST_COUNTED_E = np.float32(2.0**19)  # brighter light than this is far beyond any well: it is not drawn

Float = NDArray[np.float32]
Double = NDArray[np.float64]


class NoiseBudget(NamedTuple):
    """Standard deviation of each noise source in linear DN, (...) arrays or floats on the 0..255 scale.

    ``shot`` photon shot noise, ``dark`` dark-current shot noise, ``read`` read noise, ``rounding`` of the converter.
    """

    shot: Double
    dark: Double
    read: Double
    rounding: Double

    @property
    def total(self) -> Double:
        """Root of the sum of squares."""
        return np.sqrt(self.shot**2 + self.dark**2 + self.read**2 + self.rounding**2)


@dataclass(frozen=True)
class Motion:
    """Speed of the image over the sensor during the exposure, and defocus.

    Attributes:
        speed_px_s: pixels per second, at least 0.
        direction_deg: direction of the motion, counter-clockwise from horizontal.
        defocus_px: diameter of the disc of defocus, pixels; at most 1 is none.
    """

    speed_px_s: float = 0.0
    direction_deg: float = 0.0
    defocus_px: float = 0.0

    def length_px(self, exposure_s: float) -> float:
        """Length of the motion blur: speed times exposure time."""
        return self.speed_px_s * exposure_s


@dataclass(frozen=True, eq=False)
class Exposed:
    """A frame and the ground truth of its formation.

    Attributes:
        image: (H, W) float32 in [0, 1] on the 8-bit grid, tone curve applied.
        electrons: (H, W) mean photo-electrons after blur and before noise, e-.
        blur_px: length of the motion blur.
        saturated_fraction: fraction of pixels at or above `SATURATED_LEVEL` as delivered. The mean dark signal D is
            subtracted behind the full well, so that a full well reads ``1 - D / N_fw`` at gain 1: in exposures so long
            or hot that D nears 2 % of the well (the paper's sensor: 0.26 s at 300 K, 0.03 s at 330 K), full wells are
            not counted unless the gain lifts them above that level.
        sigma_dn: median over the pixels of the noise's standard deviation after the tone curve, before rounding to
            8 bit (`Camera.sigma_dn`).
    """

    image: Float
    electrons: Float
    blur_px: float
    saturated_fraction: float
    sigma_dn: float


@dataclass(frozen=True)
class Camera:
    """A camera in linear light.

    Attributes:
        sensor: its sensor, at gain 1.
        radiance_at_full_scale: radiance that fills the well at ``reference_exposure_s``, gain 1 and light 1.
        reference_exposure_s: see above.
        gamma: of the tone curve ``x ** (1 / gamma)``; 1 is linear.
        noise_gain: ``physical``; or ``linear``: at kept brightness all noise grows in proportion to the gain.
        temperature_k: of the sensor.
        adc_bits: of the converter.

    Raises:
        InputError: a value out of range.
    """

    sensor: Sensor = field(default_factory=Sensor)
    radiance_at_full_scale: float = 2.5
    reference_exposure_s: float = 0.008
    gamma: float = 2.2
    noise_gain: NoiseGain = "physical"
    temperature_k: float = 300.0
    adc_bits: int = 12

    def __post_init__(self) -> None:
        for name in ("radiance_at_full_scale", "reference_exposure_s", "gamma", "temperature_k"):
            value = getattr(self, name)
            if not 0.0 < value < float("inf"):
                raise InputError(f"camera.{name} must be a number above 0, got {value!r}")
        if self.noise_gain not in NOISE_GAINS:
            hint = did_you_mean(str(self.noise_gain), NOISE_GAINS)
            raise InputError(f"camera.noise_gain '{self.noise_gain}' is unknown; {hint}")
        if not 8 <= self.adc_bits <= 24:
            raise InputError(f"camera.adc_bits is a number of bits in 8..24, got {self.adc_bits!r}")
        if self.sensor.gain != 1.0:
            raise InputError(f"camera.sensor.gain must be 1, got {self.sensor.gain:g}; the gain is a setting per frame")

    def electrons(self, radiance: ArrayLike, exposure_s: float, light: float = 1.0) -> Float:
        """Mean photo-electrons: ``N_fw light R t / (R_full t_ref)``.

        Args:
            radiance: (H, W) scene radiance, at least 0.
            exposure_s: exposure time, above 0 s.
            light: illumination relative to that of the radiance.

        Returns:
            (H, W) float32 e-, not clipped.

        Raises:
            InputError: radiance, time or light out of range, or masked pixels.
        """
        array = as_array(radiance)
        refuse_masked(array, "radiance")
        scene = np.asarray(array, dtype=np.float32)
        if scene.ndim != 2 or scene.size == 0:
            raise InputError(f"radiance is an image (height, width), got shape {scene.shape}")
        if not (np.isfinite(scene).all() and float(scene.min()) >= 0.0):
            raise InputError("radiance: expected finite numbers of at least 0")
        check_settings(exposure_s, 1.0)
        if not 0.0 <= light < float("inf"):
            raise InputError(f"light is a factor of at least 0, got {light!r}")
        factor = light * exposure_s / (self.radiance_at_full_scale * self.reference_exposure_s)
        return scene * np.float32(factor * self.sensor.full_well_e)

    def budget(self, electrons: ArrayLike, gain: ArrayLike, exposure_s: ArrayLike) -> NoiseBudget:
        """Noise of each source in closed form, before clipping.

        Args:
            electrons: (...) mean photo-electrons, e-.
            gain: (...) camera gain, ISO / base ISO, above 0.
            exposure_s: (...) exposure time, above 0 s.

        Returns:
            standard deviations on the linear 0..255 scale; shapes broadcast.

        Raises:
            InputError: gain or time out of range.
        """
        check_settings(exposure_s, gain)
        mean = np.maximum(np.asarray(electrons, dtype=np.float64), 0.0)
        gains = np.asarray(gain, dtype=np.float64)
        sensor = self.sensor
        after: ArrayLike = 1.0  # gain that read noise behind the gain stage is divided by
        if self.noise_gain == "linear":  # the noise of a base-gain frame of the same brightness, times the gain
            mean = mean * gains
        elif sensor.read_noise_e is not None:
            after = gains
        read: ArrayLike = np.hypot(sensor.read_noise_e or 0.0, sensor.read_noise_after_gain_e / np.asarray(after))
        if sensor.read_noise_e is None:
            read = sensor.readout_sigma_e(self.temperature_k)
        scale = sensor.dn_per_electron * gains
        dark = sensor.dark_electrons(self.temperature_k, 1.0) * np.asarray(exposure_s, dtype=np.float64)
        rounding = FULL_SCALE_DN / (2**self.adc_bits - 1) / np.sqrt(12.0)
        return NoiseBudget(
            scale * np.sqrt(mean),
            np.asarray(scale * np.sqrt(dark)),
            np.asarray(scale * np.asarray(read)),
            np.asarray(rounding),
        )

    def sigma_dn(self, electrons: ArrayLike, gain: float, exposure_s: float) -> float:
        """Median over the pixels of the noise after the tone curve (`tone_curve.noise_after_curve`), DN.

        Saturated pixels are left out; a frame with nothing else gives 0. It is the noise before the frame is rounded to
        8 bit, which adds about 1/12 DN^2 and counts where noise is weak: frames of 0.379 DN have 0.476 DN as delivered.

        Args:
            electrons: (H, W) mean photo-electrons, e-.
            gain: see `budget`.
            exposure_s: see `budget`.
        """
        mean_e = np.asarray(electrons, dtype=np.float64).reshape(-1)
        mean_e = mean_e[:: max(1, mean_e.size // 20_000)]
        level = mean_e * self.sensor.dn_per_electron * gain / FULL_SCALE_DN
        level = level[level < 1.0]
        if not level.size:
            return 0.0
        tabulated = np.linspace(0.0, 1.0, _TABULATED) ** 2  # finer in the dark, where the curve bends
        return float(np.median(np.interp(level, tabulated, self.sigma_dn_at(tabulated, gain, exposure_s))))

    def sigma_dn_at(self, linear_level: ArrayLike, gain: ArrayLike, exposure_s: ArrayLike) -> NDArray[np.float64]:
        """Noise after the tone curve of pixels of one level, DN.

        Args:
            linear_level: (...) mean level in linear light, 0..1.
            gain: (...) camera gain.
            exposure_s: (...) exposure time, s.

        Raises:
            InputError: see `budget`.
        """
        linear = self.linear_sigma_dn(linear_level, gain, exposure_s)
        return FULL_SCALE_DN * noise_after_curve(np.asarray(linear_level), linear / FULL_SCALE_DN, self.gamma)

    def linear_sigma_dn(self, linear_level: ArrayLike, gain: ArrayLike, exposure_s: ArrayLike) -> NDArray[np.float64]:
        """Noise of pixels of one level before the tone curve, on the linear 0..255 scale; see `sigma_dn_at`."""
        level, gains = np.asarray(linear_level, dtype=np.float64), np.asarray(gain, dtype=np.float64)
        mean_e = level * FULL_SCALE_DN / (self.sensor.dn_per_electron * gains)
        return self.budget(mean_e, gains, exposure_s).total

    def expose(
        self,
        radiance: ArrayLike,
        exposure_s: float,
        gain: float,
        generator: np.random.Generator,
        *,
        light: float = 1.0,
        motion: Motion | None = None,
        poisson: draws.PoissonMethod = "exact",
    ) -> Exposed:
        """Form one frame.

        Equal generators give common random numbers: at different settings read noise comes from the same normals, dark
        counts from the same random words, and a photon count is a monotone function of the same normal where its mean
        is at least `draws.HYBRID_FROM` (64) at both settings. The photon noise of a pixel that is fainter at either
        setting is practically independent.

        Args:
            radiance: (H, W) scene radiance, at least 0.
            exposure_s: exposure time, above 0 s.
            gain: camera gain, ISO / base ISO, at least 1.
            generator: where all noise comes from.
            light: illumination relative to that of the radiance.
            motion: movement of the image and defocus; None for none.
            poisson: see `draws.poisson`.

        Returns:
            the frame and its truth.

        Raises:
            InputError: radiance, time, gain, light or motion out of range.
        """
        check_settings(exposure_s, gain)
        check_base_gain("gain", gain)
        moving = motion or Motion()
        mean_e = self.electrons(radiance, exposure_s, light)
        for psf in kernels(moving, exposure_s):
            mean_e = through_optics(mean_e, psf, "reflect")
        # Far beyond the well nothing but saturation can be seen, and Poisson means stay in their range. Behind the
        # optics only: what a lamp spreads over its surroundings is not limited by the well.
        mean_e = np.minimum(mean_e, np.float32(8.0 * self.sensor.full_well_e))
        codes = self._converted(mean_e, gain, exposure_s, generator, poisson)
        image, saturated_from = _of_codes(self.adc_bits, self.gamma)
        return Exposed(
            image=np.take(image, codes, mode="clip"),
            electrons=mean_e,
            blur_px=moving.length_px(exposure_s),
            saturated_fraction=float(np.mean(codes >= saturated_from)),
            sigma_dn=self.sigma_dn(mean_e, gain, exposure_s),
        )

    def _converted(
        self,
        mean_e: Float,
        gain: float,
        exposure_s: float,
        generator: np.random.Generator,
        poisson: draws.PoissonMethod,
    ) -> NDArray[np.intp]:
        """(H, W) numbers that the converter gives, 0 .. 2^bits - 1, linear in the light."""
        photons, heat, electronics = draws.fork(generator, 3)
        dark = self.sensor.dark_electrons(self.temperature_k, exposure_s)
        if self.noise_gain == "linear":
            at = self.sensor
            bright = np.minimum(mean_e * np.float32(gain), _MOST_COUNTED_E)
            charge = mean_e + (draws.poisson(bright, photons, poisson) - bright)
        else:
            at = self.sensor.at_gain(gain)
            counted = np.minimum(mean_e, _MOST_COUNTED_E)
            charge = draws.poisson(counted, photons, poisson) + (mean_e - counted)
        charge += draws.poisson_even(dark, charge.shape, heat)
        if self.noise_gain == "physical":
            np.minimum(charge, np.float32(self.sensor.full_well_e), out=charge)
        charge -= np.float32(dark)
        charge += draws.normals(charge.shape, electronics, at.readout_sigma_e(self.temperature_k))
        dn = charge * np.float32(self.sensor.dn_per_electron * gain)
        dn /= np.float32(FULL_SCALE_DN / (2**self.adc_bits - 1))
        np.rint(dn, out=dn)
        return np.clip(dn, np.float32(0.0), np.float32(2**self.adc_bits - 1), out=dn).astype(np.intp)


@lru_cache(maxsize=4)
def _of_codes(adc_bits: int, gamma: float) -> tuple[Float, int]:
    """Grey level in [0, 1] on the 8-bit grid of every number of a converter, and the first that is saturated."""
    full = np.float32(FULL_SCALE_DN)
    unit = np.float32(FULL_SCALE_DN / (2**adc_bits - 1))
    level = np.clip(np.arange(2**adc_bits, dtype=np.float32) * unit / full, np.float32(0.0), np.float32(1.0))
    image = np.rint(encode(level, gamma) * full) / full
    return image.astype(np.float32), int(np.count_nonzero(level < SATURATED_LEVEL))


def kernels(motion: Motion, exposure_s: float) -> list[Float]:
    """Kernels of motion and defocus, those that blur at all.

    Raises:
        InputError: a speed or diameter that is negative or not finite.
    """
    for name, value in (("speed_px_s", motion.speed_px_s), ("defocus_px", motion.defocus_px)):
        if not 0.0 <= value < float("inf"):
            raise InputError(f"motion.{name} is a number of at least 0, got {value!r}")
    results = []
    if motion.length_px(exposure_s) > 1.0:
        results.append(create_psf("linear_motion", motion.length_px(exposure_s), motion.direction_deg))
    if motion.defocus_px > 1.0:
        results.append(create_psf("defocus", motion.defocus_px))
    return results


def noise_generator(seed: int, *parts: KeyPart) -> np.random.Generator:
    """The stream of one frame's noise; settings are no part of it, for common random numbers (`Camera.expose`)."""
    return stream(seed, "exposure", *parts)


def check_settings(exposure_s: ArrayLike, gain: ArrayLike) -> None:
    """Refuse an exposure time or gain that is not a positive number.

    Raises:
        InputError: naming the value.
    """
    for name, value, words in (
        ("exposure_s", exposure_s, "a time above 0 s"),
        ("gain", gain, "a factor above 0 (ISO / base ISO)"),
    ):
        numbers = np.asarray(value, dtype=np.float64)
        if not (np.isfinite(numbers) & (numbers > 0.0)).all():
            raise InputError(f"{name} is {words}, got {value!r}")
