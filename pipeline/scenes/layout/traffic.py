"""Who moves how: positions, headings and the way travelled (which rolls wheels and moves legs) as functions of time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from pipeline.scenes.layout.road import Road
from pipeline.scenes.objects.base import SceneObject
from pipeline.scenes.world import Placed


@dataclass(frozen=True)
class Stance:
    """Where something is and which way it faces: metres, radians."""

    x_m: float
    y_m: float
    z_m: float
    yaw_rad: float


class Track(Protocol):
    """A course through the scene."""

    @property
    def speed_mps(self) -> float:
        """Speed along the object's own forward direction, m/s."""
        ...

    def at(self, time_s: float) -> Stance:
        """Where the object is at a time."""
        ...


@dataclass(frozen=True)
class Straight:
    """Along a straight line from a stance at t = 0; speed 0 stands still."""

    start: Stance
    speed_mps: float = 0.0

    def at(self, time_s: float) -> Stance:
        way = self.speed_mps * time_s
        start = self.start
        return Stance(
            start.x_m + way * float(np.cos(start.yaw_rad)),
            start.y_m + way * float(np.sin(start.yaw_rad)),
            start.z_m,
            start.yaw_rad,
        )


@dataclass(frozen=True)
class Along:
    """Along a road, at a fixed distance from its centreline.

    Attributes:
        road: the course.
        s_m: position along it at t = 0.
        d_m: to the left of its centreline.
        speed_mps: forward speed.
        against: faces (and moves) towards smaller s.
        z_m: height of the ground.
        turn_rad: constant deviation from the road's heading.
    """

    road: Road
    s_m: float
    d_m: float
    speed_mps: float = 0.0
    against: bool = False
    z_m: float = 0.0
    turn_rad: float = 0.0

    def at(self, time_s: float) -> Stance:
        way = self.speed_mps * time_s * (-1.0 if self.against else 1.0)
        x, y, heading = self.road.at(self.s_m + way, self.d_m)
        return Stance(float(x), float(y), self.z_m, float(heading) + (np.pi if self.against else 0.0) + self.turn_rad)


@dataclass(frozen=True)
class Actor:
    """Something in a scene that has a course and a shape that may depend on the way travelled.

    Attributes:
        name: unique in its scene.
        track: its course.
        shape: way travelled since t = 0, in metres -> the object (the same one, with wheels rolled or legs moved).
        scale: factor on its size.
    """

    name: str
    track: Track
    shape: Callable[[float], SceneObject] = field(repr=False)
    scale: float = 1.0

    def placed(self, time_s: float) -> Placed:
        """The object at a time."""
        stance = self.track.at(time_s)
        thing = self.shape(self.track.speed_mps * time_s)
        return Placed(thing, self.name, stance.yaw_rad, (stance.x_m, stance.y_m, stance.z_m), self.scale)


def fixed(name: str, thing: SceneObject, stance: Stance, scale: float = 1.0) -> Actor:
    """An object that neither moves nor changes."""
    return Actor(name, Straight(stance), lambda _: thing, scale)
