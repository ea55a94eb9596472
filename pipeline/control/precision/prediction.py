"""Noise and motion blur at other settings, predicted from the estimates at the present ones.

Blur: ``L' = L t' / t``. Noise: the estimate, taken back before the tone curve c, times the ratio of the noise budgets b
(`pipeline.camera.exposure.Camera.budget`) at the brightness the frame has and would have::

    sigma' = c(c^-1(sigma, level) b(level', g', t') / b(level, g, t), level'),     level' = level t' g' / (t g)

With ``noise_gain: linear``, kept brightness and noise so weak that the curve is straight within it that is the paper's
``sigma' = alpha sigma``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.camera.exposure import Camera
from pipeline.camera.tone_curve import noise_after_curve, noise_before_curve
from pipeline.control.state import CameraState

Floats = NDArray[np.float64]
_DARKEST_MEAN = 1e-3


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


def noise_elsewhere(
    camera: Camera, sigma_dn: ArrayLike, here: tuple[ArrayLike, ...], there: tuple[ArrayLike, ...]
) -> Floats:
    """Noise after the tone curve at other settings, DN.

    Args:
        camera: sensor and tone curve.
        sigma_dn: (...) noise here, DN.
        here: mean level in linear light, 0..1, camera gain and exposure time, s; (...) each.
        there: the same at the other settings.
    """
    before, after = (camera.linear_sigma_dn(*settings) for settings in (here, there))
    linear = noise_before_curve(np.asarray(here[0], float), np.asarray(sigma_dn, float) / FULL_SCALE_DN, camera.gamma)
    return FULL_SCALE_DN * noise_after_curve(np.asarray(there[0], float), linear * after / before, camera.gamma)


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
    level = min(max(mean_level, _DARKEST_MEAN**camera.gamma), 1.0)
    times = np.array([each.exposure_s for each in candidates])
    gains = np.array([each.gain for each in candidates])
    levels = np.minimum(level * times * gains / state.total_exposure_s, 1.0)
    sigma = noise_elsewhere(camera, sigma_dn, (level, state.gain, state.exposure_s), (levels, gains, times))
    encoded = levels ** (1.0 / camera.gamma)
    return Predicted(sigma, motion_px * times / state.exposure_s, encoded)
