"""Margin of settings against a fall of light: the average precision they would still give before new ones take effect.

Near the best settings average precision is flat: short exposures at high gain promise about as much as longer ones at
low gain. When the light falls by a factor of eight (a tunnel), the first frames are taken with the old settings; the
noise of high gain then hides everything, that of low gain little. The noise is that which `prediction.noise_elsewhere`
gives at an eighth of the level, the motion stays.

A level below the darkest measured counts as that, a condition beyond the measured region as an average precision of 0.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.exposure import Camera
from pipeline.control.performance import Performance
from pipeline.control.precision.prediction import Predicted, noise_elsewhere
from pipeline.control.state import CameraState

FALL = 8.0
"""Factor by which the light falls."""


def after_fall(
    performance: Performance, camera: Camera, at: Predicted, states: list[CameraState]
) -> NDArray[np.float64]:
    """Average precision at given settings once the light has fallen.

    Args:
        performance: surface asked.
        camera: sensor and tone curve.
        at: predicted condition of the N settings in the present light.
        states: the settings.

    Returns:
        (N,) percent, 0 beyond the measured region.
    """
    times = np.array([each.exposure_s for each in states])
    gains = np.array([each.gain for each in states])
    linear = at.level**camera.gamma
    sigma_dn = noise_elsewhere(camera, at.sigma_dn, (linear, gains, times), (linear / FALL, gains, times))
    level = np.maximum((linear / FALL) ** (1.0 / camera.gamma), performance.darkest_level)
    return np.nan_to_num(performance.ap_percent(sigma_dn, at.motion_px, level))
