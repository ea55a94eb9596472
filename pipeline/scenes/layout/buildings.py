"""Houses and fences placed along roads and around squares."""

from __future__ import annotations

import numpy as np

from pipeline.scenes.layout.ground import PAVEMENT_M
from pipeline.scenes.layout.plan import Key
from pipeline.scenes.layout.road import Road
from pipeline.scenes.layout.site import Footprint, Site, footprint_of
from pipeline.scenes.layout.traffic import Actor, Stance, fixed
from pipeline.scenes.objects import fence, house

_FENCE_PIECE_M = 7.0


def house_at(
    key: Key, name: str, road: Road, s_m: float, side: int, setback_m: float, site: Site
) -> tuple[Actor | None, float]:
    """A house beside a road, facing it.

    Args:
        key: of the viewpoint.
        name: of the house.
        road: the road.
        s_m: where along the road it begins.
        side: 1 left, -1 right.
        setback_m: from the centreline to its front.
        site: claimed ground; the house's is added.

    Returns:
        the house, or None where it would overlap something, and its width along the road in metres.
    """
    thing = house.make(key.stream(name))
    spread = thing.mesh.position.reshape(-1, 3)
    wide = float(np.ptp(spread[:, 1]))
    front = float(spread[:, 0].max())
    x, y, heading = road.at(s_m + wide / 2, side * (setback_m + front))
    yaw = float(heading) - side * np.pi / 2
    stance = Stance(float(x), float(y), PAVEMENT_M - 0.01, yaw)
    if not site.claim(footprint_of(thing.mesh, stance.x_m, stance.y_m, yaw), 0.2):
        return None, wide
    return fixed(name, thing, stance), wide


def front_fence(key: Key, name: str, road: Road, first_m: float, last_m: float, d_m: float, kind: str) -> list[Actor]:
    """A fence, wall or hedge along a road, in straight pieces that follow its bend."""
    pieces = max(1, round((last_m - first_m) / _FENCE_PIECE_M))
    at = np.linspace(first_m, last_m, pieces + 1)
    x, y, _ = road.at(at, d_m)
    return [
        fence_between(key, f"{name}-{i}", name, (x[i], y[i]), (x[i + 1], y[i + 1]), kind, PAVEMENT_M - 0.01)
        for i in range(pieces)
    ]


def fence_between(
    key: Key, name: str, family: str, begin: tuple[float, float], end: tuple[float, float], kind: str, z_m: float
) -> Actor:
    """A straight fence between two points (x, y); pieces of one family share colours."""
    way = np.subtract(end, begin)
    thing = fence.make(kind, float(np.hypot(*way)), key.stream(family))
    return fixed(name, thing, Stance(float(begin[0]), float(begin[1]), z_m, float(np.arctan2(way[1], way[0]))))


def fence_footprint(begin: tuple[float, float], end: tuple[float, float]) -> Footprint:
    """The ground a fence stands on."""
    way = np.subtract(end, begin)
    middle = np.add(begin, end) / 2
    return Footprint(
        float(middle[0]), float(middle[1]), float(np.arctan2(way[1], way[0])), float(np.hypot(*way)) / 2, 0.25
    )
