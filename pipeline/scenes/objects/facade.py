"""Walls with recessed windows and doors. Coordinates of a wall: x outwards, y to the right seen from outside, z up."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pipeline.scenes.mesh import Mesh, join
from pipeline.scenes.objects.base import Surface
from pipeline.scenes.objects.brush import Coat, beyond, grating
from pipeline.scenes.shapes import box, boxes, ellipsoid, panels

Array = NDArray[np.float32]
REVEAL_M = 0.13


@dataclass(frozen=True)
class Opening:
    """A hole in a wall.

    Attributes:
        y0, y1: left and right edge, metres.
        z0, z1: lower and upper edge.
        door: a door, else a window.
    """

    y0: float
    y1: float
    z0: float
    z1: float
    door: bool = False


def wall(width_m: float, z0: float, z1: float, openings: list[Opening], material: str, u0: float = 0.0) -> Mesh:
    """A wall in the plane x = 0, centred on y = 0, with rectangular holes; no T-junctions.

    Args:
        width_m: along y.
        z0: lower edge.
        z1: upper edge.
        openings: holes; parts outside the wall are ignored.
        material: its cladding.
        u0: shift of the texture along y, so that two walls do not show the same stones.
    """
    half = width_m / 2
    breaks_y = np.unique([-half, half, *(np.clip(y, -half, half) for o in openings for y in (o.y0, o.y1))])
    breaks_z = np.unique([z0, z1, *(np.clip(z, z0, z1) for o in openings for z in (o.z0, o.z1))])
    cells = []
    for y_low, y_high in pairwise(breaks_y):
        for z_low, z_high in pairwise(breaks_z):
            y, z = (y_low + y_high) / 2, (z_low + z_high) / 2
            if not any(o.y0 < y < o.y1 and o.z0 < z < o.z1 for o in openings):
                cells.append([[y_low, z_low], [y_high, z_low], [y_high, z_high], [y_low, z_high]])
    flat = np.asarray(cells)
    corners = np.concatenate([np.zeros((*flat.shape[:2], 1)), flat], axis=2)
    return panels(corners, material, flat + np.array([u0, 0.0]))


def reveal(opening: Opening, depth_m: float = REVEAL_M) -> Mesh:
    """The four sides of a hole, inwards."""
    o, d = opening, -depth_m
    ring = np.array([[o.y0, o.z0], [o.y1, o.z0], [o.y1, o.z1], [o.y0, o.z1]])
    quads = []
    for begin, end in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        # seen from within the hole
        quads.append([[0, *end], [0, *begin], [d, *begin], [d, *end]])
    return panels(quads, "trim")


def window(
    opening: Opening, panes: tuple[int, int], chance: float, shutter_m: float = 0.0, depth_m: float = REVEAL_M
) -> Mesh:
    """Frame, bars, glass and sill of a window.

    Args:
        opening: its hole.
        panes: across and up.
        chance: in [0, 1): which curtains hang behind; kept as the first local coordinate of the glass.
        shutter_m: width of the open shutters on both sides; 0 for none.
        depth_m: how deep the glass lies behind the wall.
    """
    o, x = opening, -depth_m
    glass = panels([[[x, o.y0, o.z0], [x, o.y1, o.z0], [x, o.y1, o.z1], [x, o.y0, o.z1]]], "window")
    middle = (o.y0 + o.y1) / 2
    local = np.empty_like(glass.position)
    local[..., 0] = chance
    local[..., 1] = (glass.position[..., 1] - middle) / (o.y1 - o.y0)
    local[..., 2] = (glass.position[..., 2] - o.z0) / (o.z1 - o.z0)
    w = 0.055
    low, high = [], []

    def bar(y_low: float, y_high: float, z_low: float, z_high: float) -> None:
        low.append([x - 0.01, y_low, z_low])
        high.append([x + 0.045, y_high, z_high])

    bar(o.y0, o.y1, o.z0, o.z0 + w)
    bar(o.y0, o.y1, o.z1 - w, o.z1)
    bar(o.y0, o.y0 + w, o.z0, o.z1)
    bar(o.y1 - w, o.y1, o.z0, o.z1)
    for part in np.arange(1, panes[0]) / panes[0]:
        y = o.y0 + part * (o.y1 - o.y0)
        bar(y - 0.022, y + 0.022, o.z0, o.z1)
    for part in np.arange(1, panes[1]) / panes[1]:
        # the upper row of panes is the lower one
        z = o.z0 + part**0.8 * (o.z1 - o.z0)
        bar(o.y0, o.y1, z - 0.016, z + 0.016)
    parts = [replace(glass, local=local), boxes(low, high, "trim")]
    parts.append(box((x, o.y0 - 0.08, o.z0 - 0.06), (0.10, o.y1 + 0.08, o.z0), "concrete"))
    if shutter_m > 0:
        for y0, y1 in ((o.y0 - 0.03 - shutter_m, o.y0 - 0.03), (o.y1 + 0.03, o.y1 + 0.03 + shutter_m)):
            parts.append(box((0.0, y0, o.z0 - 0.02), (0.045, y1, o.z1 + 0.02), "shutter"))
            slats = np.arange(o.z0 + 0.08, o.z1 - 0.08, 0.11)
            low_slat = np.stack([np.full(len(slats), 0.04), np.full(len(slats), y0 + 0.06), slats], axis=1)
            parts.append(boxes(low_slat, low_slat + np.array([0.025, y1 - y0 - 0.12, 0.045]), "shutter"))
    return join(parts)


def door(opening: Opening, glazed: bool, depth_m: float = REVEAL_M) -> Mesh:
    """Leaf, frame, handle, step and panels of a door."""
    o, x = opening, -depth_m
    parts = [box((x - 0.05, o.y0, o.z0), (x, o.y1, o.z1), "door")]
    w = 0.07
    low = [[x, o.y0, o.z0], [x, o.y1 - w, o.z0], [x, o.y0, o.z1 - w]]
    high = [[x + 0.06, o.y0 + w, o.z1], [x + 0.06, o.y1, o.z1], [x + 0.06, o.y1, o.z1]]
    parts.append(boxes(low, high, "trim"))
    middle = (o.y0 + o.y1) / 2
    for z_low, z_high in ((o.z0 + 0.15, o.z0 + 0.95), (o.z0 + 1.10, o.z1 - 0.25)):
        if glazed and z_low > o.z0 + 1:
            pane = Opening(middle - 0.28, middle + 0.28, z_low, z_high)
            parts.append(window(pane, (1, 1), 0.99, 0.0, depth_m - 0.004))
        else:
            for y in (middle - 0.20, middle + 0.20):
                parts.append(box((x, y - 0.15, z_low), (x + 0.018, y + 0.15, z_high), "door"))
    parts.append(ellipsoid((x + 0.05, o.y1 - 0.16, o.z0 + 1.0), (0.05, 0.025, 0.025), "chrome", 8, 5))
    steps = max(1, round(o.z0 / 0.17))
    for number in range(steps):
        top = o.z0 * (1 - number / steps)
        parts.append(box((-depth_m, o.y0 - 0.2, -0.3), (0.30 + 0.28 * number, o.y1 + 0.2, top - 0.01), "concrete"))
    return join(parts)


@dataclass(frozen=True)
class WindowPaint:
    """Curtains and darkness behind the panes, in the window's own coordinates (chance, -.5..+.5, 0..1)."""

    def __call__(self, surface: Surface) -> tuple[Array, Array]:
        """Dark rooms; net curtains, drapes, half blinds or nothing, as chance has it."""
        chance, across, up = surface.local.T
        foot = surface.footprint_m
        coat = Coat.plain(len(across), 0.03, 0.08)
        coat.albedo += 0.02 * up
        folds = 0.75 + 0.5 * grating(across * 1.1, 0.09, 0.5, foot)
        net = (chance < 0.30).astype(np.float32)
        coat.lay(net, 0.22 * folds, 0.08)
        drapes = ((chance >= 0.30) & (chance < 0.62)).astype(np.float32)
        opened = 0.24 + 0.16 * np.sin(40 * chance)
        coat.lay(drapes * beyond((np.abs(across) - opened + 0.10 * up) * 1.1, foot), 0.30 * folds, 0.08)
        blind = ((chance >= 0.62) & (chance < 0.78)).astype(np.float32)
        lowered = 0.35 + 0.3 * np.sin(55 * chance)
        slats = 0.30 + 0.2 * grating(up * 1.25, 0.05, 0.4, foot)
        coat.lay(blind * beyond((up - lowered) * 1.25, foot), slats, 0.08)
        return coat.result()
