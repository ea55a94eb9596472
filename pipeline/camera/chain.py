"""The ordered chain of image formation, each effect switchable.

Two orders. ``paper`` (Wischow et al. 2023, Sec. III), which its tables need::

    photon shot noise -> optics (blur) -> dark current -> [full well, whole electrons] -> readout -> quantisation

and ``detector``, that of a camera: light that optics have spread is still Poisson distributed at the pixel::

    optics (blur) -> photon shot noise -> dark current -> [full well, whole electrons] -> readout -> quantisation

Of a mean of 400 e- behind an 11 px disc a camera counts a variance of 400, neighbours uncorrelated; the paper's order
gives 4, neighbours correlated.

Noise may be amplified: each source's noise, ``effect(e) - e``, enters multiplied by one common factor (`noise_scale`),
at its own place in the chain. With 1 the frame is what the sensor would record; the paper's levels of 5 to 25 DN take
factors of 3 to 50 (`corruption`). Clipping and rounding happen once, where a camera does them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline import freed_memory
from pipeline.camera import draws
from pipeline.camera.blocks import blocks
from pipeline.camera.dark_current import dark_noise
from pipeline.camera.effects import PRESETS, Effects, preset
from pipeline.camera.photon import photon_shot
from pipeline.camera.quantise import as_image, collect, digitise, full_range
from pipeline.camera.readout import read_noise
from pipeline.camera.sensor import Sensor
from pipeline.camera.truth import ORDERS, Boundary, Corrupted, Float, Order, through_optics
from pipeline.errors import InputError, did_you_mean
from pipeline.streams import KeyPart

__all__ = [
    "PRESETS",
    "Drawn",
    "Effects",
    "arriving",
    "as_image",
    "develop",
    "draw",
    "expose",
    "preset",
    "record",
    "untouched",
]

freed_memory.keep()  # pages of a new frame take longer than its random numbers


@dataclass(frozen=True, eq=False)
class Drawn:
    """Noise of one frame as drawn, natural size.

    Attributes:
        noise_e: (H, W) e- of ``photon``, ``dark`` and ``readout``, those that are on.
        temperature_k, exposure_s: the conditions drawn.
    """

    noise_e: dict[str, Float]
    temperature_k: float
    exposure_s: float


def draw(
    signal_e: Float,
    effects: Effects,
    sensor: Sensor,
    generator: np.random.Generator,
    *,
    poisson: draws.PoissonMethod = "exact",
) -> Drawn:
    """Draw conditions and noise of every source that is on.

    Each source has its own stream, forked in a fixed order: switching one off leaves the others' noise unchanged.

    Args:
        signal_e: (H, W) mean electrons, at least 0.
        effects: what is on.
        sensor: the sensor.
        generator: where everything comes from.
        poisson: see `draws.poisson`.

    Raises:
        InputError: conditions or signal out of range.
    """
    conditions, photons, heat, electronics = draws.fork(generator, 4)
    temperature_k = float(conditions.uniform(*effects.temperature_k))
    exposure_s = float(conditions.uniform(*effects.exposure_s))
    noise: dict[str, Float] = {}
    if effects.photon:
        noise["photon"] = photon_shot(signal_e, photons, poisson)
        noise["photon"] -= signal_e
    if effects.dark:
        noise["dark"] = dark_noise(
            signal_e.shape,
            sensor,
            temperature_k,
            exposure_s,
            heat,
            zero_mean=effects.zero_mean_dark,
        )
    if effects.reset or effects.source_follower:
        noise["readout"] = read_noise(
            signal_e.shape,
            sensor,
            temperature_k,
            electronics,
            reset=effects.reset,
            source_follower=effects.source_follower,
        )
    return Drawn(noise, temperature_k, exposure_s)


def develop(
    signal_e: Float,
    drawn: Drawn,
    sensor: Sensor,
    *,
    noise_scale: float = 1.0,
    psf: NDArray[np.floating] | None = None,
    boundary: Boundary = "reflect",
    quantise: bool = True,
    noise_source: str = "",
    target_sigma_dn: float = float("nan"),
    poisson: str = "exact",
    order: Order = "paper",
    key: tuple[KeyPart, ...] = (),
) -> Corrupted:
    """Run the chain with noise already drawn.

    Args:
        signal_e: (H, W) mean electrons.
        drawn: the noise; its arrays are multiplied by ``noise_scale`` in place.
        sensor: the sensor.
        noise_scale: factor on all noise.
        psf: kernel of the optics, unit sum; None for none.
        boundary: what the blur sees beyond the frame.
        quantise: full well, whole electrons, rounding and clipping to 8 bit.
        noise_source: name of the effects, recorded in the result.
        target_sigma_dn: the level asked for, recorded.
        poisson: how counts were drawn, recorded.
        order: whether photon noise comes before the optics (``paper``) or after them (``detector``).
        key: of the random stream, recorded.

    Returns:
        the frame and its truth.
    """
    noise = drawn.noise_e
    if noise_scale != 1.0:
        for source in noise.values():
            source *= np.float32(noise_scale)
    light = signal_e
    if "photon" in noise and order == "paper":
        light = light + noise["photon"]
    if psf is not None:
        light = through_optics(light, psf, boundary)
    if "photon" in noise and order == "detector":
        light = light + noise["photon"]
    image, clipped = record(light, noise.get("dark"), noise.get("readout"), sensor, quantise=quantise)
    return Corrupted(
        image=image,
        noise_source=noise_source,
        target_sigma_dn=target_sigma_dn,
        noise_scale=noise_scale if noise else 0.0,
        sensor=sensor,
        temperature_k=drawn.temperature_k,
        exposure_s=drawn.exposure_s,
        signal_e=signal_e,
        noise_e=noise,
        psf=psf,
        boundary=boundary,
        clipped_fraction=clipped,
        poisson=poisson,
        order=order,
        key=key,
    )


def arriving(signal_e: Float, psf: NDArray[np.floating] | None, boundary: Boundary, order: Order) -> Float:
    """Mean electrons that photon noise is drawn on: of the scene (``paper``) or behind the optics (``detector``).

    Raises:
        InputError: unknown order.
    """
    if order not in ORDERS:
        raise InputError(f"camera.order '{order}' is unknown; {did_you_mean(str(order), ORDERS)}")
    return signal_e if psf is None or order == "paper" else through_optics(signal_e, psf, boundary)


def _to_8bit(electrons: Float, sensor: Sensor, out: Float) -> None:
    """The converter of a camera of 8 bits: the image of electrons (B,), in [0, 1], into ``out``."""
    full_range(digitise(electrons, sensor, out=out), out=out)


def record(
    light_e: Float,
    dark_e: Float | None,
    read_e: Float | None,
    sensor: Sensor,
    *,
    quantise: bool = True,
    convert: Callable[[Float, Sensor, Float], None] = _to_8bit,
) -> tuple[Float, float]:
    """From the light behind the optics to the image: everything after the blur, block by block.

    Args:
        light_e: (H, W) electrons freed by light.
        dark_e: (H, W) noise of dark current, e-, or None.
        read_e: (H, W) noise of readout, e-, or None.
        sensor: the sensor.
        quantise: full well, whole electrons, rounding and clipping to 8 bit; where no photon counts were drawn, whole
            electrons darken by half an electron, see `pipeline.camera.quantise.collect`.
        convert: writes the image of electrons (B,) into its last argument, which may be the first one; not called
            without ``quantise``.

    Returns:
        (H, W) image in [0, 1], and the share of pixels that would lie outside without clipping (0 without ``quantise``,
        where the image is the electrons over those at full scale).
    """
    image = np.empty(light_e.shape, np.float32)  # in C order, whatever that of the light: it is filled by blocks
    full = np.float32(sensor.electrons_at_full_scale)
    nothing: list[Float | None] = [None] * len(blocks(image))
    outside = 0.0
    for out, light, dark, read in zip(
        blocks(image),
        blocks(light_e),
        nothing if dark_e is None else blocks(dark_e),
        nothing if read_e is None else blocks(read_e),
        strict=True,
    ):
        charge = light if dark is None else light + dark
        unclipped = charge if read is None else charge + read
        if not quantise:
            np.divide(unclipped, full, out=out)
            continue
        outside += np.count_nonzero(unclipped < 0.0) + np.count_nonzero(unclipped > full)
        collect(charge, sensor, out=out)
        if read is not None:
            out += read
        convert(out, sensor, out)
    return image, float(outside) / image.size


def expose(
    image: ArrayLike,
    effects: Effects,
    generator: np.random.Generator,
    *,
    sensor: Sensor | None = None,
    psf: NDArray[np.floating] | None = None,
    noise_scale: float = 1.0,
    boundary: Boundary = "reflect",
    poisson: draws.PoissonMethod = "exact",
    order: Order = "paper",
    key: tuple[KeyPart, ...] = (),
) -> Corrupted:
    """Form one frame with noise of its natural size, or multiplied by a given factor.

    With nothing on and no kernel the frame is returned as it came, bit for bit.

    Args:
        image: (H, W) uint8, or float32 in [0, 1].
        effects: what is on.
        generator: where everything comes from.
        sensor: the paper's if None.
        psf: kernel of the optics, unit sum; None for none.
        noise_scale: factor on all noise; 0 switches it off.
        boundary: what the blur sees beyond the frame.
        poisson: see `draws.poisson`.
        order: see `develop`.
        key: of the random stream, recorded in the result.

    Returns:
        the frame and its truth.

    Raises:
        InputError: wrong image, noise scale, kernel, order or conditions.
    """
    if not 0.0 <= noise_scale < float("inf"):
        raise InputError(f"noise_scale is a factor of at least 0 on the noise, got {noise_scale!r}")
    used = sensor or Sensor()
    scene = as_image(image)
    signal_e = used.electrons(scene)
    on = effects if noise_scale > 0.0 else Effects(quantise=effects.quantise)
    if not on.noisy and psf is None and used.over_exposure == 1.0:
        return untouched(scene, signal_e, used, key=key)
    drawn = draw(arriving(signal_e, psf, boundary, order), on, used, generator, poisson=poisson)
    return develop(
        signal_e,
        drawn,
        used,
        noise_scale=noise_scale,
        psf=psf,
        boundary=boundary,
        quantise=effects.quantise,
        poisson=poisson,
        order=order,
        key=key,
    )


def untouched(
    scene: Float, signal_e: Float, sensor: Sensor, *, noise_source: str = "", key: tuple[KeyPart, ...] = ()
) -> Corrupted:
    """A frame to which nothing happened: the image itself, bit for bit.

    Args:
        scene: (H, W) float32 in [0, 1].
        signal_e: (H, W) its electrons.
        sensor: recorded in the result.
        noise_source: name of the effects, recorded.
        key: of the random stream, recorded.
    """
    return Corrupted(
        image=scene,
        noise_source=noise_source,
        target_sigma_dn=0.0,
        noise_scale=0.0,
        sensor=sensor,
        temperature_k=float("nan"),
        exposure_s=float("nan"),
        signal_e=signal_e,
        key=key,
    )
