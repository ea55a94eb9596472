"""A target whose transfer function is known: a sinusoidal Siemens star.

It goes through the same rays, samples, lens and pixels as every frame of the dataset, with a linear tone curve, so
what is measured on it is the dataset's own MTF; `lens.true_mtf` is what it must be.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.scenes import lens
from pipeline.scenes.light import Light
from pipeline.scenes.mesh import soup
from pipeline.scenes.objects.base import SceneObject, Surface
from pipeline.scenes.pose import Pose
from pipeline.scenes.render import render
from pipeline.scenes.tone import LINEAR
from pipeline.scenes.world import Placed, World

Array = NDArray[np.float32]

_DISTANCE_M = 10.0
_FOCAL_PX = 760.0
_MATERIAL = "sign"


@dataclass(frozen=True)
class StarGeometry:
    """``grey = mean + amplitude * sin(periods * angle)`` around a centre, at all radii up to `radius_px`.

    Attributes:
        centre_px: (column, row) in image coordinates, where pixel (j, i) covers [j, j+1) x [i, i+1): the centre of
            the image, between four pixels when its sides are even.
        periods: around the circle; frequency at radius r is periods / (2 pi r) cycles per pixel.
        mean, amplitude: of the sinusoid, in grey levels of [0, 1].
        radius_px: outer radius; beyond it the target has its mean grey.
    """

    centre_px: tuple[float, float]
    periods: int = 60
    mean: float = 0.5
    amplitude: float = 0.35
    radius_px: float = 360.0


def star_geometry(width_px: int = 896, height_px: int = 768, periods: int = 60) -> StarGeometry:
    """Where the star is in a frame of this size."""
    return StarGeometry((width_px / 2, height_px / 2), periods, radius_px=0.47 * min(width_px, height_px))


@dataclass(frozen=True)
class StarPaint:
    """Draws the star on a wall facing the camera; local y and z are metres from its centre."""

    geometry: StarGeometry

    def __call__(self, surface: Surface) -> tuple[Array, Array]:
        """See `pipeline.scenes.objects.base.Painter`."""
        geometry = self.geometry
        right = -surface.local[:, 1].astype(np.float64)
        down = -surface.local[:, 2].astype(np.float64)
        wave = geometry.mean + geometry.amplitude * np.sin(geometry.periods * np.arctan2(down, right))
        inside = np.hypot(right, down) < geometry.radius_px * _DISTANCE_M / _FOCAL_PX
        return np.where(inside, wave, geometry.mean).astype(np.float32), np.zeros(len(right), np.float32)


def render_star(
    samples: int = 3,
    *,
    width_px: int = 896,
    height_px: int = 768,
    periods: int = 60,
    lens_sigma_px: float = lens.LENS_SIGMA_PX,
) -> Array:
    """The Siemens star as the dataset's camera sees it.

    Args:
        samples: N of N x N samples a pixel.
        width_px: width of the image.
        height_px: height of the image.
        periods: of the sinusoid around the circle.
        lens_sigma_px: standard deviation of the Gaussian lens, pixels.

    Returns:
        (H, W) float32, linear in the target's reflectance; see `star_geometry`.
    """
    paint = StarPaint(star_geometry(width_px, height_px, periods))
    return _render(paint, samples, width_px, height_px, lens_sigma_px)


def _render(paint: StarPaint, samples: int, width_px: int, height_px: int, lens_sigma_px: float) -> Array:
    half = 1.2 * max(width_px, height_px) / 2 * _DISTANCE_M / _FOCAL_PX
    corners = [[0, -half, -half], [0, -half, half], [0, half, half], [0, half, -half]]
    wall = SceneObject(soup(corners, [[0, 1, 2], [0, 2, 3]], _MATERIAL), kind="target", paint={_MATERIAL: paint})
    world = World([Placed(wall, "target", 0.0, (_DISTANCE_M, 0.0, 0.0))])
    pose = Pose((0.0, 0.0, 0.0), focal_px=_FOCAL_PX, width_px=width_px, height_px=height_px)
    light = Light(emissive=True)
    return render(world, light, pose, LINEAR, samples=samples, lens_sigma_px=lens_sigma_px).radiance
