"""Pitched roofs with eaves: gabled and hipped, and dormers that stand in them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pipeline.scenes.mesh import Mesh, join
from pipeline.scenes.objects.facade import Opening, window
from pipeline.scenes.shapes import box, panel, panels, tube

THICKNESS_M = 0.14
OVERHANG_M = 0.42


def slope(corners: ArrayLike, cover: str, thickness_m: float = THICKNESS_M) -> Mesh:
    """A slab of roof: tiles above, boards below, trim along the edges.

    Args:
        corners: (N, 3) convex, counter-clockwise from above, the first two along the eaves.
        cover: material of the top; its v runs down from the highest corner.
        thickness_m: normal to the slope.
    """
    corners = np.asarray(corners, np.float64)
    along = corners[1] - corners[0]
    along /= np.linalg.norm(along)
    normal = np.cross(along, corners[2] - corners[0])
    normal /= np.linalg.norm(normal)
    uphill = np.cross(normal, along)
    rise = (corners - corners[0]) @ uphill
    uv = np.stack([(corners - corners[0]) @ along, rise.max() - rise], axis=1)
    top = corners + thickness_m * normal
    edges = [[a, b, b_up, a_up] for a, b, b_up, a_up in zip(
        corners, np.roll(corners, -1, axis=0), np.roll(top, -1, axis=0), top, strict=True
    )]  # fmt: skip
    return join([panel(top, cover, uv), panel(corners[::-1], "plank"), panels(edges, "trim")])


def gable(width_m: float, depth_m: float, eaves_m: float, rise_m: float, cover: str) -> list[Mesh]:
    """Two slopes and a ridge along y; gables at y = +-width / 2."""
    half, end = depth_m / 2, width_m / 2 + OVERHANG_M
    out = half + OVERHANG_M
    low = eaves_m - rise_m * OVERHANG_M / half
    ridge = eaves_m + rise_m
    front = [[out, -end, low], [out, end, low], [0, end, ridge], [0, -end, ridge]]
    back = [[-out, end, low], [-out, -end, low], [0, -end, ridge], [0, end, ridge]]
    cap = tube([(0, -end, ridge + 0.13), (0, end, ridge + 0.13)], 0.09, cover, 8, round_ends=False)
    return [slope(front, cover), slope(back, cover), cap, *_gutters(out, end, low)]


def hip(width_m: float, depth_m: float, eaves_m: float, rise_m: float, cover: str, part: float = 0.85) -> list[Mesh]:
    """Four slopes; the ridge is shorter than the house by `part` of its depth."""
    half = depth_m / 2
    steep = rise_m / half
    out, end = half + OVERHANG_M, width_m / 2 + OVERHANG_M
    low, ridge = eaves_m - steep * OVERHANG_M, eaves_m + rise_m
    inner = max(width_m / 2 - part * half, 0.2)
    front = [[out, -end, low], [out, end, low], [0, inner, ridge], [0, -inner, ridge]]
    back = [[-out, end, low], [-out, -end, low], [0, -inner, ridge], [0, inner, ridge]]
    left = [[out, end, low], [-out, end, low], [0, inner, ridge]]
    right = [[-out, -end, low], [out, -end, low], [0, -inner, ridge]]
    parts = [slope(side, cover) for side in (front, back, left, right)]
    lift = np.array([0, 0, 0.13])
    for begin, finish in (((0, -inner, ridge), (0, inner, ridge)), *(
        ((sx * out, sy * end, low), (0, sy * inner, ridge)) for sx in (1, -1) for sy in (1, -1)
    )):  # fmt: skip
        parts.append(tube([begin + lift, finish + lift], 0.085, cover, 8, round_ends=False))
    return [*parts, *_gutters(out, end, low)]


def _gutters(out: float, end: float, low: float) -> list[Mesh]:
    return [
        tube([(side * (out + 0.05), -end, low + 0.03), (side * (out + 0.05), end, low + 0.03)], 0.06, "gutter", 8)
        for side in (1, -1)
    ]


def dormer(
    x_m: float, z_m: float, y_m: float, steep: float, cover: str, clad: str, chance: float, pitched: bool
) -> Mesh:
    """A window standing out of the front slope.

    Args:
        x_m: its front.
        z_m: height of the roof's surface there.
        y_m: its middle.
        steep: slope of the roof, rise over run.
        cover: roofing.
        clad: cladding of its cheeks.
        chance: for the curtains.
        pitched: a small gable, else a lean-to roof.
    """
    half, tall = 0.72, 1.25
    deep = (tall + 0.5) / steep
    parts = [
        box((x_m - deep, y_m - half, z_m - 0.25), (x_m, y_m + half, z_m + tall), clad),
        window(Opening(-0.48, 0.48, 0.22, 1.12), (2, 2), chance, 0.0, -0.03).placed(0.0, (x_m, y_m, z_m)),
    ]
    over, low, top = half + 0.16, z_m + tall - 0.04, z_m + tall + (0.62 if pitched else 0.10)
    front, back = x_m + 0.18, x_m - deep
    if pitched:
        left = [[back, y_m + over, low], [front, y_m + over, low], [front, y_m, top], [back, y_m, top]]
        right = [[front, y_m - over, low], [back, y_m - over, low], [back, y_m, top], [front, y_m, top]]
        parts += [slope(left[:], cover, 0.08)] if _faces_up(left) else [slope(left[::-1], cover, 0.08)]
        parts += [slope(right[:], cover, 0.08)] if _faces_up(right) else [slope(right[::-1], cover, 0.08)]
        parts.append(panel([[x_m, y_m - half, z_m + tall], [x_m, y_m + half, z_m + tall], [x_m, y_m, top]], clad))
    else:
        lean = [[front, y_m - over, low], [front, y_m + over, low], [back, y_m + over, low + 0.3 * deep],
                [back, y_m - over, low + 0.3 * deep]]  # fmt: skip
        parts.append(slope(lean, cover, 0.08))
    return join(parts)


def _faces_up(corners: ArrayLike) -> bool:
    corners = np.asarray(corners, np.float64)
    return bool(np.cross(corners[1] - corners[0], corners[2] - corners[0])[2] > 0)
