"""The course of a road: a smooth curve that houses, cars and people follow."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array64 = NDArray[np.float64]

_STEP_M = 0.5


@dataclass(frozen=True)
class Road:
    """A centreline with coordinates s along it and d to its left; s = 0 is the origin, heading along +x.

    Curvature grows from zero over `ease_m`, as that of built roads does, and then stays:
    ``k(s) = curvature * clip((s - begin) / ease, 0, 1)``, heading its integral, position the integral of the
    heading's unit vector.

    Attributes:
        half_width_m: from the centreline to the kerb.
        curvature_per_m: final curvature; positive bends left, 0 is straight.
        begin_m: where the bend begins.
        ease_m: length over which it sets in.
        first_m, last_m: extent along s.
    """

    half_width_m: float = 5.0
    curvature_per_m: float = 0.0
    begin_m: float = 20.0
    ease_m: float = 30.0
    first_m: float = -40.0
    last_m: float = 260.0

    @cached_property
    def _course(self) -> tuple[Array64, Array64, Array64, Array64]:
        """s, x, y and heading at steps of half a metre."""
        s = np.arange(self.first_m, self.last_m + _STEP_M, _STEP_M)
        curvature = self.curvature_per_m * np.clip((s - self.begin_m) / self.ease_m, 0.0, 1.0)
        heading = np.cumsum(curvature) * _STEP_M
        x, y = np.cumsum(np.cos(heading)) * _STEP_M, np.cumsum(np.sin(heading)) * _STEP_M
        zero = int(np.argmin(np.abs(s)))
        return s, x - x[zero], y - y[zero], heading - heading[zero]

    def at(self, s_m: ArrayLike, d_m: ArrayLike = 0.0) -> tuple[Array64, Array64, Array64]:
        """World position and heading.

        Args:
            s_m: distance along the road, any shape; beyond the ends the last heading is kept.
            d_m: distance to the left of the centreline.

        Returns:
            x, y in metres and heading in radians.
        """
        s_m, d_m = np.asarray(s_m, np.float64), np.asarray(d_m, np.float64)
        s, x, y, heading = self._course
        inside = np.clip(s_m, s[0], s[-1])
        turn = np.interp(inside, s, heading)
        beyond = s_m - inside
        return (
            np.interp(inside, s, x) + beyond * np.cos(turn) - d_m * np.sin(turn),
            np.interp(inside, s, y) + beyond * np.sin(turn) + d_m * np.cos(turn),
            turn,
        )

    def locate(self, x_m: ArrayLike, y_m: ArrayLike) -> tuple[Array64, Array64]:
        """(s, d) of the nearest course point of each world position, by search over the steps."""
        _, x, y, heading = self._course
        s = self._course[0]
        px, py = np.atleast_1d(np.asarray(x_m, np.float64)), np.atleast_1d(np.asarray(y_m, np.float64))
        nearest = np.argmin((px[:, None] - x) ** 2 + (py[:, None] - y) ** 2, axis=1)
        turn = heading[nearest]
        dx, dy = px - x[nearest], py - y[nearest]
        return s[nearest] + dx * np.cos(turn) + dy * np.sin(turn), -dx * np.sin(turn) + dy * np.cos(turn)
