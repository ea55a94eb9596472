"""Radiance that leaves the points rays hit: sun, ambient light with occlusion, one mirror reflection, haze.

``L = albedo * (E_sun max(n.s, 0) V + E_amb A + floor) * (1 - F) + F * L_mirror``, with V the visibility of the sun,
A the mean over fixed directions of the cosine times visibility within 12 m, and F Schlick's approximation of the
Fresnel reflectance, ``F = F0 + (1 - F0)(1 - cos)^5`` (Schlick 1994). No random numbers: every pixel uses the same
directions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.scenes.light import Light, ambient_directions
from pipeline.scenes.sky import sky_radiance
from pipeline.scenes.surface import Points, grouped, mean_albedo, surface_points
from pipeline.scenes.vectors import dot, unit
from pipeline.scenes.world import Hits, World

Array = NDArray[np.float32]

AMBIENT_REACH_M = 12.0
_FEW_RAYS_BEYOND_M = 45.0
_TRANSMITTED = np.float32(0.55)  # share of the sun a leaf lets through
_HAZE_RADIANCE = np.float32(1.4)
_GLINT = np.float32(25.0)


@dataclass(frozen=True)
class Directions:
    """Fixed directions per sample of a pixel.

    Attributes:
        sun: (S, 3) towards points of the sun's disc.
        ambient: (S, A, 3) of the sky's hemisphere.
    """

    sun: Array
    ambient: Array

    @classmethod
    def of(cls, light: Light, samples: int, ambient_rays: int) -> Directions:
        """For `samples` samples of a pixel, each with one sun ray and `ambient_rays` ambient rays."""
        return cls(light.sun_directions(samples), ambient_directions(samples, ambient_rays))


def shade(
    world: World,
    light: Light,
    directions: Directions,
    origin: Array,
    direction: Array,
    sample: NDArray[np.integer],
    angle_rad: float,
) -> tuple[Array, NDArray[np.int32]]:
    """Radiance along rays.

    Args:
        world: what may be hit.
        light: what lights it.
        directions: of the samples.
        origin: (3,) where all rays begin.
        direction: (K, 3) unit vectors.
        sample: (K,) which of the pixel's samples a ray is.
        angle_rad: angle between neighbouring samples.

    Returns:
        (K,) radiance and (K,) index of the object hit, or -1.
    """
    hits = world.trace(origin, direction)
    radiance = np.empty(len(direction), np.float32)
    missed = hits.thing < 0
    if missed.any():
        radiance[missed] = _HAZE_RADIANCE if light.emissive else sky_radiance(direction[missed], light, angle_rad)
    rows = np.flatnonzero(~missed)
    if len(rows):
        rows = grouped(world, hits, rows)
        seen = direction[rows]
        met = _chosen(hits, rows)
        points = surface_points(world, origin, seen, met, angle_rad)
        radiance[rows] = points.albedo if light.emissive else _lit(world, light, directions, points, seen, sample[rows])
    return radiance, hits.thing


def _lit(
    world: World, light: Light, directions: Directions, points: Points, seen: Array, sample: NDArray[np.integer]
) -> Array:
    """(K,) radiance of lit points towards the viewer."""
    # start off the surface by more than the rounding of the hit point, on the side that is seen
    away = np.float32(1e-3) + points.distance_m * np.float32(2e-4)
    start = points.position + points.geometric * away[:, None]
    direct, visible = _sun(world, light, directions, points, start, sample)
    irradiance = direct + _ambient(world, light, directions, points, start, sample)
    radiance = points.albedo * irradiance
    mirror = np.flatnonzero(points.f0 > 0)
    if len(mirror):
        radiance[mirror] = _mirrored(world, light, points, start, seen, visible, mirror, radiance[mirror])
    haze = 1.0 - np.exp(points.distance_m * np.float32(-1.0 / light.haze_m))
    return radiance + haze * (_HAZE_RADIANCE * np.float32(light.sky) - radiance)


def _sun(
    world: World, light: Light, directions: Directions, points: Points, start: Array, sample: NDArray[np.integer]
) -> tuple[Array, Array]:
    """(K,) irradiance from the sun and (K,) its visibility, 0 or 1."""
    towards = light.towards_sun
    cosine = dot(points.normal, towards)
    thin = points.thin
    received = np.maximum(cosine, 0.0)
    received[thin] = np.where(cosine < 0, -cosine * _TRANSMITTED, cosine)[thin] * 0.8 + 0.12
    # a face turned away from the sun is dark whatever its smooth normal is
    reachable = (received > 0) & ((dot(points.geometric, towards) > 0) | thin)
    rows = np.flatnonzero(reachable)
    visible = np.zeros(len(cosine), np.float32)
    if len(rows):
        visible[rows] = ~world.occluded(start[rows], directions.sun[sample[rows]])
    return received * visible * np.float32(light.sun), visible


def _ambient(
    world: World, light: Light, directions: Directions, points: Points, start: Array, sample: NDArray[np.integer]
) -> Array:
    """(K,) irradiance from the sky within reach of fixed directions, plus light from below and all around."""
    rays = directions.ambient.shape[1]
    gathered = np.zeros(len(start), np.float32)
    # leaves and far things are so broken up that one ray of each sample does
    few = points.thin | (points.distance_m > _FEW_RAYS_BEYOND_M)
    for ray in range(rays):
        asking = np.flatnonzero(~few) if ray else np.arange(len(start))
        towards = directions.ambient[sample[asking], ray]
        thin = points.thin[asking]
        cosine = np.maximum(dot(points.normal[asking], towards), 0.0)
        cosine = np.where(thin, cosine * 0.5 + 0.25, cosine)
        outside = (dot(points.geometric[asking], towards) > 0) | thin
        chosen = np.flatnonzero((cosine > 0.02) & outside)
        rows = asking[chosen]
        free = ~world.occluded(start[rows], towards[chosen], AMBIENT_REACH_M)
        gathered[rows] += cosine[chosen] * free
    gathered *= np.float32(2.0 * light.ambient) / np.where(few, 1, rays).astype(np.float32)
    level = points.normal[:, 2]
    return gathered + np.float32(light.ambient) * (np.float32(0.12) * (1.0 - 0.6 * level) + np.float32(0.05))


def _mirrored(
    world: World,
    light: Light,
    points: Points,
    start: Array,
    seen: Array,
    visible: Array,
    rows: NDArray[np.intp],
    diffuse: Array,
) -> Array:
    """(R,) radiance of the chosen points with their mirror image of the surroundings and the sun's glint."""
    normal, view = points.normal[rows], seen[rows]
    cosine = np.clip(-dot(normal, view), 0.0, 1.0)
    f0 = points.f0[rows]
    share = f0 + (1.0 - f0) * (1.0 - cosine) ** 5
    reflected = unit(view + 2.0 * cosine[:, None] * normal)
    hits = world.trace(start[rows], reflected)
    image = np.empty(len(rows), np.float32)
    sky = hits.thing < 0
    image[sky] = sky_radiance(reflected[sky], light)
    solid = np.flatnonzero(~sky)
    if len(solid):
        image[solid] = _plain(world, light, _chosen(hits, solid), reflected[solid])
    sun = (
        np.clip(dot(reflected, light.towards_sun), 0.0, 1.0) ** 900
        * visible[rows]
        * _GLINT
        * np.float32(light.sun / 3.1)
    )
    return diffuse * (1.0 - share) + share * (image + sun)


def _plain(world: World, light: Light, hits: Hits, direction: Array) -> Array:
    """(R,) radiance of hits with mean albedo, unshadowed: good enough for what a mirror shows."""
    normal = unit(hits.geometric)
    normal *= np.where(dot(normal, direction) > 0, -1.0, 1.0)[:, None]
    sun = 0.75 * light.sun * np.maximum(dot(normal, light.towards_sun), 0.0)
    ambient = light.ambient * (0.35 + 0.35 * normal[:, 2])
    return np.asarray(mean_albedo(world, hits) * (sun + ambient), np.float32)


def _chosen(hits: Hits, rows: NDArray[np.intp]) -> Hits:
    return Hits(
        hits.thing[rows], hits.face[rows], hits.u[rows], hits.v[rows], hits.distance_m[rows], hits.geometric[rows]
    )
