"""The modulation transfer function (MTF): which share of a grating's contrast a blur leaves.

    MTF(f) = |sum over pixels of h(x, y) exp(-2 pi j (fx x + fy y))|,   h of unit sum, so MTF(0) = 1.

Frequencies are fractions of Nyquist (1 = half a cycle per pixel), which the paper calls lines per pixel. The
horizontal curve takes fy = 0 (gratings with vertical bars), the vertical one fx = 0. The paper reads eight bins
of a 111-point transform; the sums here are the same numbers for any size of kernel.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.errors import InputError

TRANSFORM_POINTS = 111
BINS = np.array([3, 6, 8, 11, 16, 22, 27, 33])
FREQUENCIES = BINS * 2 / TRANSFORM_POINTS
"""The paper's eight frequencies (0.05 ... 0.6 in its figures), fractions of Nyquist."""
DIRECTIONS = ("horizontal", "vertical")
SYSTEM, CAMERA, GENERIC_LENS = "system", "camera", "generic lens"
"""What an MTF is relative to: nothing (lens, sensor and blur together), a camera's sharp frames, or a generic lens."""


def sample(psf: Any) -> np.ndarray:
    """The MTF at the paper's eight frequencies.

    Args:
        psf: (h, w) or (..., h, w) numbers of any size; scaled to unit sum here.

    Returns:
        (..., 2, 8) float64 in [0, 1] for non-negative kernels; rows horizontal, vertical.

    Raises:
        InputError: not a matrix, a value that is not finite, or a sum that is not positive.
    """
    return curve(psf, FREQUENCIES)


def curve(psf: Any, frequencies: Any) -> np.ndarray:
    """The MTF at any frequencies.

    Args:
        psf: (h, w) or (..., h, w) numbers of any size; scaled to unit sum here.
        frequencies: (n,) fractions of Nyquist, >= 0.

    Returns:
        (..., 2, n) float64; rows horizontal, vertical.

    Raises:
        InputError: see `sample`.
    """
    weights = np.asarray(psf, dtype=np.float64)
    if weights.ndim < 2 or 0 in weights.shape:
        raise InputError(f"psf has shape {weights.shape}; expected (height, width), or several stacked")
    total = weights.sum(axis=(-2, -1))
    if not np.all(np.isfinite(total)) or not np.all(total > 0):
        raise InputError("a psf has no finite positive sum, so it has no MTF; leave out kernels that abstained")
    cycles_per_px = np.atleast_1d(np.asarray(frequencies, dtype=np.float64)) / 2
    rows = []
    for axis in (-2, -1):
        profile = weights.sum(axis=axis) / total[..., None]
        waves = np.exp(-2j * np.pi * np.outer(np.arange(profile.shape[-1]), cycles_per_px))
        rows.append(np.abs(profile @ waves))
    return np.stack(rows, axis=-2)


def mtf50(psf: Any) -> np.ndarray:
    """The lowest frequency at which the MTF falls to a half.

    Args:
        psf: (h, w) numbers.

    Returns:
        (2,) fractions of Nyquist, horizontal and vertical; infinite where the curve stays above up to Nyquist.

    Raises:
        InputError: several kernels at once, or see `sample`.
    """
    from scipy.optimize import brentq

    weights = np.asarray(psf, dtype=np.float64)
    if weights.ndim != 2:
        raise InputError(f"psf has shape {weights.shape}; expected one kernel (height, width)")
    # A kernel of n pixels has features no finer than 2 / n Nyquist: sixteen points on each.
    grid = np.linspace(0.0, 1.0, 8 * max(weights.shape) + 65)
    result = np.full(2, np.inf)
    for direction, values in enumerate(curve(weights, grid)):
        below = np.flatnonzero(values <= 0.5)
        if below.size:
            bracket = grid[below[0] - 1], grid[below[0]]
            result[direction] = brentq(lambda f, row=direction: curve(weights, f)[row, 0] - 0.5, *bracket, xtol=1e-10)
    return result


def gaussian(sigma_px: float, frequencies: Any) -> np.ndarray:
    """MTF of a continuous Gaussian, exp(-2 pi^2 sigma^2 f^2): (n,) for (n,) fractions of Nyquist; sigma in pixels."""
    cycles_per_px = np.asarray(frequencies, dtype=np.float64) / 2
    return np.exp(-2 * (np.pi * sigma_px * cycles_per_px) ** 2)


def disc(diameter_px: float, frequencies: Any) -> np.ndarray:
    """MTF of a continuous disc, |2 J1(x) / x| with x = pi d f: (n,) for (n,) fractions of Nyquist; d in pixels."""
    from scipy.special import j1

    x = np.pi * diameter_px * np.asarray(frequencies, dtype=np.float64) / 2
    return np.abs(np.where(x == 0, 1.0, 2 * j1(x) / np.where(x == 0, 1.0, x)))


def line(length_px: float, frequencies: Any) -> np.ndarray:
    """MTF of continuous straight motion along itself, |sinc(L f)|: (n,) for (n,) fractions of Nyquist; L in pixels."""
    return np.abs(np.sinc(length_px * np.asarray(frequencies, dtype=np.float64) / 2))


def amae(estimate: Any, truth: Any, *, skip_missing: bool = False) -> np.ndarray:
    """The paper's AMAE: mean absolute error of an MTF over its frequencies, averaged over H and V, in percent.

    Args:
        estimate: (..., 2, 8) MTF.
        truth: (..., 2, 8) MTF; broadcast against `estimate`.
        skip_missing: average over the frequencies that have an estimate instead of answering NaN; a curve with none
            is NaN either way.

    Returns:
        (...) percent (100 times contrast); a scalar array for a single pair.

    Raises:
        InputError: the shapes do not fit.
    """
    estimate, truth = np.asarray(estimate, dtype=np.float64), np.asarray(truth, dtype=np.float64)
    try:
        error = np.abs(estimate - truth)
    except ValueError as problem:
        raise InputError(f"MTFs of shapes {estimate.shape} and {truth.shape} do not fit each other") from problem
    if error.ndim < 2 or error.shape[-2] != 2:
        raise InputError(f"MTFs have shape {error.shape}; expected (..., 2, frequencies): horizontal and vertical")
    if not skip_missing:
        return 100 * error.mean(axis=(-2, -1))
    present = np.isfinite(error)
    # H and V weigh the same however many of their frequencies are missing.
    count = present.sum(axis=-1)
    rows = np.where(present, error, 0.0).sum(axis=-1) / np.where(count == 0, 1, count)
    rows = np.where(count == 0, np.nan, rows)
    used = np.isfinite(rows).sum(axis=-1)
    total = np.where(np.isfinite(rows), rows, 0.0).sum(axis=-1)
    return np.where(used == 0, np.nan, 100 * total / np.where(used == 0, 1, used))
