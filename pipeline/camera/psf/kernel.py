"""A point-spread function as an array: unit sum, odd size, centred; and the record that names one."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pipeline.errors import InputError


@dataclass(frozen=True)
class Kernel:
    """One named point-spread function (PSF).

    Attributes:
        name: unique within a bank and fit for a file name, e.g. ``"linear_motion_7_45"``.
        kind: ``"defocus"``, ``"linear_motion"``, ``"nonlinear_motion"`` ...
        size_px: nominal size, pixels: disc diameter or bounding box of the motion at 0 degrees.
        angle_deg: counter-clockwise rotation as seen in the image, degrees; 0 for round kinds.
        psf: (h, w) float32, non-negative, sum 1, odd h and w.
    """

    name: str
    kind: str
    size_px: float
    angle_deg: float
    psf: np.ndarray = field(repr=False, compare=False)


def kernel_name(kind: str, size_px: float, angle_deg: float | None = None) -> str:
    """``"defocus_7"`` or ``"linear_motion_7_45"``; numbers without trailing zeros."""
    parts = [kind, f"{size_px:g}", *([] if angle_deg is None else [f"{angle_deg:g}"])]
    return "_".join(parts)


def checked_size(size_px: float, kind: str) -> float:
    """A size as a float.

    Raises:
        InputError: not a finite number of at least 0.
    """
    if not (np.isfinite(size_px) and size_px >= 0):
        raise InputError(f"size_px of '{kind}' is {size_px!r}; expected a finite number of pixels, 0 (sharp) or more")
    return float(size_px)


def checked_psf(psf: np.ndarray, name: str = "psf") -> np.ndarray:
    """A PSF as a float64 array whose sum is 1 to 1e-3 and whose sides are odd.

    Args:
        psf: (h, w) numbers.
        name: what to call it in an error.

    Raises:
        InputError: wrong shape, an even side, a value that is not finite, or a sum that is not 1.
    """
    array = np.asarray(psf, dtype=np.float64)
    if array.ndim != 2 or 0 in array.shape:
        raise InputError(f"{name} has shape {array.shape}; expected a matrix (height, width)")
    if array.shape[0] % 2 == 0 or array.shape[1] % 2 == 0:
        raise InputError(
            f"{name} is {array.shape[0]} x {array.shape[1]}; expected odd sides, so that it has a centre pixel"
        )
    total = array.sum()
    if not np.isfinite(total) or abs(total - 1.0) > 1e-3:
        raise InputError(f"{name} sums to {total:g}; expected 1: divide it by its sum")
    return array


def finished(weights: np.ndarray) -> np.ndarray:
    """Weights as a PSF: unit sum, float32, the smallest square array about the same centre.

    Args:
        weights: (n, n) non-negative, odd n, centred on the middle pixel.

    Returns:
        (m, m) float32, odd m <= n, sum 1.
    """
    weights = np.asarray(weights, dtype=np.float64)
    weights = np.where(weights < 1e-9 * weights.max(), 0.0, weights)
    return squared(trimmed((weights / weights.sum()).astype(np.float32)))


def trimmed(psf: np.ndarray) -> np.ndarray:
    """The same PSF without rows and columns that are zero on both sides of the centre (its centre stays)."""
    rows, columns = (np.flatnonzero(psf.any(axis=axis)) for axis in (1, 0))
    keep = []
    for used, length in ((rows, psf.shape[0]), (columns, psf.shape[1])):
        middle = length // 2
        half = int(max(middle - used[0], used[-1] - middle)) if used.size else 0
        keep.append(slice(middle - half, middle + half + 1))
    return np.ascontiguousarray(psf[keep[0], keep[1]])


def squared(psf: np.ndarray) -> np.ndarray:
    """The same PSF in a square array, zeros added evenly round the shorter axis."""
    side = max(psf.shape)
    rows, columns = ((side - length) // 2 for length in psf.shape)
    return np.pad(psf, ((rows, rows), (columns, columns)))


def centroid_px(psf: np.ndarray) -> tuple[float, float]:
    """Centre of mass relative to the middle of the array: (x right, y down), pixels."""
    weights = np.asarray(psf, dtype=np.float64)
    weights = weights / weights.sum()
    x = np.arange(weights.shape[1]) - (weights.shape[1] - 1) / 2
    y = np.arange(weights.shape[0]) - (weights.shape[0] - 1) / 2
    return float(weights.sum(axis=0) @ x), float(weights.sum(axis=1) @ y)


def recentred(psf: np.ndarray) -> np.ndarray:
    """The same PSF moved by whole pixels so that its centroid is within half a pixel of the middle.

    Whole pixels leave the MTF untouched, which a sub-pixel shift would not.
    """
    shift_x, shift_y = (round(shift) for shift in centroid_px(psf))
    # Zeros are added on the side that the centroid leans to, which moves the middle there.
    rows = (max(-2 * shift_y, 0), max(2 * shift_y, 0))
    columns = (max(-2 * shift_x, 0), max(2 * shift_x, 0))
    return np.pad(psf, (rows, columns))
