"""Radiance of the sky: brighter towards the horizon and the sun, with clouds on a flat layer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.scenes.field import field
from pipeline.scenes.light import Light
from pipeline.scenes.vectors import dot

Array = NDArray[np.float32]

_CLOUD_SCALE = 0.28
_DETAIL_SCALE = 2.3


def sky_radiance(direction: Array, light: Light, angle_rad: float = 0.0015) -> Array:
    """Radiance arriving along directions from the sky.

    ``L = (2.0 - 1.15 z^0.45) (1 - 0.8 c) + 0.8 c (1.75 + 0.75 d)`` with z the sine of the elevation, c the cover
    (a logistic of 1/f noise looked up where the ray meets a layer of clouds, u = xy / (z + 0.25)) and d its
    detail; around the sun two lobes are added.

    Args:
        direction: (K, 3) unit vectors; those below the horizon get the horizon's radiance.
        light: sun and clouds.
        angle_rad: angle between samples, to smooth what is finer.

    Returns:
        (K,) radiance in the scene's unit.
    """
    z = np.clip(direction[:, 2], 0.0, 1.0)
    reach = 1.0 / (z + np.float32(0.25))
    layer = direction[:, :2] * (reach * np.float32(_CLOUD_SCALE))[:, None]
    layer += np.asarray(light.clouds, np.float32)
    # near the horizon a sample covers more of the layer
    footprint = reach * reach * np.float32(angle_rad * _CLOUD_SCALE)
    broad = field(layer, footprint, 1.0, name="cloud", level=0)
    fine = field(layer, footprint, 1.0 / _DETAIL_SCALE, 0.3, name="cloud", level=0)
    cover = 1.0 / (1.0 + np.exp(-2.2 * (broad - np.float32(2.0 * (0.5 - light.cover) + 0.1))))
    detail = 0.55 + 0.12 * fine
    clear = 2.0 - 1.15 * z**0.45
    radiance = clear * (1.0 - 0.8 * cover) + 0.8 * cover * (1.75 + 0.75 * detail)
    towards = np.clip(dot(direction, light.towards_sun), 0.0, 1.0)
    return ((radiance + 0.35 * towards**8 + 1.5 * towards**90) * light.sky).astype(np.float32)
