"""What closes the view: trees behind the houses, woods at the far end, hills on the horizon."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.scenes.layout import cast
from pipeline.scenes.layout.hills import hills
from pipeline.scenes.layout.plan import Key
from pipeline.scenes.layout.road import Road
from pipeline.scenes.layout.site import Footprint, Site
from pipeline.scenes.layout.traffic import Actor, Stance, fixed
from pipeline.scenes.objects.base import SceneObject

_VIEW_RAD = 0.85  # woods are planted this far to either side of the camera's heading


def horizon(key: Key) -> Actor:
    """Wooded hills ahead, 330 to 420 m away."""
    generator = key.stream("hills")
    mesh = hills(generator, float(generator.uniform(330, 420)), float(generator.uniform(12, 26)))
    thing = SceneObject(mesh, kind="hills", tint={"leaf": float(generator.uniform(0.5, 0.9))})
    return fixed("hills", thing, Stance(0.0, 0.0, 0.0, 0.0))


def woods(
    key: Key, name: str, count: int, near_m: float, far_m: float, site: Site, keep: Callable[[float, float], bool]
) -> list[Actor]:
    """Trees scattered over a sector ahead of the origin.

    Args:
        key: of the viewpoint.
        name: of the wood.
        count: trees tried; those on claimed or kept ground are left out.
        near_m: least distance from the origin.
        far_m: largest distance.
        site: claimed ground.
        keep: (x, y) -> whether a tree may stand there.
    """
    generator = key.stream(name)
    actors = []
    for index in range(count):
        angle = generator.uniform(-_VIEW_RAD, _VIEW_RAD)
        distance = np.sqrt(generator.uniform(near_m**2, far_m**2))
        x, y = float(distance * np.cos(angle)), float(distance * np.sin(angle))
        if keep(x, y) and site.free(Footprint(x, y, 0.0, 0.5, 0.5), 0.6):
            actors.append(cast.plant(key, f"{name}-{index}", x, y, size=(0.75, 1.45)))
    return actors


def closing(key: Key, site: Site, road: Road, clear_m: float) -> list[Actor]:
    """Trees behind the gardens of a street and around its far end, and the horizon.

    Args:
        key: of the viewpoint.
        site: where houses are.
        road: kept free, `clear_m` to both sides.
        clear_m: distance from the centreline.
    """

    def keep(x: float, y: float) -> bool:
        s, d = road.locate(x, y)
        return abs(float(d[0])) > clear_m or float(s[0]) > road.last_m - 5.0

    def garden(x: float, y: float) -> bool:
        return keep(x, y) and abs(float(road.locate(x, y)[1][0])) > clear_m + 10.0

    behind = woods(key, "garden-tree", 34, 18.0, 95.0, site, garden)
    end = woods(key, "wood", 50, 95.0, 190.0, site, keep)
    return [*behind, *end, horizon(key)]
