"""From the camera's settings to its condition: the two constants that carry the paper's curves to a camera.

    sigma = lambda1 * ISO,      length of the motion blur = lambda2 * exposure time

lambda1 holds at a fixed brightness of the picture and takes gain to amplify all noise alike (the paper's worst case);
lambda2 is the speed of the object in the picture. The paper's regression takes ISO 100 as sigma 1 DN, and 1 ms as a
motion of one pixel, which leaves the MTF at 1. The MTF that belongs to a length is the mean over horizontal, vertical
and four rotations of straight motion, at the second of the paper's frequencies (0.108 of Nyquist, printed as 0.1).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.errors import InputError

ANGLES_DEG = (0.0, 45.0, 90.0, 135.0)
LONGEST_PX = 55.0
_STEP_PX = 0.25


@dataclass(frozen=True)
class Calibration:
    """A camera looking at an object.

    Attributes:
        lambda1: noise per gain, DN per unit of ISO.
        lambda2: motion per exposure, pixels per millisecond.
        std_dev1, std_dev2: of the two; NaN where they are not estimated.
    """

    lambda1: float
    lambda2: float
    std_dev1: float = math.nan
    std_dev2: float = math.nan

    def __post_init__(self) -> None:
        for name, value in (("lambda1", self.lambda1), ("lambda2", self.lambda2)):
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"{name}: expected a positive number, not {value!r}")

    def sigma_dn(self, iso: ArrayLike) -> NDArray[np.float64]:
        """Noise at an ISO setting."""
        return self.lambda1 * np.asarray(iso, dtype=float)

    def iso(self, sigma_dn: ArrayLike) -> NDArray[np.float64]:
        """ISO setting that gives a noise."""
        return np.asarray(sigma_dn, dtype=float) / self.lambda1

    def size_px(self, exposure_ms: ArrayLike) -> NDArray[np.float64]:
        """Length of the motion blur at an exposure time."""
        return self.lambda2 * np.asarray(exposure_ms, dtype=float)

    def exposure_ms(self, size_px: ArrayLike) -> NDArray[np.float64]:
        """Exposure time that gives a length of motion blur."""
        return np.asarray(size_px, dtype=float) / self.lambda2

    def mtf(self, exposure_ms: float) -> float:
        """MTF at an exposure time."""
        return motion_mtf(float(self.size_px(exposure_ms)))


PAPER = Calibration(lambda1=0.01, lambda2=1.0)
"""The axes of the paper's fitted grids."""


def calibrate(iso: ArrayLike, sigma_dn: ArrayLike, exposure_ms: ArrayLike, size_px: ArrayLike) -> Calibration:
    """Measure both constants: least squares through the origin, lambda = sum(x y) / sum(x x).

    Args:
        iso: (n,) positive settings.
        sigma_dn: (n,) noise measured at these.
        exposure_ms: (m,) positive settings.
        size_px: (m,) lengths of motion blur measured at these (`size_for_mtf_px` gives them from an MTF).

    Raises:
        InputError: fewer than two measurements of either, numbers that are not finite or positive, or measurements
            that do not grow with the setting.
    """
    lambda1, std_dev1 = _slope("iso", iso, "sigma_dn", sigma_dn)
    lambda2, std_dev2 = _slope("exposure_ms", exposure_ms, "size_px", size_px)
    return Calibration(lambda1, lambda2, std_dev1, std_dev2)


def motion_mtf(size_px: float) -> float:
    """Mean MTF of straight motion over H, V and four rotations, at the paper's second frequency."""
    from pipeline.camera import mtf, psf

    at = mtf.FREQUENCIES[1:2]
    return float(np.mean([mtf.curve(psf.create("linear_motion", size_px, angle), at) for angle in ANGLES_DEG]))


def size_for_mtf_px(mtf: float) -> float:
    """Length of straight motion with this `motion_mtf`, on its first, falling part.

    Raises:
        InputError: not in (0, 1], or below where the MTF stops falling with length.
    """
    from scipy.optimize import brentq

    if not 0.0 < mtf <= 1.0:
        raise InputError(f"mtf: expected a number in (0, 1], not {mtf!r}")
    if mtf == 1.0:
        return 1.0
    size, here = 1.0, 1.0
    while size < LONGEST_PX:
        further = motion_mtf(size + _STEP_PX)
        if further <= mtf:
            return float(brentq(lambda length: motion_mtf(length) - mtf, size, size + _STEP_PX, xtol=1e-6))
        if further > here:
            break
        size, here = size + _STEP_PX, further
    raise InputError(f"mtf: {mtf:g} is less than straight motion leaves ({here:.2f} at {size:g} px); no length fits")


def _slope(x_name: str, x: ArrayLike, y_name: str, y: ArrayLike) -> tuple[float, float]:
    setting, measured = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    if setting.ndim != 1 or setting.shape != measured.shape or len(setting) < 2:
        raise InputError(f"{x_name}, {y_name}: expected two lists of one length, at least 2 measurements")
    if not (np.isfinite(setting) & np.isfinite(measured) & (setting > 0)).all():
        raise InputError(f"{x_name}, {y_name}: expected finite numbers, and positive settings")
    energy = float(setting @ setting)
    slope = float(setting @ measured) / energy
    if slope <= 0:
        raise InputError(f"{y_name} does not grow with {x_name}; are the lists in the same order?")
    residual = measured - slope * setting
    return slope, math.sqrt(float(residual @ residual) / (len(setting) - 1) / energy)
