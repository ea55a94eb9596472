"""The body and clothes of a person in a pose, as solids."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator

from pipeline.scenes.mesh import Mesh, join, rotation
from pipeline.scenes.objects.figure import ANKLE, HEAD, Figure
from pipeline.scenes.objects.pose import Limb, Pose
from pipeline.scenes.shapes import ellipsoid, loft, tube

Array = NDArray[np.float64]

# Sections of the trunk as parts of the height: above the hips, half width, half depth, shift forward.
_TRUNK = np.array(
    [
        [-0.020, 0.094, 0.070, -0.004],
        [0.030, 0.098, 0.074, -0.006],
        [0.085, 0.088, 0.066, 0.000],
        [0.140, 0.085, 0.062, 0.004],
        [0.200, 0.096, 0.069, 0.004],
        [0.250, 0.101, 0.070, 0.000],
        [0.289, 0.101, 0.060, -0.004],
        [0.316, 0.074, 0.047, -0.004],
        [0.334, 0.046, 0.038, 0.000],
        [0.348, 0.034, 0.034, 0.004],
    ]
)
_WOMAN = np.array([1.03, 1.04, 0.93, 0.90, 0.92, 0.92, 0.90, 0.92, 0.95, 0.90])
# Local coordinates of parts that painters shall leave plain.
_PLAIN = np.float32(-9.0)


def mesh(figure: Figure, pose: Pose) -> Mesh:
    """All solids of a person, joined. Trunk and head carry local coordinates of their own for the painters."""
    parts = [*_trunk(figure, pose), *_head(figure, pose)]
    for side, leg, arm in zip((1, -1), pose.legs, pose.arms, strict=True):
        parts += [*_leg(figure, leg), *_arm(figure, arm, side)]
    if figure.bag != "none":
        parts += _bag(figure, pose)
    return join(parts)


def _plain(mesh: Mesh) -> Mesh:
    return replace(mesh, local=np.full_like(mesh.local, _PLAIN))


def _stack(rows: ArrayLike, material: str, around: int = 22, rings: int = 16) -> Mesh:
    """Loft of rounded sections: rows (M, 4) of height, half width, half depth, shift forward, metres."""
    rows = np.asarray(rows, np.float64)
    height = np.linspace(rows[0, 0], rows[-1, 0], rings)
    width, depth, shift = (PchipInterpolator(rows[:, 0], rows[:, i])(height) for i in (1, 2, 3))
    angle = np.arange(around) / around * 2 * np.pi
    across = np.sign(np.sin(angle)) * np.abs(np.sin(angle)) ** 0.85
    ahead = np.sign(np.cos(angle)) * np.abs(np.cos(angle)) ** 0.85
    sections = np.stack(
        [
            shift[:, None] + depth[:, None] * ahead,
            width[:, None] * across,
            np.repeat(height[:, None], around, axis=1),
        ],
        axis=-1,
    )
    return loft(sections, material)


def _trunk(figure: Figure, pose: Pose) -> list[Mesh]:
    k, b = figure.height_m, figure.build
    turn = rotation(pose.lean_rad, "y")
    rows = _TRUNK.copy()
    rows[:, 1] *= b * (_WOMAN if figure.female else 1.0)
    rows[:, 2] *= b
    rows[:, 3] += 0.012 * (b - 1.0) * 5 * np.exp(-(((rows[:, 0] - 0.10) / 0.08) ** 2))
    if figure.female:
        rows[4:6, 3] += 0.010
        rows[4:6, 2] *= 1.06
    reach = np.tan(min(pose.spread_rad, 0.7))
    parts = []
    if figure.outfit == "coat":
        rows[:, 1:3] *= 1.07
        low = np.array([[-0.125, 0.112, 0.0, 0.0], [-0.060, 0.108, 0.0, 0.0]])
        low[:, 1] *= b
        # the hem must span the stride, else thighs pierce the cloth
        low[:, 2] = np.maximum(0.082 * b, -low[:, 0] * reach + 0.066 * b)
        rows = np.concatenate([low, rows])
    elif figure.outfit == "skirt":
        drop = np.array([0.205, 0.130, 0.060, -0.050])
        skirt = np.stack(
            [-drop, [0.128, 0.120, 0.108, 0.090], np.maximum(drop, 0) * reach + 0.064, np.zeros(4)], axis=1
        )
        parts.append(_plain(_stack(skirt * k, "trousers", rings=8).turned(np.eye(3), pose.pelvis)))
    if figure.outfit != "coat":
        seat = np.array([[-0.080, 0.050, 0.040, -0.010], [-0.030, 0.096, 0.066, -0.010], [0.022, 0.097, 0.072, -0.006]])
        seat[:, 1:3] *= b
        parts.append(_plain(_stack(seat * k, "trousers", rings=6).turned(turn, pose.pelvis)))
    top = _stack(rows * k, "top")
    return [*parts, top.turned(turn, pose.pelvis)]


def _head(figure: Figure, pose: Pose) -> list[Mesh]:
    k = figure.height_m
    turn = rotation(pose.lean_rad, "y")
    upright = rotation(0.25 * pose.lean_rad, "y")
    base = pose.pelvis + turn @ np.array([0.0, 0.0, 0.325 * k])
    top = pose.pelvis + turn @ np.array([0.006 * k, 0.0, (HEAD - 0.055) * k])
    centre = top + upright @ np.array([0.008, 0.0, 0.055]) * k
    neck = _plain(tube([base, top, top + upright @ np.array([0.0, 0.0, 0.02 * k])], 0.031 * k, "skin", 10))

    def at(where: ArrayLike, radii: ArrayLike, material: str, segments: int = 14, rings: int = 9) -> Mesh:
        """An ellipsoid in the coordinates of the head, in parts of the height."""
        solid = ellipsoid(np.asarray(where) * k, np.asarray(radii) * k, material, segments, rings)
        return solid.turned(upright, centre)

    parts = [neck, at((0, 0, 0.006), (0.055, 0.044, 0.058), "skin", 18, 12)]
    parts.append(at((0.010, 0, -0.026), (0.041, 0.035, 0.042), "skin", 14, 9))
    parts.append(at((0.054, 0, -0.008), (0.011, 0.008, 0.013), "skin", 8, 5))
    parts += [at((-0.004, side * 0.044, -0.004), (0.011, 0.006, 0.016), "skin", 8, 5) for side in (1, -1)]
    if figure.hair == "cap":
        parts.append(at((-0.004, 0, 0.024), (0.057, 0.049, 0.046), "bag", 16, 9))
        parts.append(at((0.052, 0, 0.026), (0.040, 0.038, 0.006), "bag", 12, 5))
    if figure.hair != "bald":
        parts.append(at((-0.012, 0, 0.017), (0.051, 0.0475, 0.055), "hair", 18, 11))
    if figure.hair == "long":
        parts.append(at((-0.033, 0, -0.040), (0.032, 0.046, 0.072), "hair", 14, 9))
    if figure.hair == "bun":
        parts.append(at((-0.062, 0, 0.038), (0.024, 0.024, 0.024), "hair", 10, 7))
    return parts


def _leg(figure: Figure, leg: Limb) -> list[Mesh]:
    k, b = figure.height_m, figure.build**0.5
    hip, knee, ankle = leg.root, leg.middle, leg.end
    thigh, shank = knee - hip, ankle - knee
    path = [
        hip - 0.06 * thigh, hip + 0.45 * thigh, hip + 0.85 * thigh, knee,
        knee + 0.18 * shank, knee + 0.40 * shank, ankle - 0.04 * shank,
    ]  # fmt: skip
    # the calf bulges backwards, the shin is straight
    back = np.cross(shank, (0.0, 1.0, 0.0))
    path[5] = path[5] + 0.007 * k * back / np.linalg.norm(back)
    bare = np.array([0.056, 0.050, 0.038, 0.0345, 0.0335, 0.0355, 0.021]) * k * b
    cloth = np.array([0.060, 0.055, 0.0445, 0.0415, 0.0395, 0.0385, 0.034]) * k * b
    parts = []
    if figure.outfit in ("trousers", "coat"):
        parts.append(_plain(tube(path, cloth, "trousers", 14)))
    else:
        parts.append(_plain(tube(path, bare, "skin", 12)))
        if figure.outfit == "shorts":
            parts.append(_plain(tube(path[:3], cloth[:3] * 1.08, "trousers", 14, round_ends=False)))
    turn = rotation(leg.pitch_rad, "y")

    def shoe(where: ArrayLike, radii: ArrayLike, exponent: float) -> Mesh:
        solid = ellipsoid(np.asarray(where) * k, np.asarray(radii) * k, "shoe", 12, 7, exponent=exponent)
        return _plain(solid.turned(turn, ankle))

    parts.append(shoe((0.040, 0, -ANKLE + 0.013), (0.077, 0.028, 0.013), 0.7))
    parts.append(shoe((0.012, 0, -0.012), (0.046, 0.026, 0.022), 1.0))
    return parts


def _arm(figure: Figure, arm: Limb, side: int) -> list[Mesh]:
    k, b = figure.height_m, figure.build
    shoulder, elbow, wrist = arm.root, arm.middle, arm.end
    upper, fore = elbow - shoulder, wrist - elbow
    inwards = np.array([0.0, -side * 0.014 * k, 0.002 * k])
    path = [shoulder + inwards, shoulder + 0.35 * upper, shoulder + 0.75 * upper, elbow, elbow + 0.35 * fore, wrist]
    cloth = np.array([0.034, 0.0355, 0.031, 0.029, 0.027, 0.022]) * k * b
    if figure.outfit == "coat":
        cloth *= 1.1
    if figure.short_sleeves:
        parts = [_plain(tube(path, cloth * np.array([0.8, 0.8, 0.85, 0.85, 0.88, 0.80]), "skin", 10))]
        parts.append(_plain(tube(path[:3], cloth[:3] * 1.03, "top", 12)))
    else:
        parts = [_plain(tube(path, cloth, "top", 12))]
    tilt = float(np.arctan2(-fore[0], -fore[2]))
    palm = wrist + 0.030 * k * fore / np.linalg.norm(fore)
    hand = ellipsoid(palm, np.array([0.021, 0.013, 0.042]) * k, "skin", 10, 7, rotation(tilt, "y"))
    return [*parts, _plain(hand)]


def _bag(figure: Figure, pose: Pose) -> list[Mesh]:
    k, b = figure.height_m, figure.build
    turn = rotation(pose.lean_rad, "y")
    if figure.bag == "backpack":
        pack = ellipsoid(
            (-0.115 * k * b, 0, 0.19 * k), np.array([0.058, 0.085, 0.115]) * k, "bag", 14, 9, exponent=0.55
        )
        over = np.array([[-0.06, 0.060, 0.30], [0.0, 0.066, 0.325], [0.074 * b, 0.062, 0.25], [0.066 * b, 0.075, 0.15]])
        strap = [tube(over * (k, side * k, k), 0.010 * k, "bag", 6) for side in (1, -1)]
        return [_plain(part.turned(turn, pose.pelvis)) for part in (pack, *strap)]
    side = 0.135 * k * b
    body = ellipsoid((0.0, side, -0.02 * k), np.array([0.085, 0.030, 0.065]) * k, "bag", 12, 8, exponent=0.6)
    strap_over = tube(
        [(0.0, side, 0.03 * k), (0.07 * k * b, 0.03 * k, 0.20 * k), (0.02 * k, -0.075 * k, 0.315 * k)],
        0.008 * k,
        "bag",
        6,
    )
    return [_plain(part.turned(turn, pose.pelvis)) for part in (body, strap_over)]
