"""Corruption to a target sigma in linear light: decode, form, encode.

A picture's grey levels are encoded by a tone curve; photons and electrons are proportional to the light behind it. Here
the picture is decoded (gamma 2.2), noise and blur act on linear light, and the result is encoded again. The target is
the standard deviation of the noise *after* the tone curve, which amplifies noise in the shadows, cuts it at black and
compresses it in the highlights; beyond white the curve goes on. The factor on the noise that reaches it is found by
bisection on every n-th pixel, in the order of rows.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.bisection import bisected
from pipeline.camera import chain, draws
from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.camera.sensor import Sensor
from pipeline.camera.tone_curve import decode, encode
from pipeline.camera.truth import Boundary, Corrupted, Float, Order, through_optics
from pipeline.errors import InputError
from pipeline.streams import KeyPart

GRID_PIXELS = 60_000
LEAST_COLUMNS = 100
ADC_BITS = 12
_HALVINGS = 30


def corrupt(
    scene: Float,
    name: str,
    effects: chain.Effects,
    sigma_dn: float,
    generator: np.random.Generator,
    sensor: Sensor,
    *,
    psf: NDArray[np.floating] | None,
    boundary: Boundary,
    poisson: draws.PoissonMethod,
    reach: Literal["source", "frame"],
    order: Order,
    key: tuple[KeyPart, ...],
) -> Corrupted:
    """Corrupt a checked frame in linear light; the arguments are those of `pipeline.camera.corruption.corrupt`.

    Args:
        scene: (H, W) float32 encoded grey levels in [0, 1].
        name: of the effects, recorded.
        effects: what is on.
        sigma_dn: target after the tone curve, before white clips, DN.
        generator: where everything comes from.
        sensor: the sensor; its converter has 12 bits here, in linear light 8 would show.
        psf: kernel of the optics, or None.
        boundary: of that blur.
        poisson: see `draws.poisson`.
        reach: with the paper's order, whether the target is that of the noise as it enters the optics or the frame.
        order: see `chain.develop`.
        key: recorded.

    Returns:
        the frame and its truth.

    Raises:
        InputError: the effects give no noise on this frame, or none so strong.
    """
    signal_e = sensor.electrons(decode(scene))
    light_e = signal_e if psf is None else through_optics(signal_e, psf, boundary)
    drawn, scale = chain.Drawn({}, float("nan"), float("nan")), 0.0
    arrived: dict[str, Float] = {}
    if sigma_dn > 0.0:
        drawn = chain.draw(chain.arriving(signal_e, psf, boundary, order), effects, sensor, generator, poisson=poisson)
        arrived = dict(drawn.noise_e)
        blurred = psf is not None and order == "paper" and "photon" in arrived
        if psf is not None and blurred:
            arrived["photon"] = through_optics(arrived["photon"], psf, boundary)
        if blurred and reach == "source":
            scale = _scale(signal_e, list(drawn.noise_e.values()), sigma_dn, sensor)
        else:
            scale = _scale(light_e, list(arrived.values()), sigma_dn, sensor)
        for noise in drawn.noise_e.values():
            noise *= np.float32(scale)
        if blurred:  # a map of its own; the others are those of `drawn`
            arrived["photon"] *= np.float32(scale)
    if "photon" in arrived:
        light_e = light_e + arrived["photon"]
    dark_e, read_e, quantise = arrived.get("dark"), arrived.get("readout"), effects.quantise
    image, clipped = chain.record(light_e, dark_e, read_e, sensor, quantise=quantise, convert=_to_encoded_8bit)
    return Corrupted(
        image=image if quantise else np.asarray(encode(image), dtype=np.float32),
        noise_source=name,
        target_sigma_dn=float(sigma_dn),
        noise_scale=scale,
        sensor=sensor,
        temperature_k=drawn.temperature_k,
        exposure_s=drawn.exposure_s,
        signal_e=signal_e,
        noise_e=drawn.noise_e,
        psf=psf,
        boundary=boundary,
        clipped_fraction=clipped,
        poisson=poisson,
        order=order,
        light="linear",
        key=key,
    )


def _to_encoded_8bit(electrons: Float, sensor: Sensor, out: Float) -> None:
    """Converter of 12 bits, tone curve, 8 bits: the image of electrons (B,), in [0, 1] on the 8-bit grid."""
    steps = np.float32(2**ADC_BITS - 1)
    linear = np.clip(np.rint(electrons * (steps / np.float32(sensor.electrons_at_full_scale))) / steps, 0.0, 1.0)
    full = np.float32(FULL_SCALE_DN)
    np.divide(np.rint(encode(linear.astype(np.float32)) * full), full, out=out)


def _stride(size: int, width: int) -> int:
    """Every how many pixels one is taken, about `GRID_PIXELS` of them, so that they lie in `LEAST_COLUMNS` or more.

    Every n-th pixel of rows of w lies in w / gcd(n, w) columns: of a picture of 4000 x 3000 px every 200th in 20, which
    may all miss or all hit posts of a fence.
    """
    step = max(1, size // GRID_PIXELS)
    while width // math.gcd(step, width) < min(LEAST_COLUMNS, width):
        step += 1
    return step


def _scale(light_e: Float, noises: list[Float], sigma_dn: float, sensor: Sensor) -> float:
    """Factor on the noise whose deviation after the tone curve is ``sigma_dn``."""
    step = _stride(light_e.size, light_e.shape[1])
    light = light_e.reshape(-1)[::step].astype(np.float64)
    noise = np.sum([each.reshape(-1)[::step] for each in noises], axis=0, dtype=np.float64) if noises else 0.0 * light
    full = sensor.electrons_at_full_scale
    clean = encode(light / full)

    def deviation(factor: float) -> float:
        return float(np.std(encode((light + factor * noise) / full) - clean)) * FULL_SCALE_DN

    if not deviation(1.0) > 0.0:
        raise InputError(
            f"no factor reaches {sigma_dn:g} DN: the effects give no noise on this frame; leave black frames out or "
            "add another source"
        )
    low, high = 0.0, 1.0
    while deviation(high) < sigma_dn:
        low, high = high, 2.0 * high
        if high > 1e9:
            raise InputError(f"no factor on the noise reaches {sigma_dn:g} DN in linear light; ask for a lower level")
    return bisected(lambda factor: deviation(factor) >= sigma_dn, low, high, _HALVINGS)
