"""Corruption by target: noise of a wanted sigma, blur of a wanted MTF50. The public entry to the camera model.

Noise is scaled as in the paper (Wischow et al. 2023, Sec. III): the frame's own noise map ``n`` is multiplied by
``g = sigma / std(n)``, the deviation taken over the whole frame. Here ``n`` is taken before the 8-bit range cuts it, so
that where nothing clips the level is met exactly, and where something does the truth holds by how much (`truth`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.camera import chain, draws
from pipeline.camera.blocks import blocks
from pipeline.camera.sensor import Sensor
from pipeline.camera.truth import LIGHTS, ORDERS, Boundary, Corrupted, Light, Order, through_optics
from pipeline.errors import InputError, did_you_mean
from pipeline.streams import KeyPart

Camera = Literal["physical", "authors", "authors_2022"]
Reach = Literal["source", "frame"]
CAMERAS = ("physical", "authors", "authors_2022")

_MTF50_TOLERANCE = 1e-3
_LEAST_STEP_PX = 1e-12


def noise_scale_to_reach(
    drawn: chain.Drawn,
    sigma_dn: float,
    sensor: Sensor,
    *,
    psf: NDArray[np.floating] | None = None,
    boundary: Boundary = "reflect",
) -> float:
    """Factor that brings noise to a target: ``g = sigma_dn / std(n)``, over the whole frame.

    Args:
        drawn: noise of natural size.
        sigma_dn: target, DN.
        sensor: for the conversion to DN.
        psf: with it, photon noise counts as it leaves the optics; without, as it enters them.
        boundary: of that blur.

    Raises:
        InputError: the effects give no noise on this frame (photon noise of a black one, for instance).
    """
    maps = dict(drawn.noise_e)
    if psf is not None and "photon" in maps:
        maps["photon"] = through_optics(maps["photon"], psf, boundary)
    natural_dn = _deviation(list(maps.values())) * sensor.dn_per_electron
    if not natural_dn > 0.0:
        raise InputError(
            f"no noise scale reaches {sigma_dn:g} DN: the effects {sorted(maps)} give no noise on this frame; "
            "leave black frames out or add another source"
        )
    return sigma_dn / natural_dn


def _deviation(maps: list[NDArray[np.float32]]) -> float:
    """Standard deviation of the sum of maps (H, W), in their unit.

    Sums of a block are in single precision, those of blocks in double. Their rounding errors are no noise: maps without
    a difference between pixels have a deviation of 0.
    """
    if all(part.min() == part.max() for part in maps):
        return 0.0
    total = squares = 0.0
    for parts in zip(*(blocks(each) for each in maps), strict=True):
        noise = parts[0].copy()
        for other in parts[1:]:
            noise += other
        total += float(noise.sum())
        squares += float(np.square(noise, out=noise).sum())
    count = maps[0].size
    return max(squares / count - (total / count) ** 2, 0.0) ** 0.5


def corrupt(
    image: ArrayLike,
    noise_source: str | Sequence[str],
    *,
    sigma_dn: float,
    generator: np.random.Generator,
    sensor: Sensor | None = None,
    psf: NDArray[np.floating] | None = None,
    camera: Camera = "physical",
    poisson: draws.PoissonMethod = "exact",
    reach: Reach = "source",
    boundary: Boundary = "reflect",
    temperature_k: float | None = None,
    exposure_s: float | None = None,
    order: Order = "paper",
    light: Light = "encoded",
    key: tuple[KeyPart, ...] = (),
) -> Corrupted:
    """Corrupt a frame with noise of a given sigma, and blur.

    Level 0 without a kernel returns the frame as it came, bit for bit. Two calls with equal streams draw the same
    noise, whatever the level: levels of one frame differ in size only.

    Args:
        image: (H, W) uint8, or float32 in [0, 1].
        noise_source: ``photon``, ``dcsn``, ``readout``, ``combined`` or ``sensor`` (all but photon), or several.
        sigma_dn: standard deviation of the noise over the frame before clipping, DN on the 0..255 scale; in linear
            light before white clips, for a tone curve ends at black.
        generator: where everything comes from (`pipeline.streams.stream`).
        sensor: the paper's if None.
        psf: (h, w) kernel of the optics, unit sum; in the paper's order photon noise passes it, the other sources
            come after.
        camera: ``physical``; ``authors`` follows the paper's published program with its quirks, ``authors_2022`` the
            same before December 2022 (see `authors`).
        poisson: ``exact`` or ``hybrid``; see `draws.poisson`.
        reach: with a kernel, whether sigma is that of the noise as it enters (``source``, the paper's: photon noise
            is scaled, then blurred) or as it arrives in the ``frame``.
        boundary: what the blur sees beyond the frame (physical camera; the authors' sees darkness).
        temperature_k: fixes the sensor temperature instead of the effect's own.
        exposure_s: fixes the exposure time, likewise.
        order: ``paper``: photon noise comes before the optics; ``detector``: after them, as in a camera.
        light: ``encoded``: noise and blur act on the grey levels, as in the paper; ``linear``: on the light behind
            them (`linear_light`).
        key: of the random stream, recorded in the result.

    Returns:
        the frame and its truth.

    Raises:
        InputError: wrong image, noise source, level, kernel, camera, order, light or conditions.
    """
    _refuse_wrong_options(sigma_dn, camera, reach, order, light)
    name, effects = conditioned(noise_source, temperature_k, exposure_s)
    used = sensor or Sensor()
    scene = chain.as_image(image)
    signal_e = used.electrons(scene)
    if sigma_dn == 0.0 and psf is None and used.over_exposure == 1.0:
        return chain.untouched(scene, signal_e, used, noise_source=name, key=key)
    if camera != "physical":
        from pipeline.camera import authors

        return authors.corrupt(
            signal_e, name, effects, sigma_dn, generator, used, psf=psf, program=authors.PROGRAMS[camera], key=key
        )
    if light == "linear":
        from pipeline.camera import linear_light

        return linear_light.corrupt(
            scene, name, effects, sigma_dn, generator, used,
            psf=psf, boundary=boundary, poisson=poisson, reach=reach, order=order, key=key,
        )  # fmt: skip
    if sigma_dn == 0.0:
        drawn, noise_scale = chain.Drawn({}, float("nan"), float("nan")), 0.0
    else:
        arriving = chain.arriving(signal_e, psf, boundary, order)
        drawn = chain.draw(arriving, effects, used, generator, poisson=poisson)
        blurred = psf if reach == "frame" and order == "paper" else None
        noise_scale = noise_scale_to_reach(drawn, sigma_dn, used, psf=blurred, boundary=boundary)
    return chain.develop(
        signal_e,
        drawn,
        used,
        noise_scale=noise_scale,
        psf=psf,
        boundary=boundary,
        noise_source=name,
        target_sigma_dn=float(sigma_dn),
        poisson=poisson,
        order=order,
        key=key,
    )


def _refuse_wrong_options(sigma_dn: float, camera: str, reach: str, order: str, light: str) -> None:
    """Raises InputError for options of `corrupt` that are unknown, out of range or do not go together."""
    if not 0.0 <= sigma_dn < float("inf"):
        raise InputError(f"sigma_dn is a level of at least 0 DN, got {sigma_dn!r}")
    if camera not in CAMERAS:
        raise InputError(f"camera '{camera}' is unknown; {did_you_mean(str(camera), CAMERAS)}")
    if reach not in ("source", "frame"):
        raise InputError(f"reach is 'source' or 'frame', got '{reach}'")
    for name, value, known in (("order", order, ORDERS), ("light", light, LIGHTS)):
        if value not in known:
            raise InputError(f"camera.{name} '{value}' is unknown; {did_you_mean(str(value), known)}")
    if camera != "physical" and (order, light) != ("paper", "encoded"):
        raise InputError(
            f"camera '{camera}' follows the authors' program: camera.order is 'paper' and camera.light 'encoded' there,"
            f" got '{order}' and '{light}'; use camera.kind physical for others"
        )


def conditioned(
    noise_source: str | Sequence[str], temperature_k: float | None = None, exposure_s: float | None = None
) -> tuple[str, chain.Effects]:
    """`chain.preset` with fixed conditions where given.

    Raises:
        InputError: unknown noise source.
    """
    from dataclasses import replace

    name, effects = chain.preset(noise_source)
    if temperature_k is not None:
        effects = replace(effects, temperature_k=(temperature_k, temperature_k))
    if exposure_s is not None:
        effects = replace(effects, exposure_s=(exposure_s, exposure_s))
    return name, effects


def psf_for_mtf50(
    kind: str,
    mtf50: float,
    *,
    angle_deg: float = 0.0,
    **options: Any,
) -> tuple[float, NDArray[np.floating]]:
    """The size at which a blur halves the contrast of a given frequency.

    Args:
        kind: ``defocus``, ``linear_motion`` or ``gaussian``: kinds whose MTF50 falls steadily with size.
        mtf50: frequency at which the MTF is to be 0.5, in the worse of the two directions, fraction of Nyquist.
        angle_deg: direction of motion.
        options: further options of `psf.create`.

    Returns:
        size in px and the kernel; the kernel's MTF50 is within 0.1 % of the target.

    Raises:
        InputError: unknown kind, or no size between 1 and 101 px gives that MTF50, with those that can be reached.
    """
    from pipeline.camera import mtf
    from pipeline.camera import psf as psfs

    kinds = ("defocus", "gaussian", "linear_motion")
    if kind not in kinds:
        raise InputError(f"blur '{kind}' cannot be found by its MTF50; {did_you_mean(kind, kinds)}")

    def blurred(size_px: float) -> tuple[NDArray[np.floating], float]:
        kernel = psfs.create(kind, size_px, angle_deg, **options)
        return kernel, float(np.min(mtf.mtf50(kernel)))

    smallest, largest = 1.0, 101.0
    lowest, highest = blurred(largest)[1], min(blurred(smallest)[1], 1.0)
    if not lowest < mtf50 < highest:
        raise InputError(
            f"no {kind} of {smallest:g} to {largest:g} px has its MTF50 at {mtf50!r} of Nyquist; "
            f"expected a number above {lowest:.4g} and below {highest:.4g}"
        )
    size_px, step_px = smallest, largest - smallest
    while step_px > _LEAST_STEP_PX:
        step_px /= 2
        kernel, value = blurred(size_px + step_px)
        # near Nyquist MTF50 changes ever faster with size: there steps become finer until the target is met
        if step_px < 1e-4 + 1e-6 * (size_px + step_px) and abs(value / mtf50 - 1) <= _MTF50_TOLERANCE:
            return size_px + step_px, kernel
        if value >= mtf50:
            size_px += step_px
    nearest = sorted(blurred(size)[1] for size in (size_px, size_px + step_px))
    reachable = " or ".join(f"{value:.4g}" for value in nearest if value <= 1.0)
    raise InputError(
        f"no {kind} has its MTF50 within 0.1 % of {mtf50!r} of Nyquist: it jumps at {size_px:.4g} px; "
        f"ask for {reachable}"
    )
