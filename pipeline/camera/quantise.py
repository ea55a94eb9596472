"""From charge to numbers: the full well, whole electrons, the converter's gain, and eight bits.

Two steps, on either side of the readout: `collect` (charge: saturates at the full well, comes in whole electrons)
and `digitise` (voltage to number: gain, rounding, clipping). Wischow et al. 2023, Sec. III; the paper's program
truncates to 8 bit, here numbers are rounded (see `authors` for its behaviour).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.arrays import as_array, refuse_masked
from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.camera.sensor import Sensor
from pipeline.errors import InputError


def collect(
    electrons: NDArray[np.float32], sensor: Sensor, out: NDArray[np.float32] | None = None
) -> NDArray[np.float32]:
    """Charge held by the pixels: ``floor(clip(e, 0, N_fw))``.

    Counts of photons are whole. Where none were drawn a mean charge is rounded down as well, which darkens by half an
    electron on average: by 0.006 DN at gain 1 and 0.40 DN at gain 64 of the paper's sensor.

    Args:
        electrons: (..., H, W) e-, any real numbers.
        sensor: its full well counts.
        out: where to put the result; a new array if None.

    Returns:
        float32 whole electrons, same shape.
    """
    held = np.clip(electrons, np.float32(0.0), np.float32(sensor.full_well_e), out=out)
    return np.floor(held, out=held)


def digitise(
    electrons: NDArray[np.float32], sensor: Sensor, out: NDArray[np.float32] | None = None
) -> NDArray[np.float32]:
    """Numbers of the converter: ``clip(round(K e), 0, 255)``.

    Args:
        electrons: (..., H, W) e-, read noise included.
        sensor: its gain ``K`` counts.
        out: where to put the result; a new array if None.

    Returns:
        float32 whole DN, 0..255, same shape; halves round to even.
    """
    dn = np.multiply(electrons, np.float32(sensor.dn_per_electron), out=out)
    np.rint(dn, out=dn)
    return np.clip(dn, np.float32(0.0), np.float32(FULL_SCALE_DN), out=dn)


def full_range(dn: NDArray[np.float32], out: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
    """Whole DN as an image: ``dn / 255``, the nearest float32 to the exact quotient.

    Args:
        dn: (..., H, W) 0..255.
        out: where to put the result; a new array if None.

    Returns:
        float32 in [0, 1].
    """
    return np.divide(dn, np.float32(FULL_SCALE_DN), out=out)


def to_8bit(image: NDArray[np.floating]) -> NDArray[np.uint8]:
    """An image's 8-bit numbers, rounded.

    Args:
        image: (..., H, W) in [0, 1]; values outside are clipped.

    Returns:
        uint8, same shape.
    """
    return np.rint(np.clip(image * np.float32(FULL_SCALE_DN), 0.0, FULL_SCALE_DN)).astype(np.uint8)


def check_finite(image: NDArray[np.floating], name: str) -> None:
    """Refuse an image with a value that is not a finite number, which sums and transforms would spread.

    Args:
        image: any shape.
        name: what to call it in the error.

    Raises:
        InputError: NaN or infinite values; states how many.
    """
    bad = image.size - int(np.count_nonzero(np.isfinite(image)))
    if bad:
        raise InputError(f"{name}: {bad} of {image.size} values are not finite; expected numbers in [0, 1]")


def as_image(image: ArrayLike) -> NDArray[np.float32]:
    """An image as (H, W) float32 in [0, 1]; uint8 is divided by 255, float32 is passed on unchanged.

    Args:
        image: (H, W) uint8, or float in [0, 1], NumPy or torch.

    Raises:
        InputError: another shape or type, masked pixels, a value outside [0, 1] or not a number.
    """
    array = as_array(image)
    refuse_masked(array, "image")
    given = np.asarray(array)
    if given.ndim != 2 or given.size == 0:
        raise InputError(f"an image is (height, width) grey levels, got shape {given.shape}; convert colour first")
    if given.dtype == np.uint8:
        return full_range(given.astype(np.float32))
    if given.dtype.kind != "f":
        raise InputError(f"an image is uint8, or float in [0, 1], got {given.dtype}; divide by its full scale")
    scaled = given.astype(np.float32, copy=False)
    lowest, highest = float(scaled.min()), float(scaled.max())
    if not (lowest >= 0.0 and highest <= 1.0):
        raise InputError(f"a float image lies in [0, 1], got {lowest:g} .. {highest:g}; divide by its full scale")
    return scaled
