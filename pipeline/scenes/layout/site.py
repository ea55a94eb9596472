"""Who stands where: footprints on the ground, and the rule that they do not overlap."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.scenes.mesh import Mesh


@dataclass(frozen=True)
class Footprint:
    """An oriented rectangle on the ground, metres and radians."""

    x_m: float
    y_m: float
    yaw_rad: float
    half_length_m: float
    half_width_m: float

    def axes(self) -> NDArray[np.float64]:
        """(2, 2) unit vectors along length and width."""
        c, s = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        return np.array([[c, s], [-s, c]])

    def corners(self) -> NDArray[np.float64]:
        """(4, 2) corners."""
        signs = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]])
        return np.array([self.x_m, self.y_m]) + signs * [self.half_length_m, self.half_width_m] @ self.axes()

    def grown(self, by_m: float) -> Footprint:
        """The same with every side moved out."""
        return replace(self, half_length_m=self.half_length_m + by_m, half_width_m=self.half_width_m + by_m)

    def overlaps(self, other: Footprint) -> bool:
        """Whether two rectangles share area: no side of either separates them (separating axis theorem)."""
        mine, theirs = self.corners(), other.corners()
        for axis in np.concatenate([self.axes(), other.axes()]):
            a, b = mine @ axis, theirs @ axis
            if a.max() <= b.min() or b.max() <= a.min():
                return False
        return True


def footprint_of(mesh: Mesh, x_m: float, y_m: float, yaw_rad: float, scale: float = 1.0) -> Footprint:
    """The rectangle around a mesh (in its own coordinates) after it is placed."""
    low = mesh.position[..., :2].reshape(-1, 2).min(axis=0).astype(np.float64) * scale
    high = mesh.position[..., :2].reshape(-1, 2).max(axis=0).astype(np.float64) * scale
    middle, half = (low + high) / 2, (high - low) / 2
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    return Footprint(
        x_m + c * middle[0] - s * middle[1],
        y_m + s * middle[0] + c * middle[1],
        yaw_rad,
        float(half[0]),
        float(half[1]),
    )


class Site:
    """Footprints claimed so far."""

    def __init__(self) -> None:
        self.claimed: list[Footprint] = []

    def block(self, taken: Footprint) -> None:
        """Take a footprint whatever stands there (roads, the camera's own place)."""
        self.claimed.append(taken)

    def free(self, wanted: Footprint, gap_m: float = 0.0) -> bool:
        """Whether a footprint keeps at least about `gap_m` from all claimed ones."""
        grown = wanted.grown(gap_m)
        return not any(grown.overlaps(other) for other in self.claimed)

    def claim(self, wanted: Footprint, gap_m: float = 0.0) -> bool:
        """Take a footprint if it is free; returns whether it was."""
        if not self.free(wanted, gap_m):
            return False
        self.claimed.append(wanted)
        return True
