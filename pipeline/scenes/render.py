"""Pictures of a world: N x N regular samples a pixel, traced, shaded, tone-mapped and filtered.

The tone curve acts on every sample, before lens and pixels average them, so that the filter of `lens` is exact in
grey levels; the same filter gives the linear radiance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.scenes import lens
from pipeline.scenes.light import Light
from pipeline.scenes.pose import Pose
from pipeline.scenes.shading import Directions, shade
from pipeline.scenes.tone import Tone
from pipeline.scenes.world import World

Array = NDArray[np.float32]

_RAYS_AT_ONCE = 100_000
_AMBIENT_RAYS = {1: 6, 2: 2, 3: 2}  # samples -> ambient rays of a sample; more samples need fewer


@dataclass(frozen=True)
class Picture:
    """What a camera sees.

    Attributes:
        grey: (H, W) grey levels in [0, 1] after tone curve, lens and pixels.
        radiance: (H, W) linear radiance after lens and pixels, in the scene's unit (`light`).
        things: (H N, W N) object seen by each sample, or -1 for the sky.
        samples: N.
    """

    grey: Array
    radiance: Array
    things: NDArray[np.int16]
    samples: int


def render(
    world: World,
    light: Light,
    pose: Pose,
    tone: Tone,
    *,
    samples: int = 3,
    lens_sigma_px: float = lens.LENS_SIGMA_PX,
) -> Picture:
    """Take a picture; a pure function of its arguments.

    Args:
        world: what there is.
        light: what lights it.
        pose: camera and size of the image.
        tone: tone curve of `grey`.
        samples: N of N x N samples a pixel.
        lens_sigma_px: standard deviation of the Gaussian lens, pixels; 0 for none.

    Raises:
        InputError: samples or the lens out of range.
    """
    if not 1 <= samples <= 16:
        raise InputError(f"samples={samples}: expected 1 to 16 samples along each axis of a pixel")
    if not 0.0 <= lens_sigma_px <= 10.0:
        raise InputError(f"lens_sigma_px={lens_sigma_px}: expected 0 to 10 pixels")
    margin = lens.margin_px(samples, lens_sigma_px)
    columns = np.arange((pose.width_px + 2 * margin) * samples)
    rows = np.arange((pose.height_px + 2 * margin) * samples)
    dense = np.empty((len(rows), len(columns)), np.float32)
    grey = np.empty_like(dense)
    things = np.empty(dense.shape, np.int16)
    directions = Directions.of(light, samples * samples, _AMBIENT_RAYS.get(samples, 1))
    angle_rad = pose.angle_per_pixel_rad() / samples
    origin = np.asarray(pose.position_m, np.float32)
    strip = max(1, _RAYS_AT_ONCE // len(columns))
    for top in range(0, len(rows), strip):
        chosen = rows[top : top + strip]
        rays = pose.rays((columns + 0.5) / samples - margin, (chosen + 0.5) / samples - margin)
        sample = ((chosen % samples)[:, None] * samples + columns % samples).ravel()
        radiance, thing = shade(world, light, directions, origin, rays, sample, angle_rad)
        part = slice(top, top + len(chosen))
        dense[part] = radiance.reshape(len(chosen), -1)
        grey[part] = tone(dense[part])
        things[part] = thing.reshape(len(chosen), -1)
    inner = slice(margin * samples, -margin * samples or None)
    return Picture(
        grey=lens.expose(grey, samples, lens_sigma_px),
        radiance=lens.expose(dense, samples, lens_sigma_px),
        things=np.ascontiguousarray(things[inner, inner]),
        samples=samples,
    )
