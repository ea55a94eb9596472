"""Wooded hills that close the view: a slope and the crowns that stand on it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pipeline.scenes.mesh import Mesh, join, soup

Array64 = NDArray[np.float64]

_AROUND, _RINGS = 8, 4
_DEPTH_M = 90.0
_CROWN_EVERY_M2 = 38.0


def hills(
    generator: np.random.Generator, radius_m: float, height_m: float, view_rad: float = 1.0, material: str = "leaf"
) -> Mesh:
    """A sector of hills around the origin, centred on the x axis.

    The slope rises over 90 m to a skyline of random harmonics (amplitude ~ 1/k); lumpy crowns of trees, two to
    five metres in radius, cover it. At these distances a crown is a few pixels wide, so it needs few triangles.

    Args:
        generator: random stream.
        radius_m: distance of the foot of the hills.
        height_m: mean height of the skyline.
        view_rad: half the angle covered.
        material: of slope and crowns.
    """
    amplitude = generator.normal(0.0, 1.0, 24) / np.arange(2, 26)
    phase = generator.uniform(0, 2 * np.pi, 24)

    def rise(angle: Array64, depth: Array64) -> Array64:
        waves = sum(a * np.cos((k + 2) * angle + p) for k, (a, p) in enumerate(zip(amplitude, phase, strict=True)))
        skyline = height_m * np.maximum(0.3, 1.0 + 0.6 * np.asarray(waves))
        return np.asarray(skyline * np.sin(np.pi / 2 * np.clip(depth / _DEPTH_M, 0, 1)) - 1.0)

    count = int(2 * view_rad * radius_m * _DEPTH_M / _CROWN_EVERY_M2)
    angle = generator.uniform(-view_rad, view_rad, count)
    depth = _DEPTH_M * generator.random(count)
    size = generator.uniform(2.2, 5.0, count)
    foot = np.stack(
        [(radius_m + depth) * np.cos(angle), (radius_m + depth) * np.sin(angle), rise(angle, depth)], axis=1
    )
    return join([_slope(radius_m, view_rad, rise, material), _crowns(generator, foot, size, material)])


def _slope(radius_m: float, view_rad: float, rise: Callable[[Array64, Array64], Array64], material: str) -> Mesh:
    """The ground under the crowns, facing the origin."""
    angle = np.linspace(-view_rad, view_rad, int(view_rad * 120))
    depth = np.linspace(0.0, _DEPTH_M, 8)
    across, along = np.meshgrid(angle, depth)
    x, y = (radius_m + along) * np.cos(across), (radius_m + along) * np.sin(across)
    vertices = np.stack([x, y, rise(across, along)], axis=-1).reshape(-1, 3)
    columns = len(angle)
    i, j = np.meshgrid(np.arange(len(depth) - 1), np.arange(columns - 1), indexing="ij")
    a = (i * columns + j).ravel()
    faces = np.concatenate([np.stack([a, a + columns, a + 1], 1), np.stack([a + 1, a + columns, a + columns + 1], 1)])
    return soup(vertices, faces, material, uv=np.stack([across * radius_m, along], axis=-1).reshape(-1, 2))


def _crowns(generator: np.random.Generator, foot: Array64, size_m: Array64, material: str) -> Mesh:
    """Lumpy half ellipsoids, one per foot point."""
    count = len(foot)
    polar = np.linspace(0.12, np.pi * 0.62, _RINGS)
    turn = np.arange(_AROUND) / _AROUND * 2 * np.pi
    unit = np.stack(
        [np.outer(np.sin(polar), np.cos(turn)), np.outer(np.sin(polar), np.sin(turn)),
         np.repeat(np.cos(polar)[:, None], _AROUND, axis=1)], axis=-1
    ).reshape(-1, 3)  # fmt: skip
    lumps = 1.0 + 0.22 * generator.standard_normal((count, len(unit), 1))
    stretch = np.stack([np.ones(count), np.ones(count), generator.uniform(0.9, 1.7, count)], axis=1)
    vertices = (
        foot[:, None] + [0.0, 0.0, 1.0] * size_m[:, None, None] + unit * lumps * (size_m[:, None] * stretch)[:, None]
    )
    normals = unit / stretch[:, None]
    normals = normals + 0.3 * generator.standard_normal(normals.shape)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    i, j = np.meshgrid(np.arange(_RINGS - 1), np.arange(_AROUND), indexing="ij")
    a, b = (i * _AROUND + j).ravel(), (i * _AROUND + (j + 1) % _AROUND).ravel()
    ring = np.concatenate([np.stack([a, a + _AROUND, b], 1), np.stack([b, a + _AROUND, b + _AROUND], 1)])
    top = np.stack([np.zeros(_AROUND - 2, int), np.arange(1, _AROUND - 1), np.arange(2, _AROUND)], axis=1)
    faces = np.concatenate([ring, top])
    every = (faces[None] + (np.arange(count) * len(unit))[:, None, None]).reshape(-1, 3)
    uv = generator.uniform(0, 6, (count, 1, 2)) + unit[None, :, :2] * size_m[:, None, None]
    return soup(vertices.reshape(-1, 3), every, material, normals.reshape(-1, 3), uv.reshape(-1, 2))
