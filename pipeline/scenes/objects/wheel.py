"""Road wheels: a lathed tyre and a rim whose spokes are painted, so that it can roll."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.scenes.mesh import Mesh, join, rotation
from pipeline.scenes.objects.base import Surface
from pipeline.scenes.objects.brush import Coat, beyond, stripe
from pipeline.scenes.shapes import lathe, mirrored

Array = NDArray[np.float32]
HALF_WIDTH_M = 0.105


def wheel(radius_m: float, roll_rad: float = 0.0, left: bool = True, sides: int = 36) -> Mesh:
    """A wheel about its axle (along y) at the origin, outer side to the left (y > 0) or to the right.

    Local coordinates turn with the wheel: the painted spokes roll.

    Args:
        radius_m: outer radius.
        roll_rad: how far it has rolled forward.
        left: whether it stands on the left of the car.
        sides: vertices around.
    """
    w, r = HALF_WIDTH_M, radius_m
    tyre = lathe(
        [(-w, 0.60 * r), (-w, 0.68 * r), (-w - 0.004, 0.85 * r), (-0.82 * w, 0.965 * r), (-0.6 * w, r), (0.6 * w, r),
         (0.82 * w, 0.965 * r), (w + 0.004, 0.85 * r), (w, 0.68 * r), (w - 0.06, 0.60 * r)],
        "tyre",
        sides,
    )  # fmt: skip
    rim = lathe(
        [(w - 0.06, 0.62 * r), (w, 0.69 * r), (w + 0.004, 0.665 * r), (w - 0.015, 0.63 * r), (w - 0.032, 0.52 * r),
         (w - 0.026, 0.28 * r), (w - 0.012, 0.14 * r), (w - 0.008, 0.02 * r)],
        "rim",
        sides,
    )  # fmt: skip
    whole = join([tyre, rim])
    if not left:
        whole = mirrored(whole)
    turned = whole.turned(rotation(roll_rad, "y"))
    return replace(turned, local=whole.local)


@dataclass(frozen=True)
class RimPaint:
    """Spokes in polar coordinates.

    Attributes:
        radius_m: outer radius of the wheel.
        spokes: number.
        width: part of the circle that spokes cover.
        albedo: of the metal.
        twin: pairs of thin spokes instead of single ones.
    """

    radius_m: float
    spokes: int
    width: float
    albedo: float
    twin: bool

    def __call__(self, surface: Surface) -> tuple[Array, Array]:
        """Metal spokes over a dark wheel well, bolt circle and hub."""
        x, z = surface.local[:, 0], surface.local[:, 2]
        foot = surface.footprint_m
        radius = np.hypot(x, z)
        part = radius / self.radius_m
        turn = np.arctan2(z, x) / (2 * np.pi) * self.spokes
        # arc length from the nearest spoke's middle
        arc = (np.mod(turn, 1) - 0.5) / self.spokes * 2 * np.pi * radius
        half = 0.5 * self.width / self.spokes * 2 * np.pi * radius * (1.25 - 0.45 * part)
        spoke = stripe(arc, half, foot)
        if self.twin:
            spoke = spoke - stripe(arc, 0.30 * half, foot)
        ring = beyond((part - 0.60) * self.radius_m, foot) + beyond((0.19 - part) * self.radius_m, foot)
        metal = np.clip(spoke + ring, 0, 1)
        coat = Coat.plain(len(radius), 0.015, 0.0)
        coat.lay(metal, self.albedo, 0.12)
        coat.lay(stripe(part * self.radius_m - 0.055, 0.006, foot) * 0.7, 0.05)
        coat.lay(beyond(0.026 - part * self.radius_m, foot), 0.08, 0.1)
        return coat.result()
