"""Solid shapes of which objects are assembled: lofts, tubes, lathes, ellipsoids, boxes, rings and panels.

All are closed and face outwards unless said otherwise.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.scenes.mesh import Mesh, join, soup

Array = NDArray[np.float64]
Faces = NDArray[np.int64]


def grid_faces(rows: int, columns: int, wrap: bool = True) -> Faces:
    """Two triangles for every cell of a (rows, columns) net of vertices, row after row.

    Seen from the side where rows grow to the right-hand side of growing columns (from outside, if rows rise and
    columns run counter-clockwise) the triangles are counter-clockwise.

    Args:
        rows: number of rows of vertices.
        columns: vertices in a row.
        wrap: whether the last column joins the first.
    """
    row, column = np.meshgrid(np.arange(rows - 1), np.arange(columns if wrap else columns - 1), indexing="ij")
    here, beside = row * columns + column, row * columns + (column + 1) % columns
    lower = np.stack([here, beside, here + columns], axis=-1).reshape(-1, 3)
    upper = np.stack([beside, beside + columns, here + columns], axis=-1).reshape(-1, 3)
    return np.concatenate([lower, upper]).astype(np.int64)


def vertex_normals(vertices: ArrayLike, faces: ArrayLike) -> Array:
    """Unit vertex normals (V, 3): mean of the adjacent faces' normals weighted by area."""
    vertices, faces = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
    corners = vertices[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = np.stack(
        [np.bincount(faces.ravel(), np.repeat(cross[:, axis], 3), len(vertices)) for axis in range(3)], axis=1
    )
    return np.asarray(total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-15))


def volume(vertices: ArrayLike, faces: ArrayLike) -> float:
    """Signed volume (divergence theorem): positive if a closed surface faces outwards."""
    corners = np.asarray(vertices, np.float64)[np.asarray(faces)]
    return float(np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6)


def skin(sections: ArrayLike, apexes: ArrayLike | None = None) -> tuple[Array, Faces]:
    """Closed surface through cross-sections, its ends fanned to a point each; always faces outwards.

    Args:
        sections: (M, N, 3) points of M rings of N.
        apexes: (2, 3) points that close the first and the last ring; the rings' centroids without.

    Returns:
        vertices (M * N + 2, 3) and faces, counter-clockwise from outside.
    """
    sections = np.asarray(sections, np.float64)
    count, around, _ = sections.shape
    ends = sections[[0, -1]].mean(axis=1) if apexes is None else np.asarray(apexes, np.float64)
    vertices = np.concatenate([sections.reshape(-1, 3), ends])
    here = np.arange(around)
    beside = (here + 1) % around
    first, last = count * around, count * around + 1
    top = (count - 1) * around
    faces = np.concatenate(
        [
            grid_faces(count, around),
            np.stack([np.full(around, first), beside, here], axis=1),
            np.stack([np.full(around, last), top + here, top + beside], axis=1),
        ]
    )
    return (vertices, faces) if volume(vertices, faces) > 0 else (vertices, faces[:, ::-1].copy())


def loft(sections: ArrayLike, material: str, apexes: ArrayLike | None = None, uv: ArrayLike | None = None) -> Mesh:
    """`skin` as a smoothly shaded mesh; uv = (way around, way along) in metres unless given for all vertices."""
    sections = np.asarray(sections, np.float64)
    vertices, faces = skin(sections, apexes)
    if uv is None:
        closed = np.concatenate([sections, sections[:, :1]], axis=1)
        around = np.linalg.norm(np.diff(closed, axis=1), axis=2).sum(axis=1).max()
        centres = sections.mean(axis=1)
        along = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(centres, axis=0), axis=1))]
        count, number, _ = sections.shape
        grid = np.stack([np.tile(np.arange(number) / number * around, count), np.repeat(along, number)], axis=1)
        uv = np.concatenate([grid, [[0.0, along[0]], [0.0, along[-1]]]])
    return soup(vertices, faces, material, vertex_normals(vertices, faces), uv)


def tube(
    path: ArrayLike, radius_m: ArrayLike, material: str, sides: int = 10, squash: float = 1.0, round_ends: bool = True
) -> Mesh:
    """Tapered tube along a path.

    Args:
        path: (M, 3) points, M >= 2.
        radius_m: one radius or (M,).
        material: name.
        sides: vertices around.
        squash: ratio of the second half axis of the section to the first.
        round_ends: hemispherical ends; flat ones without (fewer triangles).
    """
    path = np.asarray(path, np.float64)
    radius = np.broadcast_to(np.asarray(radius_m, np.float64), (len(path),))
    tangent = np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    apexes = path[[0, -1]].copy()
    if round_ends:
        reach = np.array([0.8, 0.45])
        shrink = np.sqrt(1 - reach**2)
        head = path[0] - tangent[0] * radius[0] * reach[:, None]
        tail = path[-1] + tangent[-1] * radius[-1] * reach[::-1, None]
        apexes += tangent[[0, -1]] * radius[[0, -1], None] * np.array([[-1.0], [1.0]])
        path = np.concatenate([head, path, tail])
        radius = np.concatenate([radius[0] * shrink, radius, radius[-1] * shrink[::-1]])
        tangent = np.concatenate([tangent[[0, 0]], tangent, tangent[[-1, -1]]])
    across = np.cross(tangent, np.eye(3)[np.abs(tangent).max(axis=0).argmin()])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    beside = np.cross(tangent, across) * squash
    angle = np.arange(sides) / sides * 2 * np.pi
    ring = np.cos(angle)[None, :, None] * across[:, None] + np.sin(angle)[None, :, None] * beside[:, None]
    return loft(path[:, None] + radius[:, None, None] * ring, material, apexes)


def lathe(profile: ArrayLike, material: str, sides: int = 32) -> Mesh:
    """Surface of revolution about the y axis, shaded smoothly, closed along the axis.

    Args:
        profile: (M, 2) pairs of y and radius, from one end of the body to the other.
        material: name.
        sides: vertices around.
    """
    profile = np.asarray(profile, np.float64)
    angle = np.arange(sides) / sides * 2 * np.pi
    circle = np.stack([np.cos(angle), np.zeros(sides), np.sin(angle)], axis=1)
    sections = profile[:, 1, None, None] * circle[None] + profile[:, 0, None, None] * np.array([0.0, 1.0, 0.0])
    return loft(sections, material)


def ellipsoid(
    centre: ArrayLike,
    radii_m: ArrayLike,
    material: str,
    segments: int = 16,
    rings: int = 10,
    turn: ArrayLike | None = None,
    exponent: float = 1.0,
) -> Mesh:
    """Ellipsoid with exact normals, or a rounded box for exponents below 1 (superellipsoid, Barr 1981).

    Args:
        centre: (3,) metres.
        radii_m: (3,) half axes.
        material: name.
        segments: vertices around z.
        rings: rings between the poles.
        turn: (3, 3) rotation about the centre.
        exponent: 1 is an ellipsoid, towards 0 a box.
    """
    radii = np.asarray(radii_m, np.float64)
    polar = np.linspace(0, np.pi, rings + 2)[1:-1]
    azimuth = np.arange(segments) / segments * 2 * np.pi
    unit = np.stack(
        [
            np.sin(polar)[:, None] * np.cos(azimuth),
            np.sin(polar)[:, None] * np.sin(azimuth),
            np.repeat(np.cos(polar)[:, None], segments, axis=1),
        ],
        axis=-1,
    )
    poles = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    shaped = np.sign(unit) * np.abs(unit) ** exponent
    vertices, faces = skin(shaped, poles)
    normals = np.sign(vertices) * np.abs(vertices) ** (2 / exponent - 1) / radii
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    vertices = vertices * radii
    size = radii.max()
    uv = np.stack([np.tile(azimuth, rings), np.repeat(polar, segments)], axis=1) * size
    uv = np.concatenate([uv, [[0.0, 0.0], [0.0, np.pi * size]]])
    if turn is not None:
        matrix = np.asarray(turn, np.float64)
        vertices, normals = vertices @ matrix.T, normals @ matrix.T
    return soup(vertices + np.asarray(centre, np.float64), faces, material, normals, uv)


_CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float64)
_CUBE_FACES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip


def box(low: ArrayLike, high: ArrayLike, material: str) -> Mesh:
    """Axis-parallel box between two corners (3,), flat shaded, texture mapped by the dominant axis."""
    low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
    return soup(low + _CUBE * (high - low), _CUBE_FACES, material)


def boxes(low: ArrayLike, high: ArrayLike, material: str) -> Mesh:
    """Many boxes at once: corners (B, 3) and (B, 3)."""
    low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
    vertices = low[:, None] + _CUBE[None] * (high - low)[:, None]
    faces = _CUBE_FACES[None] + 8 * np.arange(len(low))[:, None, None]
    return soup(vertices.reshape(-1, 3), faces.reshape(-1, 3), material)


def torus(centre: ArrayLike, ring_m: float, tube_m: float, material: str, sides: int = 36, around: int = 8) -> Mesh:
    """Ring about an axis along y, smooth."""
    angle = np.arange(sides) / sides * 2 * np.pi
    small = np.arange(around) / around * 2 * np.pi
    outward = np.stack([np.cos(angle), np.zeros(sides), np.sin(angle)], axis=1)
    normals = np.cos(small)[None, :, None] * outward[:, None] + np.sin(small)[None, :, None] * np.array([0.0, 1.0, 0.0])
    vertices = ring_m * outward[:, None] + tube_m * normals
    grid = grid_faces(sides + 1, around) % (sides * around)
    flat = vertices.reshape(-1, 3)
    faces = grid if volume(flat, grid) > 0 else grid[:, ::-1]
    return soup(flat + np.asarray(centre, np.float64), faces, material, normals.reshape(-1, 3))


def panel(corners: ArrayLike, material: str, uv: ArrayLike | None = None) -> Mesh:
    """A flat convex polygon (N, 3), counter-clockwise from its front; open, seen from both sides alike."""
    corners = np.asarray(corners, np.float64)
    middle = np.arange(1, len(corners) - 1)
    return soup(corners, np.stack([np.zeros_like(middle), middle, middle + 1], axis=1), material, uv=uv)


def panels(corners: ArrayLike, material: str, uv: ArrayLike | None = None) -> Mesh:
    """Many flat quadrilaterals (Q, 4, 3) at once, each counter-clockwise from its front; uv (Q, 4, 2)."""
    corners = np.asarray(corners, np.float64)
    first = 4 * np.arange(len(corners))[:, None]
    faces = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])])
    flat_uv = None if uv is None else np.asarray(uv, np.float64).reshape(-1, 2)
    return soup(corners.reshape(-1, 3), faces, material, uv=flat_uv)


def mirrored(mesh: Mesh) -> Mesh:
    """The same thing on the other side of the x-z plane; local coordinates are mirrored too."""
    flip = np.array([1, -1, 1], np.float32)
    return replace(
        mesh,
        position=mesh.position[:, ::-1] * flip,
        normal=mesh.normal[:, ::-1] * flip,
        local=mesh.local[:, ::-1] * flip,
        uv=mesh.uv[:, ::-1],
    )


def both_sides(mesh: Mesh) -> Mesh:
    """A part and its mirror image across the x-z plane."""
    return join([mesh, mirrored(mesh)])
