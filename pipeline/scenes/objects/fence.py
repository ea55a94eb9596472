"""What bounds a garden: picket fences, walls, hedges, iron railings, board fences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError, did_you_mean
from pipeline.scenes.mesh import Mesh, join
from pipeline.scenes.objects.base import SceneObject
from pipeline.scenes.objects.brush import Flat
from pipeline.scenes.objects.foliage import blades
from pipeline.scenes.objects.materials import MATERIALS
from pipeline.scenes.shapes import box, boxes

Array = NDArray[np.float64]


def make(kind: str, length_m: float, generator: np.random.Generator) -> SceneObject:
    """A straight fence from the origin along +x, on z = 0.

    Args:
        kind: one of `KINDS`.
        length_m: its length, > 0.
        generator: random numbers.

    Raises:
        InputError: unknown kind or a length that is not positive.
    """
    if kind not in _MAKERS:
        raise InputError(f"fence kind '{kind}' is unknown; {did_you_mean(kind, _MAKERS)}")
    if not length_m > 0:
        raise InputError(f"fence length_m is {length_m}; it must be above 0")
    tones = generator.random(3)
    tint = {
        "picket": (0.12 + 0.63 * float(tones[0])) / MATERIALS["picket"].albedo,
        "stone": 0.75 + 0.5 * float(tones[1]),
        "brick": 0.75 + 0.5 * float(tones[1]),
        "leaf": (0.09 + 0.08 * float(tones[2])) / MATERIALS["leaf"].albedo,
    }
    return SceneObject(_MAKERS[kind](length_m, generator), None, kind, tint, {"metal": Flat(0.03, 0.05)})


def _picket(length: float, generator: np.random.Generator) -> Mesh:
    high = float(generator.uniform(0.9, 1.15))
    x = np.arange(0.0, max(length - 0.09, 0.01), 0.14)
    top = high + 0.03 * generator.random(len(x))
    zero = np.zeros(len(x))
    low, high_corner = (
        np.stack([x, zero - 0.012, zero + 0.08], axis=1),
        np.stack([x + 0.095, zero + 0.012, top], axis=1),
    )
    slats = _uprights(low, high_corner, generator)
    rails = boxes(
        [[0, 0.012, 0.28], [0, 0.012, high - 0.25]], [[length, 0.05, 0.36], [length, 0.05, high - 0.17]], "picket"
    )
    return join([slats, rails, _posts(length, high + 0.06, 0.05, 2.0, "picket")])


def _board(length: float, generator: np.random.Generator) -> Mesh:
    high = float(generator.uniform(1.4, 1.8))
    x = np.arange(0.0, max(length - 0.14, 0.01), 0.15)
    zero = np.zeros(len(x))
    low, high_corner = (
        np.stack([x, zero - 0.014, zero + 0.05], axis=1),
        np.stack([x + 0.146, zero + 0.010 * generator.random(len(x)), zero + high], axis=1),
    )
    planks = _uprights(low, high_corner, generator)
    cap = box((0, -0.05, high), (length, 0.05, high + 0.04), "picket")
    return join([planks, cap, _posts(length, high + 0.08, 0.06, 2.4, "picket")])


def _uprights(low: Array, high: Array, generator: np.random.Generator) -> Mesh:
    """Upright boards; the grain runs up, and each shows another piece of the texture, between its joints."""
    mesh = boxes(low, high, "picket")
    count = len(low)
    row, start = generator.integers(0, 14, count), generator.uniform(0, 2.8, count)
    each = mesh.position.reshape(count, -1, 3, 3)
    u = each[..., 2] + start[:, None, None]
    v = each[..., 0] - low[:, None, None, 0] + 0.2 * row[:, None, None] + 0.025
    uv = np.stack([u, v], axis=-1).reshape(-1, 3, 2).astype(np.float32)
    return replace(mesh, uv=uv)


def _wall(length: float, generator: np.random.Generator) -> Mesh:
    high = float(generator.uniform(0.8, 1.5))
    clad = "stone" if generator.random() < 0.65 else "brick"
    body = box((0, -0.15, -0.3), (length, 0.15, high), clad)
    cap = box((-0.02, -0.2, high), (length + 0.02, 0.2, high + 0.09), "concrete")
    return join([body, cap])


def _hedge(length: float, generator: np.random.Generator) -> Mesh:
    high, half = float(generator.uniform(1.0, 1.6)), float(generator.uniform(0.32, 0.45))
    count = int(length * (high + half) * 430) + 20
    x = generator.uniform(0, length, count)
    # leaves lie near the two faces and the top of a rounded block
    angle = generator.uniform(0, np.pi, count)
    depth = generator.uniform(0.82, 1.06, count) * (1 + 0.06 * np.sin(5.1 * x) + 0.04 * np.sin(11.7 * x + 1))
    across = np.sign(np.cos(angle)) * np.abs(np.cos(angle)) ** 0.35
    up = np.abs(np.sin(angle)) ** 0.45
    z = np.where(up > 0.9, high * up * depth, high * generator.random(count) ** 0.8)
    y = np.where(up > 0.9, half * generator.uniform(-1, 1, count), half * np.sign(across) * depth)
    outward = np.stack([np.zeros(count), np.where(up > 0.9, 0, np.sign(across)), np.where(up > 0.9, 1.0, 0.15)], axis=1)
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    leaves = blades(generator, np.stack([x, y, np.maximum(z, 0.04)], axis=1), outward, 0.068, 0.5)
    core = box(
        (0.05, -0.86 * half, 0.0), (length - 0.05 if length > 0.2 else length, 0.86 * half, 0.92 * high), "hedge"
    )
    return join([leaves, core])


def _railing(length: float, generator: np.random.Generator) -> Mesh:
    high = float(generator.uniform(0.95, 1.3))
    x = np.arange(0.06, length, 0.12)
    zero = np.zeros(len(x))
    low = np.stack([x - 0.009, zero - 0.009, zero + 0.42], axis=1)
    bars = boxes(low, low + np.array([0.018, 0.018, high - 0.42]), "metal")
    rails = boxes(
        [[0, -0.015, 0.48], [0, -0.015, high - 0.12]], [[length, 0.015, 0.51], [length, 0.015, high - 0.09]], "metal"
    )
    base = box((0, -0.14, -0.3), (length, 0.14, 0.38), "stone" if generator.random() < 0.5 else "brick")
    cap = box((0, -0.17, 0.38), (length, 0.17, 0.44), "concrete")
    return join([bars, rails, base, cap, _posts(length, high + 0.05, 0.03, 2.5, "metal")])


def _posts(length: float, high: float, half: float, step: float, material: str) -> Mesh:
    x = np.linspace(0, length, max(2, int(np.ceil(length / step)) + 1))
    low = np.stack([x - half, np.full(len(x), 0.0), np.zeros(len(x))], axis=1)
    return boxes(low, low + np.array([2 * half, 2 * half, high]), material)


_MAKERS: dict[str, Callable[[float, np.random.Generator], Mesh]] = {
    "picket": _picket,
    "wall": _wall,
    "hedge": _hedge,
    "railing": _railing,
    "board": _board,
}
KINDS = tuple(_MAKERS)
