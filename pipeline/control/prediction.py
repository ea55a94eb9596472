"""Noise and motion blur at other settings, predicted from the estimates at the present ones.

Blur: ``L' = L t' / t``. Noise: the estimate times the ratio of the noise budgets (`pipeline.camera.exposure.Camera`),
at the brightness the frame has and would have::

    sigma' = sigma * [s(e', g') slope(level')] / [s(e, g) slope(level)],     e' = e t' / t,  level ~ t g

With ``noise_gain: linear`` and kept brightness that is the paper's ``sigma' = alpha sigma``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.camera.exposure import Camera
from pipeline.camera.tone_curve import slope
from pipeline.control.state import CameraState

Floats = NDArray[np.float64]
_DARKEST_LEVEL, _DARKEST_MEAN = 0.002, 1e-3


class Predicted(NamedTuple):
    """(N,) noise in DN, motion blur in pixels and mean encoded level at candidate settings."""

    sigma_dn: Floats
    motion_px: Floats
    level: Floats


def linear_level(mean_level: float, camera: Camera) -> float:
    """Mean level of a frame in linear light, from its mean encoded grey level; a black frame counts as nearly black.

    Args:
        mean_level: 0..1, encoded.
        camera: with the tone curve.
    """
    return float(max(mean_level, _DARKEST_MEAN) ** camera.gamma)


def model_sigma_dn(camera: Camera, linear_level: ArrayLike, gain: ArrayLike, exposure_s: ArrayLike) -> Floats:
    """Noise after the tone curve that the sensor's parameters imply for pixels of one level.

    Args:
        camera: sensor and tone curve.
        linear_level: (N,) mean level in linear light, 0..1.
        gain: (N,) camera gain.
        exposure_s: (N,) exposure time.
    """
    level, gains = np.asarray(linear_level, dtype=float), np.asarray(gain, dtype=float)
    budget = camera.budget(level * camera.sensor.full_well_e / gains, gains, np.asarray(exposure_s, dtype=float))
    return np.asarray(budget.total * slope(np.maximum(level, _DARKEST_LEVEL), camera.gamma))


def predict(
    camera: Camera,
    sigma_dn: float,
    motion_px: float,
    mean_level: float,
    state: CameraState,
    candidates: list[CameraState],
) -> Predicted:
    """Noise and blur at candidate settings.

    Args:
        camera: sensor and tone curve.
        sigma_dn: estimated at ``state``.
        motion_px: estimated at ``state``.
        mean_level: mean level of the frame in linear light.
        state: settings of the frame.
        candidates: N settings.
    """
    level = max(min(mean_level, 1.0), _DARKEST_LEVEL)
    times = np.array([each.exposure_s for each in candidates])
    gains = np.array([each.gain for each in candidates])
    levels = np.minimum(level * times * gains / state.total_exposure_s, 1.0)
    here = model_sigma_dn(camera, level, state.gain, state.exposure_s)
    there = model_sigma_dn(camera, levels, gains, times)
    encoded = levels ** (1.0 / camera.gamma)
    return Predicted(sigma_dn * there / float(here), motion_px * times / state.exposure_s, encoded)
