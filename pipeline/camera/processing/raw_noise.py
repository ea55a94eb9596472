"""Noise of the raw mosaic: shot noise that grows with the light, read noise that does not, and row noise.

    var(x) = k (x + x0),    k = gain / full well,    k x0 = (read noise / full well)^2 gain-referred

x is the pixel's value as a fraction of white. Shot noise and read noise are drawn in the normal approximation, which
holds for the hundreds of electrons that these pictures stand for. Source: Foi et al. 2008, "Practical
Poissonian-Gaussian noise modeling and fitting for single-image raw-data"; EMVA 1288.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError, finite_at_least_0

Float = NDArray[np.float32]


@dataclass(frozen=True)
class RawNoise:
    """Noise of a sensor at one setting of its gain.

    Attributes:
        shot: k, variance per unit of signal, both as fractions of white; 0 is a noise-free sensor.
        read: x0, the signal whose shot noise equals the read noise, fraction of white.
        row: standard deviation of row noise, as a fraction of the read noise.
    """

    shot: float = 0.0
    read: float = 0.0
    row: float = 0.0

    def __post_init__(self) -> None:
        for name in ("shot", "read", "row"):
            finite_at_least_0(f"raw noise: {name}", getattr(self, name))

    @classmethod
    def at_iso(
        cls, iso: float, *, full_well_e: float, read_e: float, base_iso: float = 100.0, row: float = 0.0
    ) -> RawNoise:
        """Noise of a sensor at an ISO setting.

        At gain g = iso / base_iso white is reached at full_well / g electrons, so k = g / full_well and
        k x0 = (read g / full_well)^2.

        Args:
            iso: setting, at least `base_iso`.
            full_well_e: electrons at white at base ISO.
            read_e: read noise, electrons rms.
            base_iso: setting of unit gain.
            row: see the class.

        Raises:
            InputError: a setting below base ISO or constants that are not positive.
        """
        if not (base_iso > 0 and iso >= base_iso and full_well_e > 0 and read_e >= 0):
            raise InputError(
                f"raw noise: iso={iso}, base_iso={base_iso}, full_well_e={full_well_e}, read_e={read_e}; expected "
                "iso >= base_iso > 0, full_well_e > 0 and read_e >= 0"
            )
        shot = iso / base_iso / full_well_e
        return cls(shot, shot * read_e**2, row)

    def sigma(self, signal: Float) -> Float:
        """Standard deviation at a signal in [0, 1], row noise left out, as a fraction of white."""
        return np.sqrt(np.float32(self.shot) * (np.maximum(signal, 0) + np.float32(self.read)))

    def add(self, raw: Float, generator: np.random.Generator) -> Float:
        """A raw mosaic with noise.

        Args:
            raw: (H, W) noise-free values, fraction of white.
            generator: source of randomness.

        Returns:
            (H, W) float32, not clipped: read noise reaches below zero, as behind a black-level offset.
        """
        noisy = raw + self.sigma(raw) * generator.standard_normal(raw.shape, dtype=np.float32)
        if self.row and self.shot:
            deviation = np.float32(self.row * np.sqrt(self.shot * self.read))
            noisy += deviation * generator.standard_normal((raw.shape[0], 1), dtype=np.float32)
        return np.asarray(noisy, dtype=np.float32)
