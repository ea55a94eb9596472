"""Placed objects as one thing that rays can hit.

A tree of boxes over all triangles (`pipeline.scenes.ray_tree`) finds the one that a ray meets first, and where.
Everything else a hit needs (normals, texture coordinates, materials) is kept once per distinct mesh in the object's own
coordinates and looked up by (object, triangle), so a hundred copies of one tree cost the attributes of one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError, did_you_mean
from pipeline.scenes.mesh import Mesh
from pipeline.scenes.objects.base import Painter, SceneObject
from pipeline.scenes.objects.materials import MATERIALS
from pipeline.scenes.vectors import cross

Array = NDArray[np.float32]
Integers = NDArray[np.int32]

CODES = {name: code for code, name in enumerate(MATERIALS)}
NAMES = tuple(MATERIALS)


@dataclass(frozen=True)
class Placed:
    """An object in the world: scaled, turned about z, moved.

    Attributes:
        thing: the object.
        name: unique in its scene (``"car-3"``).
        yaw_rad: heading of the object's x axis in world coordinates.
        position_m: (3,) where its origin lies.
        scale: factor on its size.
    """

    thing: SceneObject
    name: str
    yaw_rad: float = 0.0
    position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scale: float = 1.0

    def corners(self) -> Array:
        """(F, 3, 3) corners of its triangles in world coordinates."""
        return self.thing.mesh.placed(self.yaw_rad, self.position_m, self.scale).position


@dataclass(frozen=True)
class Hits:
    """What K rays met first; entries of rays that met nothing are -1 or meaningless.

    Attributes:
        thing: (K,) index of the object in the world, or -1.
        face: (K,) index into the world's table of attributes.
        u, v: (K,) barycentric weights of the second and third corner.
        distance_m: (K,) along the ray.
        geometric: (K, 3) face normals in world coordinates, not unit.
    """

    thing: Integers
    face: NDArray[np.int64]
    u: Array
    v: Array
    distance_m: Array
    geometric: Array


class World:
    """Placed objects, ready for rays.

    Attributes:
        placed: the objects.
        corners: (F, 3, 5) per distinct triangle and corner: normal (3), uv (2).
        local: (F, 3, 3) local coordinates of the corners; apart, since only painters ask for them.
        tangents: (F, 6) unit vectors along u and v in object coordinates.
        material: (F,) codes of materials (index into `NAMES`).
        cos, sin, scale: (O,) how each object is turned and scaled.
        tint: (O, M) factor on the albedo of each material of each object.
        painter: (O, M) index into `painters`, or -1.
        painters: the painters in use.
    """

    def __init__(self, placed: Sequence[Placed]) -> None:
        """Collect the objects and build the tree that rays are traced through.

        Raises:
            InputError: no objects, an object without triangles, corners that are not finite, or an unknown material.
        """
        from pipeline.scenes.ray_tree import RayTree  # loads a compiler

        if not placed:
            raise InputError("a world needs at least one object")
        self.placed = tuple(placed)
        meshes: dict[int, Mesh] = {}
        starts: dict[int, int] = {}
        corners: list[Array] = []  # in world coordinates
        total = 0
        for one in self.placed:
            mesh = one.thing.mesh
            if len(mesh) == 0:
                raise InputError(f"object '{one.name}' ({one.thing.kind}) has no triangles")
            corners.append(one.corners())
            if not np.isfinite(corners[-1]).all():
                raise InputError(f"object '{one.name}' ({one.thing.kind}) has corners that are not finite numbers")
            if id(mesh) not in starts:
                starts[id(mesh)], meshes[id(mesh)] = total, mesh
                total += len(mesh)
        triangles = np.concatenate(corners)
        self._tree = RayTree(triangles)
        first, second = (triangles[:, other].astype(np.float64) - triangles[:, 0] for other in (1, 2))
        self._geometric = cross(first, second).astype(np.float32)
        sizes = [len(one) for one in corners]
        self._owner = np.repeat(np.arange(len(sizes), dtype=np.int32), sizes)  # of each triangle
        begin = np.array([starts[id(one.thing.mesh)] for one in self.placed], np.int64)
        self._shift = begin - np.cumsum([0, *sizes[:-1]])  # from a triangle's row to that in the table of attributes
        self.corners = np.empty((total, 3, 5), np.float32)
        self.local = np.empty((total, 3, 3), np.float32)
        self.tangents = np.empty((total, 6), np.float32)
        self.material = np.empty(total, np.int16)
        for key, mesh in meshes.items():
            rows = slice(starts[key], starts[key] + len(mesh))
            self.corners[rows, :, 0:3] = mesh.normal
            self.corners[rows, :, 3:5] = mesh.uv
            self.local[rows] = mesh.local
            self.tangents[rows] = _tangents(mesh)
            self.material[rows] = _codes(mesh)[mesh.material]
        self._tables()

    def _tables(self) -> None:
        """Per object: turn, tint and painter of each material."""
        yaw = np.array([one.yaw_rad for one in self.placed])
        self.cos = np.cos(yaw).astype(np.float32)
        self.sin = np.sin(yaw).astype(np.float32)
        self.scale = np.array([one.scale for one in self.placed], np.float32)
        self.tint = np.ones((len(self.placed), len(NAMES)), np.float32)
        self.painter = np.full((len(self.placed), len(NAMES)), -1, np.int16)
        self.painters: list[Painter] = []
        for index, one in enumerate(self.placed):
            for name, factor in one.thing.tint.items():
                self.tint[index, _code(name)] = factor
            for name, painter in one.thing.paint.items():
                self.painter[index, _code(name)] = len(self.painters)
                self.painters.append(painter)

    def trace(self, origin: Array, direction: Array) -> Hits:
        """First hits of rays.

        Args:
            origin: (K, 3) float32, or (3,) for all.
            direction: (K, 3) float32 unit vectors.
        """
        row, u, v, distance_m = self._tree.first(_many(origin, len(direction)), np.ascontiguousarray(direction))
        thing = np.where(row >= 0, self._owner[row], -1).astype(np.int32)
        return Hits(
            thing=thing,
            face=row + self._shift[thing],
            u=u.astype(np.float32),
            v=v.astype(np.float32),
            distance_m=distance_m.astype(np.float32),
            geometric=self._geometric[row],
        )

    def occluded(self, origin: Array, direction: Array, reach_m: float | None = None) -> NDArray[np.bool_]:
        """Whether anything lies along rays.

        Args:
            origin: (K, 3).
            direction: (K, 3) unit vectors, or (3,) for all.
            reach_m: how far to look; without it, for ever.
        """
        reach = np.inf if reach_m is None else reach_m
        return self._tree.any(np.ascontiguousarray(origin), _many(direction, len(origin)), reach)


def _many(vector: Array, count: int) -> Array:
    """(count, 3) contiguous float32, repeating a single vector."""
    return np.ascontiguousarray(np.broadcast_to(np.asarray(vector, np.float32), (count, 3)))


def _code(name: str) -> int:
    if name not in CODES:
        raise InputError(f"unknown material '{name}'; {did_you_mean(name, NAMES)}")
    return CODES[name]


def _codes(mesh: Mesh) -> NDArray[np.int16]:
    """Code of each of the mesh's own materials."""
    return np.array([_code(name) for name in mesh.materials], np.int16)


def _tangents(mesh: Mesh) -> Array:
    """(F, 6) unit directions in which u and v grow, from positions and texture coordinates.

    With edges e1, e2 and their texture steps (u1, v1), (u2, v2):
    T = (e1 v2 - e2 v1) / det, B = (e2 u1 - e1 u2) / det, det = u1 v2 - v1 u2.
    """
    first, second = mesh.position[:, 1] - mesh.position[:, 0], mesh.position[:, 2] - mesh.position[:, 0]
    one, two = mesh.uv[:, 1] - mesh.uv[:, 0], mesh.uv[:, 2] - mesh.uv[:, 0]
    sign = np.where(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0] < 0, -1, 1)[:, None].astype(np.float32)
    along_u = (first * two[:, 1:] - second * one[:, 1:]) * sign
    along_v = (second * one[:, :1] - first * two[:, :1]) * sign
    both = np.stack([along_u, along_v], axis=1)
    return (both / np.maximum(np.linalg.norm(both, axis=2, keepdims=True), 1e-12)).reshape(-1, 6)
