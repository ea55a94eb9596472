"""Lamps, signs, bins, benches and street trees on pavements and squares."""

from __future__ import annotations

import numpy as np

from pipeline.scenes.layout import cast
from pipeline.scenes.layout.ground import PAVEMENT_M
from pipeline.scenes.layout.plan import Key
from pipeline.scenes.layout.road import Road
from pipeline.scenes.layout.site import Footprint, Site
from pipeline.scenes.layout.traffic import Actor, Stance, fixed
from pipeline.scenes.objects import street_furniture

_LAST_M = 110.0
_SMALL = ("bin", "bollard", "bench", "letter box", "bin")


def furnish(key: Key, road: Road, pavement_m: float, site: Site) -> list[Actor]:
    """Furniture along both pavements of a street: trees or lamps at even distances, small things between.

    Args:
        key: of the viewpoint.
        road: the road.
        pavement_m: width of the pavements.
        site: where people and vehicles are; what stands here is added.
    """
    actors: list[Actor] = []
    for side in (1, -1):
        generator = key.stream("pavement", side)
        step, leafy = float(generator.uniform(14.0, 24.0)), bool(generator.random() < 0.65)
        near, back = side * (road.half_width_m + 0.5), side * (road.half_width_m + pavement_m - 0.3)
        for index, s in enumerate(np.arange(generator.uniform(8.0, 16.0), min(_LAST_M, road.last_m), step)):
            name = f"{'left' if side > 0 else 'right'}-{index}"
            x, y, heading = (float(value) for value in road.at(s, near))
            if not site.claim(Footprint(x, y, heading, 0.25, 0.25), 0.0):
                continue
            if leafy and index % 3 != 2:
                actors.append(cast.plant(key, f"tree-{name}", x, y, PAVEMENT_M, size=(0.55, 0.9)))
            else:
                lamp = street_furniture.make("lamp", key.stream(f"lamp-side{side}"))
                actors.append(fixed(f"lamp-{name}", lamp, Stance(x, y, PAVEMENT_M, heading - side * np.pi / 2)))
            if generator.random() < 0.5:
                kind = str(generator.choice(_SMALL))
                actors += _beside(
                    key, f"{kind}-{name}", kind, road, s + float(generator.uniform(2, 5)), back, side, site
                )
        if generator.random() < 0.7:
            # signs face the traffic of their own side: drivers on the right come from smaller s
            s = float(generator.uniform(9.0, 26.0))
            x, y, heading = (float(value) for value in road.at(s, near))
            if site.claim(Footprint(x, y, heading, 0.35, 0.35)):
                sign = street_furniture.make("sign", key.stream("sign", side))
                yaw = heading + (np.pi if side < 0 else 0.0)
                actors.append(fixed(f"sign-{side}", sign, Stance(x, y, PAVEMENT_M, yaw)))
    return actors


def _beside(key: Key, name: str, kind: str, road: Road, s_m: float, d_m: float, side: int, site: Site) -> list[Actor]:
    """A small thing against the gardens, facing the road."""
    x, y, heading = (float(value) for value in road.at(s_m, d_m))
    placed = cast.stand(
        name,
        street_furniture.make(kind, key.stream(name)),
        site,
        Stance(x, y, PAVEMENT_M, heading - side * np.pi / 2),
        0.1,
    )
    return [] if placed is None else [placed]


def scatter(key: Key, site: Site) -> list[Actor]:
    """A few lamps, benches, bins and bollards around a square."""
    generator = key.stream("furniture")
    actors = []
    for index in range(int(generator.integers(3, 7))):
        kind = str(generator.choice(["lamp", "bench", "bin", "bollard", "letter box", "bench"]))
        name = f"{kind}-{index}"
        x = float(generator.uniform(7.0, 26.0))
        y = float(generator.choice([-1.0, 1.0]) * generator.uniform(0.2, 0.55) * x)
        # benches and lamps look towards the middle of the square
        yaw = float(np.arctan2(-y, 14.0 - x) + generator.normal(0, 0.3))
        placed = cast.stand(name, street_furniture.make(kind, key.stream(name)), site, Stance(x, y, 0.0, yaw))
        if placed is not None:
            actors.append(placed)
    return actors
