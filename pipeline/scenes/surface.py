"""What rays hit: albedo, mirror reflectance and shading normal at the points of first hits."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pipeline.scenes.field import field
from pipeline.scenes.objects.base import Surface
from pipeline.scenes.objects.materials import MATERIALS
from pipeline.scenes.textures import library
from pipeline.scenes.vectors import dot, turned, unit
from pipeline.scenes.world import NAMES, Hits, World

Array = NDArray[np.float32]

# material -> (size of the second layer in metres, its strength): hides the repetition of tiles
_SECOND_LAYER = {
    "asphalt": (23.0, 0.10),
    "litter": (23.0, 0.18),
    "dirt": (23.0, 0.18),
    "grass": (23.0, 0.20),
    "paver": (23.0, 0.12),
    "cobble": (23.0, 0.15),
    "concrete": (23.0, 0.10),
    "brick": (7.3, 0.18),
    "stone": (7.3, 0.18),
    "plaster": (7.3, 0.18),
    "plank": (7.3, 0.18),
    "tile": (7.3, 0.20),
    "shingle": (7.3, 0.20),
}
_F0 = np.array([MATERIALS[name].f0 for name in NAMES], np.float32)
_TWO_SIDED = np.array([MATERIALS[name].two_sided for name in NAMES], np.bool_)
_LARGEST_ALBEDO = 0.92


@dataclass(frozen=True)
class Points:
    """K surface points ready for light.

    Attributes:
        position: (K, 3) world coordinates, metres.
        normal: (K, 3) unit shading normals, on the viewer's side (leaves: either).
        geometric: (K, 3) unit normals of the faces, on the viewer's side.
        albedo: (K,) diffuse albedo.
        f0: (K,) mirror reflectance at normal incidence.
        thin: (K,) lit from both sides (leaves).
        material: (K,) codes.
        distance_m: (K,) from the ray's origin.
    """

    position: Array
    normal: Array
    geometric: Array
    albedo: Array
    f0: Array
    thin: NDArray[np.bool_]
    material: NDArray[np.int16]
    distance_m: Array


def surface_points(world: World, origin: Array, direction: Array, hits: Hits, angle_rad: float) -> Points:
    """Interpolate, texture and paint the points rays hit.

    Args:
        world: what was hit.
        origin: (3,) or (K, 3) where the rays began.
        direction: (K, 3) unit vectors.
        hits: all of which hit something; fastest if `grouped`.
        angle_rad: angle between neighbouring samples; times distance it is the footprint of a sample.
    """
    thing, face = hits.thing, hits.face
    weight = np.stack([1.0 - hits.u - hits.v, hits.u, hits.v], axis=1)
    blended = _blended(world.corners[face], weight)
    geometric = unit(hits.geometric)
    facing = dot(geometric, direction)
    geometric *= np.where(facing > 0, np.float32(-1), np.float32(1))[:, None]
    # a surface seen at a grazing angle covers more of its texture; the mean of both directions is taken
    slant = np.sqrt(np.maximum(np.abs(facing), np.float32(0.02)))
    footprint = (hits.distance_m * np.float32(0.8 * angle_rad) / slant).astype(np.float32)
    footprint /= world.scale[thing]
    material = world.material[face]
    normal = unit(blended[:, 0:3])
    albedo = np.empty(len(thing), np.float32)
    f0 = _F0[material]
    tangents = world.tangents
    for rows in _runs(_group(world, thing, face)):
        code = int(material[rows.start])
        painter = int(world.painter[thing[rows.start], code])
        name = NAMES[code]
        uv, foot = blended[rows, 3:5], footprint[rows]
        tone, slope = _textured(name, uv, foot)
        tone = tone * world.tint[thing[rows], code]
        if painter >= 0:
            local = _blended(world.local[face[rows]], weight[rows])
            towards = turned(direction[rows], world.cos[thing[rows]], -world.sin[thing[rows]])
            surface = Surface(local, normal[rows], uv, tone, foot, towards)
            tone, f0[rows] = world.painters[painter](surface)
        albedo[rows] = tone
        if slope is not None:
            both = tangents[face[rows]]
            bent = normal[rows] - both[:, 0:3] * slope[:, :1] - both[:, 3:6] * slope[:, 1:]
            normal[rows] = unit(bent)
    normal = turned(normal, world.cos[thing], world.sin[thing])
    thin = _TWO_SIDED[material]
    # smooth normals may lean away from a face that is seen edge on; a closed surface shows its outer side
    wrong = (dot(normal, geometric) < 0) & ~thin
    normal[wrong] *= -1
    position = origin + direction * hits.distance_m[:, None]
    return Points(
        position=position.astype(np.float32, copy=False),
        normal=normal,
        geometric=geometric,
        albedo=np.clip(albedo, 0.005, _LARGEST_ALBEDO),
        f0=f0,
        thin=thin,
        material=material,
        distance_m=hits.distance_m,
    )


def mean_albedo(world: World, hits: Hits) -> Array:
    """(K,) albedo of hits without textures or painters: what mirrors show."""
    code = world.material[hits.face]
    constants = np.array([MATERIALS[name].albedo for name in NAMES], np.float32)
    return constants[code] * world.tint[hits.thing, code]


def _blended(corners: Array, weight: Array) -> Array:
    """(K, A) attributes of points from those of three corners (K, 3, A) and their weights (K, 3)."""
    return corners[:, 0] * weight[:, 0:1] + corners[:, 1] * weight[:, 1:2] + corners[:, 2] * weight[:, 2:3]


def grouped(world: World, hits: Hits, rows: NDArray[np.intp]) -> NDArray[np.intp]:
    """The rows of hits, those of one material and painter after another (in their own order within).

    Args:
        world: what was hit.
        hits: of rays.
        rows: (R,) of them that hit something.
    """
    return rows[np.argsort(_group(world, hits.thing[rows], hits.face[rows]), kind="stable")]


def _group(world: World, thing: NDArray[np.int32], face: NDArray[np.int64]) -> NDArray[np.int16]:
    """(K,) number of the material and painter; the painter is told apart only where there is one."""
    material = world.material[face]
    painter = world.painter[thing, material]
    return np.where(painter >= 0, painter + np.int16(len(NAMES)), material)


def _runs(group: NDArray[np.int16]) -> list[slice]:
    """Runs of equal numbers."""
    cuts = [0, *(np.flatnonzero(np.diff(group)) + 1).tolist(), len(group)]
    return [slice(begin, end) for begin, end in pairwise(cuts)]


def _textured(name: str, uv: Array, footprint: Array) -> tuple[Array, Array | None]:
    """Albedo (K,) and, where there is relief, slope (K, 2) of a material."""
    material = MATERIALS[name]
    if material.texture is None:
        return np.full(len(uv), material.albedo, np.float32), None
    texture = library()[material.texture]
    albedo, slope = texture.sample(uv, footprint)
    if name in _SECOND_LAYER:
        size_m, strength = _SECOND_LAYER[name]
        layer = field(uv, footprint, size_m, 0.37)
        albedo = albedo * np.exp(np.float32(strength) * layer)
    if material.bump == 0.0:
        return albedo, None
    fade = np.clip(1.5 - footprint / np.float32(24.0 * texture.texel_m), 0.15, 1.0)
    return albedo, slope * (np.float32(material.bump) * fade)[:, None]
