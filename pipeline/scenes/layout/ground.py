"""What everything stands on: road, pavements, kerbs, yards, and the wooded hills that close the view."""

from __future__ import annotations

from dataclasses import replace

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
        inner_m, outer_m: its sides, metres to the left of the centreline.
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
    return list(zip(items[:-1], items[1:], strict=True))


def plane(low: ArrayLike, high: ArrayLike, height_m: float, material: str) -> Mesh:
    """A level rectangle between two corners (x, y), metres; texture coordinates are world metres."""
    (x0, y0), (x1, y1) = np.asarray(low, float), np.asarray(high, float)
    corners = [[x0, y0, height_m], [x1, y0, height_m], [x1, y1, height_m], [x0, y1, height_m]]
    return soup(corners, [[0, 1, 2], [0, 2, 3]], material, uv=np.array(corners)[:, :2])


def hills(
    generator: np.random.Generator, radius_m: float, height_m: float, material: str = "leaf", spread_m: float = 60.0
) -> Mesh:
    """A ring of wooded hills around the origin.

    The skyline is the sum of a smooth profile (random harmonics, amplitude ~ 1/k) and crowns of trees two to
    five metres wide; the slope leans back so that sun and sky light it.

    Args:
        generator: random stream.
        radius_m: of the foot of the hills.
        height_m: mean height of the skyline.
        material: of the slope.
        spread_m: depth of the slope.
    """
    count = int(2 * np.pi * radius_m / 1.6)
    angle = np.arange(count) / count * 2 * np.pi
    profile = np.zeros(count)
    for k in range(2, 40):
        profile += generator.normal() / k * np.cos(k * angle + generator.uniform(0, 2 * np.pi))
    profile = profile / max(profile.std(), 1e-9) * 0.35
    crowns = np.repeat(generator.uniform(0, 1, -(-count // 3)), 3)[:count] + 0.5 * generator.uniform(0, 1, count)
    top = height_m * np.maximum(0.25, 1.0 + profile) + 2.2 * crowns
    levels = np.array([0.0, 0.35, 0.7, 1.0])
    grid = []
    for level in levels:
        radius = radius_m + spread_m * level + (generator.uniform(-2, 2, count) if level > 0 else 0.0)
        z = top * level**0.8 - 1.5 + (generator.uniform(-1, 1, count) * 1.2 if 0 < level < 1 else 0.0)
        grid.append(np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1))
    vertices = np.concatenate(grid)
    i, j = np.meshgrid(np.arange(len(levels) - 1), np.arange(count), indexing="ij")
    a, b = (i * count + j).ravel(), (i * count + (j + 1) % count).ravel()
    faces = np.concatenate([np.stack([a, a + count, b], 1), np.stack([b, a + count, b + count], 1)])
    uv = np.stack([np.tile(angle * radius_m, len(levels)), np.repeat(levels * spread_m, count)], axis=1)
    mesh = soup(vertices, faces, material, uv=uv)
    # wrap-around faces would run the texture backwards through the whole tile
    wrapped = mesh.uv.copy()
    back = wrapped[..., 0].max(axis=1) - wrapped[..., 0].min(axis=1) > np.pi * radius_m
    wrapped[back, :, 0] += np.where(wrapped[back, :, 0] < np.pi * radius_m, 2 * np.pi * radius_m, 0.0)
    return replace(mesh, uv=wrapped.astype(np.float32))
