"""A street with kerbs, pavements, gardens and houses on both sides; straight or bending out of sight."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.scenes.layout import cast
from pipeline.scenes.layout.backdrop import closing
from pipeline.scenes.layout.buildings import front_fence, house_at
from pipeline.scenes.layout.furniture import furnish
from pipeline.scenes.layout.ground import PAVEMENT_M, kerb, plane, ribbon
from pipeline.scenes.layout.ground_paint import RoadPaint, SoilPaint
from pipeline.scenes.layout.plan import Camera, Key, Plan, weather
from pipeline.scenes.layout.road import Road
from pipeline.scenes.layout.site import Footprint, Site
from pipeline.scenes.layout.traffic import Actor, Along, Stance, Straight, Track, fixed
from pipeline.scenes.mesh import join
from pipeline.scenes.objects.base import SceneObject

_LANE_M = 1.75
_GARDEN_M = 30.0
_BUILT_TO_M = 105.0
_PARKED, _MOVING, _PEOPLE, _PARKED_BIKES, _RIDERS = (6, 9), (1, 3), (5, 8), (1, 2), (0, 2)


@dataclass(frozen=True)
class _Width:
    """Cross section: pavement beside the road, on both sides."""

    road: Road
    pavement_m: float

    @property
    def wall_m(self) -> float:
        """From the centreline to the back of the pavement."""
        return self.road.half_width_m + self.pavement_m


def street(key: Key) -> Plan:
    """Plan of a street.

    Args:
        key: random streams of the viewpoint.
    """
    shape = key.stream("street")
    road = _course(shape)
    width = _Width(road, float(shape.uniform(1.9, 2.7)))
    crossing = float(shape.uniform(11.0, 19.0)) if shape.random() < 0.5 else None
    plots, ways = Site(), Site()  # where houses and gardens are; where people and vehicles are
    camera = _camera(key, road)
    actors = _ground(key, width, crossing)
    actors += _houses(key, width, plots)
    actors += furnish(key, road, width.pavement_m, ways)
    actors += _traffic(key, width, ways)
    actors += _people(key, width, ways, crossing)
    actors += closing(key, plots, road, width.wall_m + 3.0)
    light, tone = weather(key, camera.track.at(0.0).yaw_rad + camera.turn_rad)
    return Plan(tuple(actors), camera, light, tone)


def _course(shape: np.random.Generator) -> Road:
    """Straight in two streets of five, else a bend of 70 to 220 m radius."""
    half = float(shape.uniform(4.6, 5.6))
    if shape.random() < 0.4:
        return Road(half)
    bend = float(shape.choice([-1.0, 1.0]) / shape.uniform(70.0, 220.0))
    return Road(half, bend, float(shape.uniform(5.0, 35.0)), 25.0, last_m=180.0)


def _camera(key: Key, road: Road) -> Camera:
    generator = key.stream("camera")
    track = Along(road, float(generator.uniform(-2, 1)), float(-generator.uniform(0.6, 2.4)), 5.0)
    return Camera(
        track,
        height_m=float(generator.uniform(1.35, 2.1)),
        turn_rad=float(generator.normal(0.0, 0.09) + np.sign(road.curvature_per_m) * 0.06),
        pitch_rad=float(generator.uniform(-0.10, 0.02)),
        roll_rad=float(generator.normal(0.0, 0.008)),
        focal_px=float(generator.uniform(700.0, 900.0)),
    )


def _ground(key: Key, width: _Width, crossing: float | None) -> list[Actor]:
    generator = key.stream("ground")
    road, half = width.road, width.road.half_width_m
    paint = RoadPaint(
        half,
        _LANE_M,
        edge=bool(generator.random() < 0.4),
        crossing_m=crossing,
        patch_m=float(generator.uniform(4, 40)),
        manhole_m=float(generator.uniform(4, 30)),
        shift=float(generator.uniform()),
    )
    here = Stance(0.0, 0.0, 0.0, 0.0)
    lane = SceneObject(ribbon(road, -half, half, 0.0, "asphalt"), kind="road", paint={"asphalt": paint})
    soil = str(generator.choice(["grass", "litter", "grass", "grass"]))
    bare = SoilPaint(
        "litter" if soil == "grass" else "dirt",
        bias=float(generator.uniform(-0.9, 0.1)),
        shift=float(generator.uniform()),
    )
    paved = [str(generator.choice(["paver", "cobble", "paver", "concrete"])) for _ in range(2)]
    strips = [kerb(road, side) for side in (1, -1)]
    gardens = []
    for side, material in zip((1, -1), paved, strict=True):
        strips.append(ribbon(road, side * (half + 0.15), side * width.wall_m, PAVEMENT_M, material))
        gardens.append(ribbon(road, side * width.wall_m, side * (width.wall_m + _GARDEN_M), PAVEMENT_M - 0.01, soil))
    base = plane((-400, -400), (700, 400), -0.06, soil)
    return [
        fixed("road", lane, here),
        fixed("pavements", SceneObject(join(strips), kind="pavement"), here),
        fixed("gardens", SceneObject(join([*gardens, base]), kind="garden", paint={soil: bare}), here),
    ]


def _houses(key: Key, width: _Width, site: Site) -> list[Actor]:
    """Rows of houses, each with its fence; what would overlap another is left out."""
    actors: list[Actor] = []
    # nothing may be built on the road itself: claim it in pieces
    for s in np.arange(width.road.first_m, width.road.last_m, 6.0):
        x, y, heading = width.road.at(s + 3.0)
        site.block(Footprint(float(x), float(y), float(heading), 3.3, width.wall_m))
    for side in (1, -1):
        generator = key.stream("row", side)
        style = str(generator.choice(["picket", "hedge", "wall"]))
        s = float(generator.uniform(-6.0, 6.0))
        number = 0
        while s < min(_BUILT_TO_M, width.road.last_m):
            name = f"house-{'left' if side > 0 else 'right'}-{number}"
            number += 1
            back = float(generator.uniform(1.5, 5.0))
            built, wide = house_at(key, name, width.road, s, side, width.wall_m + back, site)
            if built is not None:
                actors.append(built)
            fence_too, gap = generator.random() < 0.75, float(generator.uniform(1.0, 6.0))
            kind = style if generator.random() < 0.6 else str(generator.choice(["picket", "hedge", "wall"]))
            if fence_too:
                actors += front_fence(
                    key, f"{name}-fence", width.road, s - 1.0, s + wide + 0.5, side * (width.wall_m + 0.35), kind
                )
            s += wide + gap
            if generator.random() < 0.75:
                d = side * (width.wall_m + float(generator.uniform(1.2, 3.0)))
                x, y, _ = width.road.at(s - gap / 2, d)
                if site.claim(Footprint(float(x), float(y), 0.0, 0.4, 0.4), 0.2):
                    actors.append(cast.plant(key, f"{name}-tree", float(x), float(y), PAVEMENT_M, size=(0.6, 1.1)))
    return actors


def _traffic(key: Key, width: _Width, site: Site) -> list[Actor]:
    """Parked and moving cars and bicycles."""
    road, half = width.road, width.road.half_width_m
    counts = key.stream("counts")
    x, y, heading = road.at(0.0, -_LANE_M)
    site.block(Footprint(float(x), float(y), float(heading), 5.0, 1.2))  # the camera's own place
    actors: list[Actor | None] = []

    def moving(draw: np.random.Generator) -> Along:
        against = bool(draw.random() < 0.6)
        d = (1.0 if against else -1.0) * _LANE_M + float(draw.normal(0, 0.1))
        ahead = 12.0 + 45.0 * draw.random() ** 1.2
        return Along(road, float(ahead), d, float(draw.uniform(4.0, 11.0)), against)

    def parked(draw: np.random.Generator) -> Along:
        side = float(draw.choice([-1.0, 1.0]))
        against = bool((side > 0) != (draw.random() < 0.12))
        d = side * (half - 1.10) + float(draw.normal(0, 0.06))
        s = 6.0 + 46.0 * draw.random() ** 1.35
        return Along(road, float(s), d, 0.0, against, turn_rad=float(draw.normal(0, 0.02)))

    def riding(draw: np.random.Generator) -> Along:
        against = bool(draw.random() < 0.5)
        d = (1.0 if against else -1.0) * (half - 2.75)
        return Along(road, float(8.0 + 20.0 * draw.random()), d, float(draw.uniform(3.0, 5.5)), against)

    for number in range(int(counts.integers(*_MOVING, endpoint=True))):
        actors.append(cast.drive(key, f"car-moving-{number}", site, moving, gap_m=1.0))
    for number in range(int(counts.integers(*_RIDERS, endpoint=True))):
        actors += cast.cycle(key, f"bicycle-ridden-{number}", site, riding)
    for number in range(int(counts.integers(*_PARKED, endpoint=True))):
        actors.append(cast.drive(key, f"car-parked-{number}", site, parked, gap_m=0.35))
    return [actor for actor in actors if actor is not None]


def _people(key: Key, width: _Width, site: Site, crossing: float | None) -> list[Actor]:
    """People on the pavements and on the crossing, parked bicycles against the gardens."""
    road, half = width.road, width.road.half_width_m
    counts = key.stream("counts", "people")
    actors: list[Actor | None] = []

    def strolling(draw: np.random.Generator) -> Track:
        side = float(draw.choice([-1.0, 1.0]))
        s = 5.0 + 29.0 * draw.random() ** 1.3
        against = bool(draw.random() < 0.5)
        if crossing is not None and draw.random() < 0.3:
            x, y, heading = road.at(crossing + float(draw.uniform(-1.2, 1.2)), float(draw.uniform(-0.8, 0.8) * half))
            across = float(heading) + float(draw.choice([-1.0, 1.0])) * np.pi / 2
            return Straight(Stance(float(x), float(y), 0.0, across), float(draw.uniform(1.0, 1.6)))
        d = side * float(draw.uniform(half + 0.95, width.wall_m - 0.35))
        walks = draw.random() < 0.8
        turn = float(draw.normal(0, 0.08) if walks else draw.uniform(-np.pi, np.pi))
        return Along(road, float(s), d, float(draw.uniform(0.9, 1.5)) if walks else 0.0, against, PAVEMENT_M, turn)

    def leaning(draw: np.random.Generator) -> Along:
        side = float(draw.choice([-1.0, 1.0]))
        turn = float(draw.normal(0, 0.2))
        return Along(road, float(draw.uniform(7, 22)), side * (width.wall_m - 0.35), 0.0, bool(draw.random() < 0.5),
                     PAVEMENT_M, turn)  # fmt: skip

    for number in range(int(counts.integers(*_PARKED_BIKES, endpoint=True))):
        actors += cast.cycle(key, f"bicycle-parked-{number}", site, leaning)
    for number in range(int(counts.integers(*_PEOPLE, endpoint=True))):
        actors.append(cast.walk(key, f"person-{number}", site, strolling))
    return [actor for actor in actors if actor is not None]
