"""Light of a scene: sun, ambient directions, haze; all in one unit of radiance.

The unit: a perfectly white diffuse surface under irradiance 1 has radiance 1. A sun of strength 3.1 stands for
about 90 klx on a surface facing it, so one unit is about 9200 cd/m^2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]

SUN_RADIUS_RAD = 0.00465
GOLDEN_ANGLE_RAD = np.pi * (3.0 - np.sqrt(5.0))


@dataclass(frozen=True)
class Light:
    """What lights a scene.

    Attributes:
        azimuth_rad: horizontal direction towards the sun, in world coordinates.
        elevation_rad: height of the sun above the horizon.
        sun: irradiance of the sun on a surface facing it.
        ambient: of an open sky. A level surface has 1.38 of it as irradiance, a wall 0.40 (directions are drawn by the
            cosine and weighted by it again), and 0.10 and 0.17 from below and all around.
        sky: factor on the radiance of the sky.
        cover: share of clouds, about 0 (clear) to 1 (overcast).
        clouds: (2,) shift of the cloud pattern.
        haze_m: distance at which 63 % of a surface's radiance is replaced by haze.
        emissive: surfaces send out their albedo as radiance and nothing else happens (targets for measuring).
    """

    azimuth_rad: float = 2.4
    elevation_rad: float = 0.7
    sun: float = 3.1
    ambient: float = 0.72
    sky: float = 1.0
    cover: float = 0.5
    clouds: tuple[float, float] = (0.0, 0.0)
    haze_m: float = 800.0
    emissive: bool = False

    @cached_property
    def towards_sun(self) -> Array:
        """(3,) unit vector to the centre of the sun."""
        c = np.cos(self.elevation_rad)
        return np.array(
            [c * np.cos(self.azimuth_rad), c * np.sin(self.azimuth_rad), np.sin(self.elevation_rad)], np.float32
        )

    def sun_directions(self, count: int) -> Array:
        """(count, 3) unit vectors spread evenly over the sun's disc: one per sample of a pixel gives soft shadows."""
        centre = self.towards_sun.astype(np.float64)
        side = np.cross(centre, [0.0, 0.0, 1.0])
        side /= np.linalg.norm(side)
        top = np.cross(side, centre)
        index = np.arange(count) + 0.5
        radius = SUN_RADIUS_RAD * np.sqrt(index / count) * (count > 1)
        angle = index * GOLDEN_ANGLE_RAD
        spread = centre + (radius * np.cos(angle))[:, None] * side + (radius * np.sin(angle))[:, None] * top
        return (spread / np.linalg.norm(spread, axis=1, keepdims=True)).astype(np.float32)


def ambient_directions(count: int, per_sample: int) -> Array:
    """Directions of the upper hemisphere, cosine-weighted about the vertical, dealt out to the samples of a pixel.

    Every pixel uses the same ``count * per_sample`` directions, so the ambient light carries no noise.

    Args:
        count: samples of a pixel.
        per_sample: directions each sample looks along.

    Returns:
        (count, per_sample, 3) float32 unit vectors.
    """
    total = count * per_sample
    index = np.arange(total) + 0.5
    z = np.sqrt(1.0 - 0.96 * index / total)
    angle = index * GOLDEN_ANGLE_RAD
    flat = np.sqrt(1.0 - z * z)
    directions = np.stack([flat * np.cos(angle), flat * np.sin(angle), z], axis=-1)
    # neighbours on the spiral go to different samples, so that each sample sees high and low directions
    return np.ascontiguousarray(directions.reshape(per_sample, count, 3).swapaxes(0, 1)).astype(np.float32)
