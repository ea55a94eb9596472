"""The objects of a scene as actors: each drawn from its own random stream, and where it stands claimed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from pipeline.scenes.layout.plan import Key
from pipeline.scenes.layout.site import Footprint, Site, footprint_of
from pipeline.scenes.layout.traffic import Actor, Stance, Straight, Track, fixed
from pipeline.scenes.mesh import Mesh
from pipeline.scenes.objects import bicycle, car, person, tree
from pipeline.scenes.objects.base import SceneObject
from pipeline.streams import stream

CAR_KINDS = ("sedan", "hatch", "suv", "van", "wagon")
_CAR_SHARES = (0.25, 0.30, 0.20, 0.10, 0.15)
_PERSON_RADIUS_M = 0.32
_TRIES = 40

Draw = Callable[[np.random.Generator], Track]


_NEAR_M, _FAR_M = 42.0, 75.0


@lru_cache(maxsize=2)
def trees(seed: int, split: str) -> tuple[tuple[SceneObject, ...], ...]:
    """Prototypes of near, far and distant trees, shared by all scenes of a split; kept for the process."""
    near = tuple(tree.make(stream(seed, "sim", split, "near tree", index)) for index in range(7))
    far = tuple(tree.make(stream(seed, "sim", split, "far tree", index), far=True) for index in range(6))
    thin = stream(seed, "sim", split, "distant tree")
    return near, far, tuple(replace(one, mesh=thinned(one.mesh, 0.35, thin)) for one in far)


def thinned(mesh: Mesh, share: float, generator: np.random.Generator) -> Mesh:
    """A tree with fewer, larger leaves, covering the same area, for where a leaf is smaller than a pixel.

    Args:
        mesh: the tree.
        share: of its leaf triangles to keep, in (0, 1]; all else is kept.
        generator: which to keep.
    """
    leaf = np.isin(mesh.material, [code for code, name in enumerate(mesh.materials) if name == "leaf"])
    keep = ~leaf | (generator.random(len(mesh)) < share)
    chosen = {name: getattr(mesh, name)[keep] for name in ("position", "normal", "local", "uv", "material")}
    grown, leaf = chosen["position"], leaf[keep]
    middle = grown[leaf].mean(axis=1, keepdims=True)
    grown[leaf] = middle + (grown[leaf] - middle) * np.float32(share**-0.5)
    return replace(mesh, **chosen)


def plant(key: Key, name: str, x_m: float, y_m: float, z_m: float = 0.0, *, size: tuple[float, float]) -> Actor:
    """A tree at a place, as detailed as its distance from the origin asks for.

    Args:
        key: of the viewpoint.
        name: of the tree.
        x_m: where it stands.
        y_m: where it stands.
        z_m: height of the ground.
        size: range of factors on the prototype's size.
    """
    generator = key.stream(name)
    kinds = trees(key.seed, key.split)[int(np.digitize(np.hypot(x_m, y_m), (_NEAR_M, _FAR_M)))]
    thing = kinds[int(generator.integers(len(kinds)))]
    stance = Stance(x_m, y_m, z_m, float(generator.uniform(0.0, 2 * np.pi)))
    return fixed(name, thing, stance, float(generator.uniform(*size)))


def drive(key: Key, name: str, site: Site, draw: Draw, gap_m: float = 0.9) -> Actor | None:
    """A car on the first free of the tracks drawn, or None if none of them is free.

    Args:
        key: of the viewpoint.
        name: of the car.
        site: footprints at t = 0; the car's is added.
        draw: draws a track; a speed of 0 parks it.
        gap_m: distance to keep.
    """
    generator = key.stream(name, "place")
    kind = str(generator.choice(CAR_KINDS, p=_CAR_SHARES))
    still = car.make(kind, key.stream(name))
    for _ in range(_TRIES):
        track = draw(generator)
        stance = track.at(0.0)
        if site.claim(footprint_of(still.mesh, stance.x_m, stance.y_m, stance.yaw_rad), gap_m):
            if track.speed_mps == 0.0:
                return Actor(name, track, lambda _: still)
            return Actor(name, track, lambda way: car.make(kind, key.stream(name), travel_m=way))
    return None


def walk(key: Key, name: str, site: Site, draw: Draw, gap_m: float = 0.35) -> Actor | None:
    """A person on the first free track; walks where the track has a speed, else stands."""
    generator = key.stream(name, "place")
    begin = float(generator.uniform(0.0, 2 * np.pi))
    for _ in range(_TRIES):
        track = draw(generator)
        stance = track.at(0.0)
        if site.claim(Footprint(stance.x_m, stance.y_m, 0.0, _PERSON_RADIUS_M, _PERSON_RADIUS_M), gap_m):
            return Actor(name, track, lambda way: person.make(key.stream(name), begin, way))
    return None


def cycle(key: Key, name: str, site: Site, draw: Draw, gap_m: float = 0.5) -> list[Actor]:
    """A bicycle on the first free track: with a rider if it moves, else on its stand; nothing if none is free."""
    generator = key.stream(name, "place")
    for _ in range(_TRIES):
        track = draw(generator)
        stance = track.at(0.0)
        if not site.claim(Footprint(stance.x_m, stance.y_m, stance.yaw_rad, 0.95, 0.35), gap_m):
            continue
        return _bicycle(key, name, track)
    return []


def _bicycle(key: Key, name: str, track: Track) -> list[Actor]:
    if track.speed_mps == 0.0:
        still = bicycle.make(key.stream(name))
        return [Actor(name, track, lambda _: still)]
    return [
        Actor(name, track, lambda way: bicycle.make(key.stream(name), way)),
        Actor(f"{name}-rider", track, lambda way: bicycle.make_rider(key.stream(name), way)),
    ]


def stand(name: str, thing: SceneObject, site: Site, stance: Stance, gap_m: float = 0.3) -> Actor | None:
    """A fixed object if its footprint is free."""
    if site.claim(footprint_of(thing.mesh, stance.x_m, stance.y_m, stance.yaw_rad), gap_m):
        return Actor(name, Straight(stance), lambda _: thing)
    return None
