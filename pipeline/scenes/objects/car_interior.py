"""What is seen through a car's windows: seats, head rests, dashboard, steering wheel, driver, and light behind.

Rays are followed analytically into a simple cabin (interior mapping, van Dongen 2008), so the inside shifts
rightly against the frame as the camera moves, without any triangles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.scenes.objects.car_body import CarBody

Array = NDArray[np.float32]

_DRIVER_Y_M = 0.37
# What daylight is seen through the windows on the far side, and dark trim, as diffuse albedos of the pane.
_DAYLIGHT = 0.13
_TRIM = 0.012


@dataclass(frozen=True)
class Cabin:
    """The inside of one car.

    Attributes:
        body: its shape.
        driver: whether somebody sits at the wheel.
        seat: albedo of the seats.
        skin: albedo of the driver's face.
        coat: albedo of the driver's clothes.
    """

    body: CarBody
    driver: bool
    seat: float
    skin: float
    coat: float

    def solids(self) -> list[tuple[tuple[float, float, float], tuple[float, float, float], float]]:
        """Ellipsoids in the cabin: centre, half axes, albedo."""
        body = self.body
        belt = float(body.belt_m(0.5))
        head_m = min(body.roof_m - 0.26, belt + 0.36)
        results = []
        for row, along in enumerate(body.type.seats):
            x = float(body.x(along))
            places = (-_DRIVER_Y_M, _DRIVER_Y_M)
            for y in places:
                results.append(((x, y, belt - 0.13), (0.10, 0.25, 0.30), self.seat))
                results.append(((x - 0.03, y, belt + 0.245 + 0.02 * row), (0.05, 0.135, 0.085), self.seat * 0.9))
        if self.driver:
            x = float(body.x(body.type.seats[0])) + 0.13
            results.append(((x, _DRIVER_Y_M, belt - 0.06), (0.15, 0.23, 0.27), self.coat))
            results.append(((x + 0.02, _DRIVER_Y_M, head_m), (0.10, 0.08, 0.125), self.skin))
            results.append(((x - 0.015, _DRIVER_Y_M, head_m + 0.045), (0.10, 0.088, 0.10), 0.03))
        return results

    def look(self, local: Array, view: Array) -> Array:
        """Albedo (K,) that stands for what is seen from points on the glass along unit directions, both (K, 3)."""
        origin = np.asarray(local, np.float32)
        direction = np.asarray(view, np.float32)
        nearest, seen = self._walls(origin, direction)
        for centre, radii, albedo in self.solids():
            scale = np.float32(1.0) / np.asarray(radii, np.float32)
            start = (origin - np.asarray(centre, np.float32)) * scale
            step = direction * scale
            a, b = (step * step).sum(axis=1), (start * step).sum(axis=1)
            inside = b * b - a * ((start * start).sum(axis=1) - 1)
            reach = (-b - np.sqrt(np.maximum(inside, 0))) / a
            hit = (inside > 0) & (reach > 0) & (reach < nearest)
            up = (start[:, 2] + reach * step[:, 2]) * np.float32(0.35) + np.float32(0.65)
            seen = np.where(hit, albedo * up, seen)
            nearest = np.where(hit, reach, nearest)
        return self._steering_wheel(origin, direction, nearest, seen).astype(np.float32)

    def _walls(self, origin: Array, direction: Array) -> tuple[Array, Array]:
        """Distance and albedo of the cabin's shell: dark trim with bright windows."""
        body = self.body
        belt = float(body.belt_m(0.5))
        first, last = body.type.side_glass
        half = 0.44 * body.width_m
        ends = body.x(np.array([first + 0.045, first - 0.02, last + 0.06]))
        x_dash, x_front, x_rear = (float(value) for value in ends)
        with np.errstate(divide="ignore", invalid="ignore"):
            to_side = np.where(direction[:, 1] > 0, half - origin[:, 1], -half - origin[:, 1]) / direction[:, 1]
            to_end = np.where(direction[:, 0] > 0, x_front - origin[:, 0], x_rear - origin[:, 0]) / direction[:, 0]
            to_dash = (belt + 0.03 - origin[:, 2]) / direction[:, 2]
        far = np.float32(9.0)
        to_dash = np.where(np.isfinite(to_dash) & (to_dash > 0), to_dash, far)
        to_side = np.where(np.isfinite(to_side) & (to_side > 0.02), to_side, far)
        to_end = np.where(np.isfinite(to_end) & (to_end > 0.02), to_end, far)
        dash_x = origin[:, 0] + to_dash * direction[:, 0]
        dash = dash_x > x_dash
        reach = np.minimum(to_side, to_end)
        z = origin[:, 2] + reach * direction[:, 2]
        x = origin[:, 0] + reach * direction[:, 0]
        open_ = (z > belt + 0.05) & (z < body.roof_m - 0.14)
        for pillar in body.type.pillars:
            open_ &= ~((np.abs(x - float(body.x(pillar))) < 0.06) & (to_side < to_end))
        seen = np.where(open_, np.float32(_DAYLIGHT), np.float32(_TRIM))
        dash &= to_dash < reach
        return np.where(dash, to_dash, reach).astype(np.float32), np.where(dash, np.float32(0.035), seen)

    def _steering_wheel(self, origin: Array, direction: Array, nearest: Array, seen: Array) -> Array:
        """A dark ring in a tilted plane before the driver."""
        body = self.body
        hub = np.array(
            [float(body.x(body.type.seats[0])) + 0.50, _DRIVER_Y_M, float(body.belt_m(0.4)) + 0.03], np.float32
        )
        axis = np.array([-0.88, 0.0, 0.475], np.float32)
        along = direction @ axis
        reach = ((hub - origin) @ axis) / np.where(np.abs(along) < 1e-4, np.float32(1e-4), along)
        radius = np.linalg.norm(origin + direction * reach[:, None] - hub, axis=1)
        ring = (reach > 0) & (reach < nearest) & (np.abs(radius - 0.175) < 0.018)
        return np.where(ring, np.float32(0.008), seen)
