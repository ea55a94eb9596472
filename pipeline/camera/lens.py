"""The thin lens: how much an object out of focus is blurred.

Circle of confusion on the sensor (paper, Sec. III), all lengths in metres:

    c = A f / (S1 - f) * |S2 - S1| / S2

A aperture diameter, f focal length, S1 distance in focus, S2 distance of the object, both from the lens. Divided by
the pixel pitch it is the diameter in pixels of the disc in `pipeline.camera.psf.defocus`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.errors import InputError


@dataclass(frozen=True)
class Lens:
    """A thin lens in front of a sensor.

    Attributes:
        focal_length_m: f, metres, > 0.
        aperture_m: A, diameter of the entrance pupil, metres, > 0 (focal length over f-number).
        focus_m: S1, distance in focus, metres, > f; ``math.inf`` for the horizon.
        pixel_pitch_m: side of a pixel, metres, > 0.

    Raises:
        InputError: a length that is not positive, or focus not beyond the focal length.
    """

    focal_length_m: float
    aperture_m: float
    focus_m: float
    pixel_pitch_m: float

    def __post_init__(self) -> None:
        for name in ("focal_length_m", "aperture_m", "pixel_pitch_m"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"{name} is {value!r}; expected a positive length in metres")
        if not self.focus_m > self.focal_length_m:
            raise InputError(
                f"focus_m is {self.focus_m!r}; expected a distance beyond the focal length of {self.focal_length_m} m"
            )

    def blur_diameter_px(self, distance_m: Any) -> np.ndarray:
        """Diameter of the circle of confusion.

        Args:
            distance_m: (...) distance S2 of the object, metres, > 0; may be infinite.

        Returns:
            (...) pixels, >= 0; 0 in focus.

        Raises:
            InputError: a distance that is not positive.
        """
        distance_m = np.asarray(distance_m, dtype=np.float64)
        if not np.all(distance_m > 0):
            raise InputError("distance_m of an object is not positive; expected metres from the lens")
        # |S2 - S1| / S2 / (S1 - f) = |1 / S1 - 1 / S2| / (1 - f / S1): finite where a distance is infinite.
        defocus = np.abs(1 / self.focus_m - 1 / distance_m) / (1 - self.focal_length_m / self.focus_m)
        return self.aperture_m * self.focal_length_m * defocus / self.pixel_pitch_m
