"""Triangle soups: what every object of a scene is made of, and how it is moved and joined."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float32]


@dataclass(frozen=True)
class Mesh:
    """F triangles; every corner carries its own attributes, so edges may be sharp or smooth.

    Axes: x forward (for things that have a front), y left, z up; metres.

    Attributes:
        position: (F, 3, 3) corners, metres.
        normal: (F, 3, 3) unit shading normals.
        local: (F, 3, 3) corners in the object's own coordinates, unchanged by placement; painters read these.
        uv: (F, 3, 2) texture coordinates, metres along the surface.
        material: (F,) names of materials, as indices into `materials`.
        materials: the names.
    """

    position: Array
    normal: Array
    local: Array
    uv: Array
    material: NDArray[np.int16]
    materials: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.position)

    def placed(self, yaw_rad: float = 0.0, position_m: ArrayLike = (0.0, 0.0, 0.0), scale: float = 1.0) -> Mesh:
        """Scaled, turned about z, then moved; local coordinates stay."""
        turn = rotation(yaw_rad, "z")
        moved = self.position @ turn.T * np.float32(scale) + np.asarray(position_m, np.float32)
        return replace(self, position=moved.astype(np.float32), normal=(self.normal @ turn.T).astype(np.float32))

    def turned(self, matrix: ArrayLike, position_m: ArrayLike = (0.0, 0.0, 0.0)) -> Mesh:
        """Position and normal under a rotation matrix (3, 3) and a shift; local coordinates stay."""
        turn = np.asarray(matrix, np.float32)
        moved = self.position @ turn.T + np.asarray(position_m, np.float32)
        return replace(self, position=moved, normal=(self.normal @ turn.T).astype(np.float32))

    def as_local(self) -> Mesh:
        """The same mesh whose local coordinates are its present positions (after assembling an object)."""
        return replace(self, local=self.position.copy())


def rotation(angle_rad: float, axis: str = "z") -> Array:
    """Rotation matrix (3, 3) about one axis, right-handed."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    rows = {
        "x": [[1, 0, 0], [0, c, -s], [0, s, c]],
        "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
        "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
    }
    return np.asarray(rows[axis], np.float32)


def join(meshes: Iterable[Mesh]) -> Mesh:
    """One mesh of several; material names are merged."""
    parts: Sequence[Mesh] = [mesh for mesh in meshes if len(mesh)]
    names = tuple(dict.fromkeys(name for mesh in parts for name in mesh.materials))
    codes = {name: code for code, name in enumerate(names)}
    return Mesh(
        position=np.concatenate([mesh.position for mesh in parts]),
        normal=np.concatenate([mesh.normal for mesh in parts]),
        local=np.concatenate([mesh.local for mesh in parts]),
        uv=np.concatenate([mesh.uv for mesh in parts]),
        material=np.concatenate(
            [np.asarray([codes[name] for name in mesh.materials], np.int16)[mesh.material] for mesh in parts]
        ),
        materials=names,
    )


def soup(
    vertices: ArrayLike,
    faces: ArrayLike,
    material: str,
    normals: ArrayLike | None = None,
    uv: ArrayLike | None = None,
) -> Mesh:
    """A mesh from shared vertices; degenerate triangles are dropped.

    Args:
        vertices: (V, 3) metres.
        faces: (F, 3) indices, counter-clockwise seen from outside.
        material: one name for all faces.
        normals: (V, 3) unit vertex normals for smooth shading; flat shading without.
        uv: (V, 2) texture coordinates in metres; box mapping by the dominant axis without.
    """
    shared = np.asarray(vertices, np.float64)
    index = np.asarray(faces, np.int64)
    corners = shared[index]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(cross, axis=1)
    keep = length > 1e-12
    index, corners, flat = index[keep], corners[keep], cross[keep] / length[keep, None]
    normal = np.repeat(flat[:, None], 3, axis=1) if normals is None else np.asarray(normals, np.float64)[index]
    if uv is None:
        across = np.array([[1, 2], [0, 2], [0, 1]])[np.abs(flat).argmax(axis=1)]
        mapped = np.take_along_axis(corners, np.repeat(across[:, None, :], 3, axis=1), axis=2)
    else:
        mapped = np.asarray(uv, np.float64)[index]
    position = corners.astype(np.float32)
    return Mesh(
        position=position,
        normal=normal.astype(np.float32),
        local=position.copy(),
        uv=mapped.astype(np.float32),
        material=np.zeros(len(index), np.int16),
        materials=(material,),
    )
