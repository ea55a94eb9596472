"""A village square: houses in a ring around open ground, with cars, people, bicycles and walls between."""

from __future__ import annotations

import numpy as np

from pipeline.scenes.layout import cast
from pipeline.scenes.layout.backdrop import horizon, woods
from pipeline.scenes.layout.buildings import fence_between, fence_footprint
from pipeline.scenes.layout.furniture import scatter
from pipeline.scenes.layout.ground import plane
from pipeline.scenes.layout.ground_paint import SoilPaint
from pipeline.scenes.layout.plan import Camera, Key, Plan, weather
from pipeline.scenes.layout.site import Footprint, Site, footprint_of
from pipeline.scenes.layout.traffic import Actor, Stance, Straight, Track, fixed
from pipeline.scenes.objects import house
from pipeline.scenes.objects.base import SceneObject

_HOUSES = 14
_NEAR_TREES = 14
_CARS, _PEOPLE, _BIKES, _RIDERS = (3, 5), (4, 6), (2, 3), (0, 1)
_SOILS = {"litter": "dirt", "dirt": "litter", "grass": "litter", "cobble": "dirt"}


def village(key: Key) -> Plan:
    """Plan of a village.

    Args:
        key: random streams of the viewpoint.
    """
    site = Site()
    camera = _camera(key)
    site.block(Footprint(-1.0, 0.0, 0.0, 4.0, 2.5))
    actors = [_ground(key)]
    actors += _vehicles(key, site)
    actors += _people(key, site)
    actors += _houses(key, site)
    actors += _walls(key, site)
    actors += scatter(key, site)
    actors += _trees(key, site)
    actors += woods(key, "wood", 75, 52.0, 105.0, site, lambda x, y: True)
    actors.append(horizon(key))
    light, tone = weather(key, camera.turn_rad)
    return Plan(tuple(actors), camera, light, tone)


def _camera(key: Key) -> Camera:
    generator = key.stream("camera")
    return Camera(
        Straight(Stance(-1.0, 0.0, 0.0, 0.0), 2.0),
        height_m=float(generator.uniform(1.5, 2.6)),
        turn_rad=float(generator.normal(0.0, 0.06)),
        pitch_rad=float(generator.uniform(-0.15, -0.03)),
        roll_rad=float(generator.normal(0.0, 0.008)),
        focal_px=float(generator.uniform(700.0, 860.0)),
    )


def _ground(key: Key) -> Actor:
    generator = key.stream("ground")
    soil = str(generator.choice(["litter", "dirt", "litter", "grass", "cobble"]))
    bends = [(-30.0, float(generator.uniform(-3, 3)))]
    for x in (0.0, 18.0, 36.0, 60.0):
        bends.append((x, bends[-1][1] + float(generator.normal(0, 4.0))))
    paint = SoilPaint(
        _SOILS[soil],
        size_m=float(generator.uniform(8, 16)),
        bias=float(generator.uniform(-1.2, -0.2) - (1.0 if soil == "cobble" else 0.0)),
        path=None if soil == "cobble" else tuple(bends),
        path_width_m=float(generator.uniform(1.0, 2.2)),
        shift=float(generator.uniform()),
    )
    thing = SceneObject(plane((-150, -420), (480, 420), 0.0, soil), kind="ground", paint={soil: paint})
    return fixed("ground", thing, Stance(0.0, 0.0, 0.0, 0.0))


def _sector(draw: np.random.Generator, near_m: float, far_m: float, slope: float = 0.5) -> tuple[float, float]:
    """A place within view: (x, y) with x ahead and |y| <= slope x."""
    x = float(near_m + (far_m - near_m) * draw.random())
    return x, float(draw.uniform(-slope, slope) * x)


def _vehicles(key: Key, site: Site) -> list[Actor]:
    counts = key.stream("counts")

    def anywhere(draw: np.random.Generator) -> Track:
        x, y = _sector(draw, 8.0, 22.0, 0.52)
        speed = float(draw.uniform(1.5, 4.0)) if draw.random() < 0.25 else 0.0
        return Straight(Stance(x, y, 0.0, float(draw.uniform(0, 2 * np.pi))), speed)

    def riding(draw: np.random.Generator) -> Track:
        x, y = _sector(draw, 8.0, 18.0, 0.45)
        return Straight(Stance(x, y, 0.0, float(draw.uniform(0, 2 * np.pi))), float(draw.uniform(2.0, 4.0)))

    def stood(draw: np.random.Generator) -> Track:
        x, y = _sector(draw, 6.0, 17.0)
        return Straight(Stance(x, y, 0.0, float(draw.uniform(0, 2 * np.pi))))

    results: list[Actor | None] = []
    for number in range(int(counts.integers(*_CARS, endpoint=True))):
        results.append(cast.drive(key, f"car-{number}", site, anywhere, gap_m=0.8))
    for number in range(int(counts.integers(*_RIDERS, endpoint=True))):
        results += cast.cycle(key, f"bicycle-ridden-{number}", site, riding)
    for number in range(int(counts.integers(*_BIKES, endpoint=True))):
        results += cast.cycle(key, f"bicycle-{number}", site, stood)
    return [actor for actor in results if actor is not None]


def _people(key: Key, site: Site) -> list[Actor]:
    counts = key.stream("counts", "people")

    def strolling(draw: np.random.Generator) -> Track:
        x, y = _sector(draw, 5.0, 18.0)
        speed = float(draw.uniform(0.8, 1.5)) if draw.random() < 0.7 else 0.0
        return Straight(Stance(x, y, 0.0, float(draw.uniform(0, 2 * np.pi))), speed)

    results = [
        cast.walk(key, f"person-{number}", site, strolling)
        for number in range(int(counts.integers(*_PEOPLE, endpoint=True)))
    ]
    return [actor for actor in results if actor is not None]


def _houses(key: Key, site: Site) -> list[Actor]:
    """A ring of houses that face the square; what overlaps is left out."""
    actors = []
    for number in range(_HOUSES):
        name = f"house-{number}"
        thing = house.make(key.stream(name))
        generator = key.stream(name, "place")
        for _ in range(6):
            angle = -0.95 + 1.9 * (number % 9 + 0.5) / 9 + generator.normal(0, 0.05)
            distance = generator.uniform(24, 36) if number < 9 else generator.uniform(40, 58)
            x, y = float(distance * np.cos(angle)), float(distance * np.sin(angle))
            yaw = float(angle + np.pi + generator.normal(0, 0.4))
            if site.claim(footprint_of(thing.mesh, x, y, yaw), 0.4):
                actors.append(fixed(name, thing, Stance(x, y, 0.0, yaw)))
                break
    return actors


def _walls(key: Key, site: Site) -> list[Actor]:
    """A wall, hedge or fence to either side, some reaching towards the camera."""
    actors = []
    for side in (-1.0, 1.0):
        generator = key.stream("wall", int(side))
        begin = (float(generator.uniform(6, 10)), side * float(generator.uniform(6, 9)))
        end = (float(generator.uniform(16, 22)), side * float(generator.uniform(10, 16)))
        kind = str(generator.choice(["wall", "hedge", "picket", "wall"]))
        if generator.random() < 0.7 and site.claim(fence_footprint(begin, end), 0.2):
            name = f"fence-{int(side)}"
            actors.append(fence_between(key, name, name, begin, end, kind, 0.0))
    return actors


def _trees(key: Key, site: Site) -> list[Actor]:
    generator = key.stream("trees")
    actors = []
    for number in range(_NEAR_TREES):
        angle, distance = generator.uniform(-0.8, 0.8), generator.uniform(17, 50)
        x, y = float(distance * np.cos(angle)), float(distance * np.sin(angle))
        if site.claim(Footprint(x, y, 0.0, 0.5, 0.5), 0.5):
            actors.append(cast.plant(key, f"tree-{number}", x, y, size=(0.75, 1.25)))
    return actors
