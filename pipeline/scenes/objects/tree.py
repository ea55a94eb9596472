"""Trees: trunk, branches that reach for the envelope of a crown, twigs, and leaves in tufts on the twigs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError, did_you_mean
from pipeline.scenes.mesh import Mesh, join
from pipeline.scenes.objects.base import SceneObject
from pipeline.scenes.objects.foliage import blades
from pipeline.scenes.objects.materials import MATERIALS
from pipeline.scenes.shapes import tube

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Species:
    """How a tree grows. Lengths are parts of its height.

    Attributes:
        height_m: lowest and highest.
        bare: height of the lowest branches.
        radius: largest radius of the crown.
        widest: where in the crown (0 bottom, 1 top) it is widest.
        steep_rad: elevation of the branches at the bottom and at the top.
        branches: number.
        tuft: radius of a tuft of leaves.
        leaf: factor on the size of leaves.
        width: of a leaf over its length.
        hang: how much leaves hang.
        tone: mean albedo of a leaf.
    """

    height_m: tuple[float, float]
    bare: float
    radius: float
    widest: float
    steep_rad: tuple[float, float]
    branches: int
    tuft: float
    leaf: float
    width: float
    hang: float
    tone: tuple[float, float]


SPECIES: dict[str, Species] = {
    "maple": Species((7.5, 11.0), 0.24, 0.29, 0.42, (0.30, 1.05), 24, 0.085, 1.0, 0.52, 0.2, (0.11, 0.20)),
    "oak": Species((8.0, 12.0), 0.22, 0.35, 0.40, (0.15, 1.0), 26, 0.085, 1.1, 0.46, 0.1, (0.10, 0.17)),
    "birch": Species((9.0, 14.0), 0.26, 0.22, 0.38, (0.55, 1.15), 22, 0.060, 0.85, 0.50, 0.9, (0.15, 0.24)),
    "poplar": Species((11.0, 16.0), 0.12, 0.13, 0.45, (1.0, 1.25), 26, 0.050, 0.9, 0.60, 0.3, (0.11, 0.19)),
    "spruce": Species((9.0, 15.0), 0.08, 0.19, 0.02, (-0.25, 0.50), 48, 0.040, 1.15, 0.26, 0.5, (0.06, 0.11)),
}
_SHARES = {"maple": 0.32, "oak": 0.28, "birch": 0.18, "poplar": 0.07, "spruce": 0.15}


def make(generator: np.random.Generator, far: bool = False, species: str | None = None) -> SceneObject:
    """A tree on z = 0 at the origin.

    Args:
        generator: random numbers.
        far: few large leaves, for distances beyond about 40 m (11 k instead of 34 k triangles).
        species: one of `SPECIES`; drawn if None.

    Raises:
        InputError: no such species.
    """
    drawn = str(generator.choice(list(_SHARES), p=list(_SHARES.values())))
    name = drawn if species is None else species
    if name not in SPECIES:
        raise InputError(f"tree species '{name}' is unknown; {did_you_mean(name, SPECIES)}")
    kind = SPECIES[name]
    height = float(generator.uniform(*kind.height_m))
    trunk = _trunk(generator, height, 0.75 if name in ("maple", "oak") else 0.97)
    thick = height * 0.021 * float(generator.uniform(0.85, 1.25))
    taper = np.linspace(1.1, 0.12 if len(trunk) else 0.3, len(trunk)) * thick
    taper[0] *= 1.45
    parts = [tube(trunk, taper, "bark", 12 if not far else 7, round_ends=False)]
    twigs = []
    for number in range(kind.branches):
        branch, tips = _branch(generator, kind, height, trunk, number)
        where = float(np.clip(branch[0, 2] / trunk[-1, 2], 0, 1))
        base = thick * (0.42 - 0.24 * where)
        parts.append(tube(branch, [base, 0.6 * base, 0.2 * base], "bark", 6 if not far else 4, round_ends=False))
        for begin, end in tips:
            if not far:
                parts.append(tube([begin, end], [0.24 * base, 0.08 * base], "bark", 4, round_ends=False))
            twigs.append((begin, end))
        twigs.append((branch[1], branch[2]))
    twigs.append((trunk[-2], trunk[-1]))
    leaves = _leaves(generator, kind, height, np.asarray(twigs), far)
    tone = float(generator.uniform(*kind.tone)) / MATERIALS["leaf"].albedo
    return SceneObject(
        join([*parts, leaves]),
        None,
        name,
        {"leaf": tone, "bark": 2.6 if name == "birch" else float(generator.uniform(0.7, 1.3))},
    )


def _trunk(generator: np.random.Generator, height: float, part: float) -> Array:
    """A slightly bent line from below the ground to `part` of the height."""
    rise = np.linspace(0, part * height, 8)
    bend = np.cumsum(generator.normal(0, 0.007, (8, 2)), axis=0) * height
    bend -= bend[0]
    line = np.column_stack([bend, rise])
    line[0, 2] = -0.3
    return line


def _crown_radius(kind: Species, level: float) -> float:
    """Radius of the crown at a level in it (0 bottom, 1 top), as a part of the largest: two half ellipses."""
    if level < kind.widest:
        return float(np.sqrt(max(1 - ((kind.widest - level) / max(kind.widest, 0.05) * 0.85) ** 2, 0.02)))
    across = (level - kind.widest) / (1 - kind.widest)
    # conifers are cones, broad crowns are round
    return float(max(1 - across, 0.03) if kind.widest < 0.1 else np.sqrt(max(1 - across**2, 0.02)))


def _branch(
    generator: np.random.Generator, kind: Species, height: float, trunk: Array, number: int
) -> tuple[Array, list[tuple[Array, Array]]]:
    """A bent branch (3, 3) and its twigs; azimuths follow the golden angle."""
    level = (number + float(generator.uniform(0.1, 0.9))) / kind.branches
    rise = kind.bare + (0.97 - kind.bare) * level
    steep = kind.steep_rad[0] + (kind.steep_rad[1] - kind.steep_rad[0]) * level + float(generator.normal(0, 0.12))
    azimuth = 2.39996 * number + float(generator.normal(0, 0.25))
    long = kind.radius * height * _crown_radius(kind, level) * float(generator.uniform(0.72, 1.08))
    reach = long / max(np.cos(steep), 0.45)
    # a steep branch starts lower, so that its end is on the level meant
    start = np.clip(rise * height - 0.6 * reach * np.sin(steep), 0.8 * kind.bare * height, trunk[-1, 2] * 0.99)
    foot = np.array([np.interp(start, trunk[:, 2], trunk[:, axis]) for axis in range(3)])
    ahead = np.array([np.cos(azimuth) * np.cos(steep), np.sin(azimuth) * np.cos(steep), np.sin(steep)])
    sag = np.array([0, 0, -0.05 * reach * (1 + kind.hang)])
    branch = np.stack([foot, foot + 0.55 * reach * ahead + 0.3 * sag, foot + reach * ahead + sag])
    twigs = []
    for part in (0.3, 0.5, 0.68, 0.85):
        begin = foot + part * reach * ahead + part * sag
        way = ahead + generator.normal(0, 0.55, 3)
        way /= np.linalg.norm(way)
        twigs.append((begin, begin + way * reach * float(generator.uniform(0.22, 0.42))))
    return branch, twigs


def _leaves(generator: np.random.Generator, kind: Species, height: float, twigs: Array, far: bool) -> Mesh:
    """Leaves in tufts along the outer part of the twigs (T, 2, 3)."""
    count, length = (4700, 0.23) if far else (14500, 0.105)
    length *= kind.leaf * (height / 10.0) ** 0.5
    which = generator.integers(len(twigs), size=count)
    part = generator.random(count) ** 0.6
    on_twig = twigs[which, 0] + (twigs[which, 1] - twigs[which, 0]) * part[:, None]
    spread = _ball(generator, count) * (kind.tuft * height * generator.uniform(0.7, 1.2, len(twigs)))[which, None]
    spread *= [1.15, 1.15, 0.85]
    if kind.hang > 0.4:
        spread[:, 2] -= 0.5 * kind.tuft * height * generator.random(count)
    centres = on_twig + spread
    centres[:, 2] = np.maximum(centres[:, 2], 0.35)
    axis = np.zeros_like(centres)
    axis[:, :2] = twigs[:, 0, :2].mean(axis=0)
    axis[:, 2] = np.clip(centres[:, 2] - 0.15 * height, kind.bare * height, 0.75 * height)
    outward = centres - axis
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    tufted = spread / np.maximum(np.linalg.norm(spread, axis=1, keepdims=True), 1e-9)
    outward = 0.7 * outward + 0.5 * tufted
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    return blades(generator, centres, outward, length, kind.width, hang=kind.hang)


def _ball(generator: np.random.Generator, count: int) -> Array:
    """Points in a unit ball, denser towards its surface."""
    way = generator.normal(0, 1, (count, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    return np.asarray(way * generator.random(count)[:, None] ** 0.45)
