"""What everything stands on: road, pavements, kerbs and yards."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.scenes.layout.road import Road
from pipeline.scenes.mesh import Mesh, join, soup

Array64 = NDArray[np.float64]

PAVEMENT_M = 0.12
_EVERY_M = 2.0


def ribbon(
    road: Road, inner_m: float, outer_m: float, height_m: float, material: str, *, first_m: float | None = None
) -> Mesh:
    """A level strip along a road.

    Args:
        road: its course.
        inner_m: one side, metres to the left of the centreline.
        outer_m: the other side.
        height_m: above the road.
        material: name.
        first_m: where it begins; the road's own beginning without.

    Returns:
        a mesh whose texture coordinates are (s, d) in metres.
    """
    s = np.arange(road.first_m if first_m is None else first_m, road.last_m + _EVERY_M, _EVERY_M)
    low, high = sorted((inner_m, outer_m))
    return _sheet(road, s, [(low, height_m), (high, height_m)], material)


def kerb(road: Road, side: int, width_m: float = 0.15, height_m: float = PAVEMENT_M + 0.005) -> Mesh:
    """A kerb stone on the left (side = 1) or right (-1) of the road: its upright face and its top."""
    s = np.arange(road.first_m, road.last_m + _EVERY_M, _EVERY_M)
    near, far = side * road.half_width_m, side * (road.half_width_m + width_m)
    top = [(near, height_m), (far, height_m)]
    face = [(near, -0.02), (near, height_m)]
    if side > 0:
        return join([_sheet(road, s, face, "concrete"), _sheet(road, s, top, "concrete")])
    return join([_sheet(road, s, face[::-1], "concrete"), _sheet(road, s, top[::-1], "concrete")])


def _sheet(road: Road, s: Array64, profile: list[tuple[float, float]], material: str) -> Mesh:
    """The surface swept by a polyline (d, z) along the road; its outer side is to the left of the polyline's way
    from larger to smaller d, that is above where d grows.
    """
    rows = []
    run = np.concatenate([[0.0], np.cumsum([np.hypot(b[0] - a[0], b[1] - a[1]) for a, b in _pairs(profile)])])
    for (d, z), along in zip(profile, run, strict=True):
        x, y, _ = road.at(s, d)
        rows.append(np.stack([x, y, np.full_like(x, z), s, np.full_like(x, profile[0][0] + along)], axis=1))
    grid = np.stack(rows)
    count = len(s)
    i, j = np.meshgrid(np.arange(len(profile) - 1), np.arange(count - 1), indexing="ij")
    a = (i * count + j).ravel()
    faces = np.concatenate([np.stack([a, a + 1, a + count], 1), np.stack([a + 1, a + count + 1, a + count], 1)])
    flat = grid.reshape(-1, 5)
    return soup(flat[:, :3], faces, material, uv=flat[:, 3:])


def _pairs(items: list[tuple[float, float]]) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    return list(itertools.pairwise(items))


def plane(low: ArrayLike, high: ArrayLike, height_m: float, material: str) -> Mesh:
    """A level rectangle between two corners (x, y), metres; texture coordinates are world metres."""
    (x0, y0), (x1, y1) = np.asarray(low, float), np.asarray(high, float)
    corners = [[x0, y0, height_m], [x1, y0, height_m], [x1, y1, height_m], [x0, y1, height_m]]
    return soup(corners, [[0, 1, 2], [0, 2, 3]], material, uv=np.array(corners)[:, :2])
