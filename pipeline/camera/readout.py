"""Readout noise: what the electronics add between charge and number.

Two sources (Wischow et al. 2023, Sec. III): reset (kTC) noise, thermal noise of resetting the sense node, and
source-follower noise, white and flicker noise of its amplifier after double sampling. Both are normal with zero
mean and independent of the signal and of each other, so their sum is drawn at once:
``e' = e + N(0, sigma_reset(T)^2 + sigma_sf^2)``. They are voltages, referred to electrons; hence not whole numbers.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import draws
from pipeline.camera.sensor import Sensor


def read_noise(
    shape: tuple[int, ...],
    sensor: Sensor,
    temperature_k: float,
    generator: np.random.Generator,
    *,
    reset: bool = True,
    source_follower: bool = True,
) -> NDArray[np.float32]:
    """Readout noise of every pixel.

    Args:
        shape: of the frame.
        sensor: see `Sensor.readout_sigma_e`.
        temperature_k: sensor temperature; reset noise grows with its square root.
        generator: where the draws come from.
        reset: with reset noise.
        source_follower: with source-follower noise.

    Returns:
        float32 e-, of that shape.

    Raises:
        InputError: temperature out of range.
    """
    sigma_e = sensor.readout_sigma_e(temperature_k, reset=reset, source_follower=source_follower)
    return draws.normals(shape, generator, sigma_e)
