"""Dark-current shot noise: electrons freed by heat, counted together with those freed by light.

``e' = e + Poisson(D) [- D]`` with the mean dark signal ``D(T, t)`` of `Sensor.dark_electrons`, the same for every
pixel (no fixed pattern). Subtracting the mean, as cameras do with a dark frame, leaves zero-mean dark-current shot
noise (DCSN) of variance D: the paper's setting (Wischow et al. 2023, Sec. III).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import draws
from pipeline.camera.sensor import Sensor


def dark_noise(
    shape: tuple[int, ...],
    sensor: Sensor,
    temperature_k: float,
    exposure_s: float,
    generator: np.random.Generator,
    *,
    zero_mean: bool = True,
) -> NDArray[np.float32]:
    """Dark electrons of every pixel.

    Args:
        shape: of the frame.
        sensor: its dark-current figure and pixel size count.
        temperature_k: sensor temperature.
        exposure_s: exposure time.
        generator: where the draws come from.
        zero_mean: subtract the mean dark signal.

    Returns:
        float32 e-, of that shape; negative where the mean is subtracted and fewer came.

    Raises:
        InputError: temperature or time out of range, or a dark signal beyond 2^20 e-.
    """
    mean_e = sensor.dark_electrons(temperature_k, exposure_s)
    noise = draws.poisson_even(mean_e, shape, generator)
    if zero_mean:
        noise -= np.float32(mean_e)
    return noise
