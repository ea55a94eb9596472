"""Lamp posts, road signs, bollards, bins, benches, letter boxes and kerbs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError, did_you_mean
from pipeline.scenes.mesh import Mesh, join
from pipeline.scenes.objects.base import SceneObject, Surface
from pipeline.scenes.objects.brush import Coat, Flat, beyond, stripe
from pipeline.scenes.objects.materials import MATERIALS
from pipeline.scenes.shapes import box, boxes, ellipsoid, lathe, loft, tube

Array = NDArray[np.float32]
SIGNS = ("stop", "yield", "limit", "priority", "parking", "no entry")
_SIGN_M = 0.32


def make(kind: str, generator: np.random.Generator) -> SceneObject:
    """A piece of furniture at the origin on z = 0; what has a front (signs, benches, lamps' arms) looks to +x.

    Args:
        kind: one of `KINDS`.
        generator: random numbers.

    Raises:
        InputError: no such kind.
    """
    if kind not in _MAKERS:
        raise InputError(f"street furniture '{kind}' is unknown; {did_you_mean(kind, _MAKERS)}")
    return _MAKERS[kind](generator)


def kerb(length_m: float) -> SceneObject:
    """A kerb of 15 x 12 cm along +x, its road side at y = 0 and the pavement to the left, stones of one metre."""
    edges = np.append(np.arange(0.0, length_m, 1.0), length_m)
    low = np.stack([edges[:-1] + 0.004, np.zeros(len(edges) - 1), np.full(len(edges) - 1, -0.2)], axis=1)
    high = np.stack([edges[1:] - 0.004, np.full(len(edges) - 1, 0.15), np.full(len(edges) - 1, 0.12)], axis=1)
    return SceneObject(boxes(low, high, "concrete"), None, "kerb")


def _lamp(generator: np.random.Generator) -> SceneObject:
    modern, tall = bool(generator.random() < 0.6), float(generator.uniform(4.6, 6.8))
    if modern:
        arm = tube([(0, 0, 0), (0, 0, 0.7 * tall), (0.05, 0, 0.92 * tall), (0.45, 0, tall), (1.15, 0, tall + 0.08)],
                   [0.085, 0.065, 0.055, 0.045, 0.04], "metal", 10)  # fmt: skip
        head = ellipsoid((1.35, 0, tall + 0.08), (0.36, 0.13, 0.06), "metal", 12, 7, exponent=0.8)
        lens = ellipsoid((1.37, 0, tall + 0.05), (0.28, 0.10, 0.05), "lens", 12, 7)
        mesh = join([arm, head, lens])
    else:
        tall *= 0.7
        post = _turned(
            [(0, 0.14), (0.25, 0.13), (0.35, 0.075), (0.9, 0.06), (0.95, 0.08), (1.0, 0.05), (tall, 0.04)], "metal"
        )
        lantern = _turned([(tall, 0.06), (tall + 0.06, 0.12), (tall + 0.42, 0.20), (tall + 0.44, 0.20)], "lens")
        hat = _turned([(tall + 0.43, 0.24), (tall + 0.58, 0.10), (tall + 0.66, 0.03), (tall + 0.74, 0.02)], "metal")
        mesh = join([post, lantern, hat])
    return SceneObject(mesh, None, "lamp", {}, {"metal": Flat(float(generator.choice([0.04, 0.10, 0.35])), 0.06)})


def _turned(profile: list[tuple[float, float]], material: str, sides: int = 14) -> Mesh:
    """A lathed body with its axis upright: pairs of height and radius."""
    lying = lathe(profile, material, sides)
    return lying.turned(np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], np.float32)).as_local()


def _sign(generator: np.random.Generator) -> SceneObject:
    kind = SIGNS[int(generator.integers(len(SIGNS)))]
    tall, number = float(generator.uniform(2.1, 2.5)), int(generator.integers(3, 8))
    post = tube([(-0.035, 0, 0), (-0.035, 0, tall + 0.55)], 0.03, "metal", 8)
    angle = _outline(kind)
    face = np.stack([np.zeros(len(angle)), angle[:, 0], angle[:, 1]], axis=1) * _SIGN_M
    thin = np.array([0.008, 0, 0])
    plate = loft(np.stack([face - thin, face + thin]), "sign")
    flat = plate.position[:, 1:, :] - plate.position[:, :1, :]
    normal = np.cross(flat[:, 0], flat[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    plate = Mesh(
        plate.position, np.repeat(normal[:, None], 3, axis=1), plate.local, plate.uv, plate.material, plate.materials
    )
    mesh = join([post, plate.placed(0.0, (0.0, 0.0, tall + 0.25))])
    return SceneObject(mesh, None, f"sign: {kind}", {}, {"metal": Flat(0.30, 0.08), "sign": SignPaint(kind, number)})


def _outline(kind: str) -> Array:
    """(N, 2) outline of a sign, unit radius, counter-clockwise."""
    sides, turn = {
        "stop": (8, np.pi / 8),
        "yield": (3, -np.pi / 2),
        "priority": (4, 0.0),
        "parking": (4, np.pi / 4),
    }.get(kind, (28, 0.0))
    angle = turn + np.arange(sides) / sides * 2 * np.pi
    return np.stack([np.cos(angle), np.sin(angle)], axis=1).astype(np.float32)


@dataclass(frozen=True)
class SignPaint:
    """The picture on a road sign, in coordinates of its plate (radius .32 m).

    Attributes:
        kind: one of `SIGNS`.
        number: tens of km/h of a limit.
    """

    kind: str
    number: int

    def __call__(self, surface: Surface) -> tuple[Array, Array]:
        """Grey tones of the usual colours: red .14, blue .10, yellow .55, white .75; the back is metal."""
        y, z = surface.local[:, 1] / _SIGN_M, surface.local[:, 2] / _SIGN_M
        foot = surface.footprint_m / np.float32(_SIGN_M)
        coat = Coat.plain(len(y), 0.30, 0.06)
        front = (surface.normal[:, 0] > 0.5).astype(np.float32)
        radius = np.hypot(y, z)
        if self.kind == "stop":
            coat.lay(front, 0.14, 0.03)
            letters = stripe(z, 0.22, foot) * beyond(0.66 - np.abs(y), foot)
            gaps = stripe(np.mod(y + 0.66, 0.33) - 0.165, 0.115, foot) - 0.55 * stripe(
                np.mod(y + 0.66, 0.33) - 0.165, 0.05, foot
            )
            coat.lay(front * letters * gaps, 0.75, 0.03)
        elif self.kind == "yield":
            inner = np.minimum(0.5 - z, np.minimum(0.866 * y + 0.5 * z, -0.866 * y + 0.5 * z) + 0.5)
            coat.lay(front, 0.14, 0.03)
            coat.lay(front * beyond(inner - 0.17, foot), 0.75, 0.03)
        elif self.kind == "priority":
            square = np.abs(y) + np.abs(z)
            coat.lay(front, 0.75, 0.03)
            coat.lay(front * beyond(0.62 - square, foot), 0.50, 0.03)
        elif self.kind == "parking":
            coat.lay(front, 0.10, 0.03)
            stem = stripe(y + 0.18, 0.07, foot) * beyond(0.45 - np.abs(z), foot)
            bow = stripe(np.hypot(y + 0.12, z - 0.2) - 0.2, 0.065, foot) * beyond(y + 0.12, foot)
            coat.lay(front * np.maximum(stem, bow), 0.75, 0.03)
        elif self.kind == "no entry":
            coat.lay(front, 0.14, 0.03)
            coat.lay(front * stripe(z, 0.14, foot) * beyond(0.7 - np.abs(y), foot), 0.75, 0.03)
        else:
            coat.lay(front, 0.14, 0.03)
            coat.lay(front * beyond(0.74 - radius, foot), 0.75, 0.03)
            zero = stripe(np.hypot((y - 0.26) * 1.5, z) - 0.30, 0.085, foot)
            bend = 0.30 if self.number % 2 else 0.24
            digit = np.maximum(
                stripe(np.hypot((y + 0.28) * 1.4, z + 0.15) - 0.2, 0.075, foot),
                stripe(np.hypot((y + 0.28) * 1.4, z - 0.5 * bend) - 0.5 * bend, 0.075, foot),
            )
            coat.lay(front * np.maximum(zero, digit), 0.03, 0.03)
        return coat.result()


def _bollard(generator: np.random.Generator) -> SceneObject:
    tall = float(generator.uniform(0.75, 1.0))
    body = _turned(
        [(0, 0.09), (0.06, 0.075), (tall - 0.12, 0.06), (tall - 0.11, 0.075), (tall - 0.05, 0.075), (tall, 0.03)],
        "metal",
    )
    band = _turned([(tall - 0.24, 0.066), (tall - 0.16, 0.066)], "lens")
    return SceneObject(
        join([body, band]), None, "bollard", {}, {"metal": Flat(float(generator.choice([0.03, 0.25])), 0.05)}
    )


def _bin(generator: np.random.Generator) -> SceneObject:
    """A wheeled bin."""
    tone = float(generator.choice([0.03, 0.06, 0.14, 0.25]))
    rings = [(0.02, 0.20, 0.22), (0.08, 0.21, 0.24), (0.98, 0.28, 0.28), (1.0, 0.30, 0.30)]
    outline = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]], float)
    sections = np.array([[[*(corner * (half_x, half_y)), z] for corner in outline] for z, half_x, half_y in rings])
    lid = box((-0.31, -0.31, 1.0), (0.33, 0.31, 1.07), "bin")
    wheels = [
        lathe([(-0.03, 0.02), (-0.03, 0.10), (0.03, 0.10), (0.03, 0.02)], "black", 16).placed(0.0, (-0.22, y, 0.10))
        for y in (-0.27, 0.27)
    ]
    mesh = join(
        [_flat(loft(sections, "bin")), lid, *wheels, tube([(-0.36, -0.2, 0.98), (-0.36, 0.2, 0.98)], 0.018, "bin", 6)]
    )
    mesh = mesh.placed(scale=float(generator.uniform(0.92, 1.08))).as_local()
    return SceneObject(mesh, None, "bin", {"bin": tone / MATERIALS["bin"].albedo}, {"bin": Flat(tone, 0.04)})


def _flat(mesh: Mesh) -> Mesh:
    """Flat shading."""
    cross = np.cross(mesh.position[:, 1] - mesh.position[:, 0], mesh.position[:, 2] - mesh.position[:, 0])
    cross /= np.linalg.norm(cross, axis=1, keepdims=True)
    return Mesh(mesh.position, np.repeat(cross[:, None], 3, axis=1), mesh.local, mesh.uv, mesh.material, mesh.materials)


def _bench(generator: np.random.Generator) -> SceneObject:
    half = float(generator.uniform(0.75, 0.95))
    seat = boxes(
        [[x, -half, 0.43] for x in (-0.2, -0.07, 0.06)], [[x + 0.11, half, 0.47] for x in (-0.2, -0.07, 0.06)], "bench"
    )
    back = boxes([[-0.27, -half, z] for z in (0.58, 0.72)], [[-0.23, half, z + 0.11] for z in (0.58, 0.72)], "bench")
    legs = [
        tube([(0.14, y, 0), (0.12, y, 0.42), (-0.2, y, 0.42), (-0.28, y, 0.85)], 0.025, "metal", 6)
        for y in (-0.7 * half, 0.7 * half)
    ]
    legs += [tube([(-0.22, y, 0), (-0.18, y, 0.42)], 0.025, "metal", 6) for y in (-0.7 * half, 0.7 * half)]
    return SceneObject(
        join([seat, back, *legs]),
        None,
        "bench",
        {"bench": float(generator.uniform(0.3, 1.3))},
        {"metal": Flat(0.04, 0.05)},
    )


def _letter_box(generator: np.random.Generator) -> SceneObject:
    wide = float(generator.uniform(0.16, 0.24))
    post = tube([(0, 0, 0), (0, 0, 1.0)], 0.04, "metal", 8)
    case = box((-0.16, -wide, 0.95), (0.16, wide, 1.45), "bin")
    slot = box((0.155, 0.06 - wide, 1.30), (0.168, wide - 0.06, 1.34), "black")
    tone = float(generator.choice([0.12, 0.45]))
    return SceneObject(
        join([post, case, slot]),
        None,
        "letter box",
        {"bin": tone / MATERIALS["bin"].albedo},
        {"bin": Flat(tone, 0.05), "metal": Flat(0.05, 0.05)},
    )


_MAKERS: dict[str, Callable[[np.random.Generator], SceneObject]] = {
    "lamp": _lamp,
    "sign": _sign,
    "bollard": _bollard,
    "bin": _bin,
    "bench": _bench,
    "letter box": _letter_box,
}
KINDS = tuple(_MAKERS)
