"""The paper's published program, quirks and all, so that differences from its numbers can be explained.

What it does otherwise than the physical chain (Wischow et al. 2023, code release; each was read or measured):

* reset noise is ``exp(N(0, s)) - 1`` volts, and lowers the signal;
* source-follower noise lacks the step of its frequency integral (0.027 e- instead of 6.1) and is rounded to whole
  electrons: it is always zero;
* the noise map includes full-well clipping and rounding down to electrons, and *that* is amplified to the level;
* 8-bit output is truncated, not rounded (half a DN darker on average);
* noise and blur are separate programs with an 8-bit image in between; the blur continues the frame by darkness and
  truncates again;
* until December 2022 the mean of ``|n|`` was scaled to the level instead of its standard deviation (a normal's
  deviation is then 1.25 times the level), and the converter's full scale was 256 instead of 255, so that a signal-
  proportional part leaked into the noise map and was amplified with it.

The off-centre, one pixel too wide defocus disc is an option of `psf.create` (``camera="authors"``).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import draws
from pipeline.camera.constants import BOLTZMANN_J_PER_K, ELECTRON_CHARGE_C, FULL_SCALE_DN
from pipeline.camera.effects import Effects
from pipeline.camera.quantise import full_range
from pipeline.camera.sensor import Sensor
from pipeline.camera.truth import Corrupted, Float
from pipeline.errors import InputError
from pipeline.streams import KeyPart

Double = NDArray[np.float64]


@dataclass(frozen=True)
class Program:
    """One state of the paper's program.

    Attributes:
        name: recorded as the frame's camera.
        scaling: what is brought to the level: ``std`` of the noise map, or ``mean_abs``, the mean of its absolute.
        full_scale: of the converter, DN.
        rounds: rounds before it truncates.
    """

    name: str
    scaling: Literal["std", "mean_abs"]
    full_scale: float
    rounds: bool


PROGRAMS = {
    "authors": Program("authors", "std", 255.0, rounds=False),
    "authors_2022": Program("authors_2022", "mean_abs", 256.0, rounds=True),
}


def raw_dn(
    signal_e: Float,
    effects: Effects,
    sensor: Sensor,
    temperature_k: float,
    exposure_s: float,
    generator: np.random.Generator,
    full_scale: float = 255.0,
) -> Double:
    """The program's converter output before any scaling, neither rounded nor clipped.

    Args:
        signal_e: (H, W) mean electrons.
        effects: what is on.
        sensor: the sensor, at gain 1.
        temperature_k: sensor temperature.
        exposure_s: exposure time.
        generator: where the draws come from.
        full_scale: of the converter, DN.

    Returns:
        (H, W) float64 DN.
    """
    electrons = signal_e.astype(np.float64)
    if effects.photon:
        electrons = generator.poisson(electrons).astype(np.float64)
    if effects.dark:
        mean_e = sensor.dark_electrons(temperature_k, exposure_s)
        electrons += generator.poisson(mean_e, electrons.shape)
        if effects.zero_mean_dark:
            electrons -= mean_e
    if effects.source_follower:
        sigma_e = sensor.source_follower_sigma_e("authors")
        electrons += np.rint(generator.standard_normal(electrons.shape) * sigma_e)
    electrons = np.floor(np.clip(electrons, 0.0, sensor.full_well_e))
    volts = sensor.reference_v - electrons * sensor.sense_node_gain_v_per_e
    if effects.reset and sensor.kind == "cmos":
        sigma_v = np.sqrt(BOLTZMANN_J_PER_K * temperature_k / sensor.sense_node_capacitance_f)
        volts += sensor.reset_factor * np.expm1(generator.standard_normal(electrons.shape) * sigma_v)
    volts *= sensor.source_follower_gain * sensor.cds_gain
    lowest_v = ELECTRON_CHARGE_C * sensor.sense_node_gain_v_per_e / sensor.sense_node_capacitance_f
    return full_scale / (sensor.voltage_at_full_well_v - lowest_v) * (sensor.reference_v - volts)


def add_noise(scene_dn: Double, raw: Double, sigma_dn: float, program: Program) -> tuple[Double, Float, float]:
    """Scale the program's noise map to a level, add it, and make 8 bit of it as the program does.

    Args:
        scene_dn: (H, W) the frame, 0..255.
        raw: (H, W) `raw_dn` of it.
        sigma_dn: the level.
        program: which state of the program.

    Returns:
        whole DN (H, W), the scaled noise map before clipping (H, W) in DN, and the factor.

    Raises:
        InputError: there is no noise to scale.
    """
    noise = (raw - scene_dn).astype(np.float32)
    size = float(np.std(noise) if program.scaling == "std" else np.mean(np.abs(noise)))
    alike = program.scaling == "std" and noise.min() == noise.max()  # where rounding errors of the sum remain
    if alike or not size > 0.0:
        raise InputError(f"no noise scale reaches {sigma_dn:g} DN: the effects give no noise on this frame")
    noise_scale = sigma_dn / size
    noise *= np.float32(noise_scale)
    out = scene_dn + noise
    if program.rounds:
        out = np.rint(out)
    return np.trunc(np.clip(out, 0.0, FULL_SCALE_DN)), noise, noise_scale


def blur_8bit(dn: Double, psf: NDArray[np.floating]) -> Double:
    """The program's blur: FFT convolution with darkness beyond the frame, truncated to whole DN.

    Args:
        dn: (H, W) whole DN.
        psf: (h, w) kernel.

    Returns:
        (H, W) whole DN; rounding errors of the transform make a constant 255 partly 254, as in the program.
    """
    from scipy.signal import convolve

    blurred = convolve(dn.astype(np.uint8), np.asarray(psf, dtype=np.float32), mode="same")
    return np.trunc(np.clip(blurred, 0.0, FULL_SCALE_DN)).astype(np.float64)


def corrupt(
    signal_e: Float,
    name: str,
    effects: Effects,
    sigma_dn: float,
    generator: np.random.Generator,
    sensor: Sensor,
    *,
    psf: NDArray[np.floating] | None,
    program: Program,
    key: tuple[KeyPart, ...] = (),
) -> Corrupted:
    """Corrupt a frame as the paper's programs do: photon noise, then blur; any other noise after the blur.

    Args:
        signal_e: (H, W) mean electrons of the frame.
        name: of the effects, recorded.
        effects: what is on.
        sigma_dn: the level; 0 leaves noise out.
        generator: forked as in the physical chain, so that both draw the same conditions.
        sensor: the sensor, at gain 1 and without a measured read noise.
        psf: kernel, or None.
        program: which state of the program.
        key: recorded in the result.

    Returns:
        the frame and its truth; all noise is under ``photon`` (before the blur) or ``total`` (after).

    Raises:
        InputError: a sensor that the program does not know.
    """
    if sensor.gain != 1.0 or sensor.read_noise_e is not None:
        raise InputError("camera=authors knows neither sensor.gain nor sensor.read_noise_e; use camera=physical")
    conditions, draws_from = draws.fork(generator, 4)[:2]
    temperature_k = float(conditions.uniform(*effects.temperature_k))
    exposure_s = float(conditions.uniform(*effects.exposure_s))
    dn = signal_e.astype(np.float64) * (FULL_SCALE_DN / sensor.full_well_e)
    first = effects == Effects(photon=True, temperature_k=effects.temperature_k, exposure_s=effects.exposure_s)
    noise_e: dict[str, Float] = {}
    noise_scale, outside = 0.0, 0.0
    for step in ("noise", "blur") if first else ("blur", "noise"):
        if step == "blur" and psf is not None:
            dn = blur_8bit(np.trunc(dn + 1e-3), psf)
        elif step == "noise" and sigma_dn > 0.0:
            before = (dn * (sensor.full_well_e / FULL_SCALE_DN)).astype(np.float32)
            raw = raw_dn(before, effects, sensor, temperature_k, exposure_s, draws_from, program.full_scale)
            scene_dn = dn
            dn, noise, noise_scale = add_noise(scene_dn, raw, sigma_dn, program)
            wanted = scene_dn + noise
            outside = float(np.count_nonzero((wanted < 0.0) | (wanted > FULL_SCALE_DN))) / wanted.size
            noise_e["photon" if first else "total"] = noise * np.float32(sensor.electrons_per_dn)
    return Corrupted(
        image=full_range(dn.astype(np.float32)),
        noise_source=name,
        target_sigma_dn=float(sigma_dn),
        noise_scale=noise_scale,
        sensor=sensor,
        temperature_k=temperature_k,
        exposure_s=exposure_s,
        signal_e=signal_e,
        noise_e=noise_e,
        psf=psf,
        boundary="zero",
        clipped_fraction=outside,
        camera=program.name,
        key=key,
    )
