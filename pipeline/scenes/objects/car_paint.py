"""The painted body of a car: glass, lamps, grille, bumpers, seams and badges at the point that a ray hits."""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.scenes.objects.base import Surface
from pipeline.scenes.objects.brush import Coat, beyond, grating, stripe
from pipeline.scenes.objects.car_body import ARCH_GAP_M, CarBody
from pipeline.scenes.objects.car_interior import Cabin

Array = NDArray[np.float32]

PAINTS = (0.02, 0.03, 0.05, 0.12, 0.30, 0.55, 0.72, 0.80)
# Normals change over a few centimetres where the body turns; this turns their components into distances.
_TURN_M = 0.25


@dataclass(frozen=True)
class Trim:
    """What differs between two cars of one shape.

    Attributes:
        paint: albedo of the paint.
        grille: 0 horizontal bars, 1 mesh, 2 upright bars.
        grille_part: half width of the grille, as a part of the car's width.
        chrome: bright frames round grille and windows.
        lamp: albedo of the head lamps' housing.
        tail: albedo of the tail lamps.
        slant: rise of the head lamps outwards, metres per metre.
        cladding: black plastic round the wheels and on the sills.
        plate_m: heights of the front and of the rear number plate.
    """

    paint: float
    grille: int
    grille_part: float
    chrome: bool
    lamp: float
    tail: float
    slant: float
    cladding: bool
    plate_m: tuple[float, float]

    @classmethod
    def draw(cls, body: CarBody, generator: np.random.Generator) -> Trim:
        """A plausible trim for a body."""
        low, high = body.type.lamps_m
        paint = float(generator.choice(PAINTS) * generator.uniform(0.85, 1.15))
        return cls(
            paint=paint,
            grille=int(generator.integers(3)),
            grille_part=float(generator.uniform(0.19, 0.27)),
            chrome=bool(generator.random() < 0.55),
            lamp=float(generator.uniform(0.5, 0.9)),
            tail=float(generator.uniform(0.05, 0.14)),
            slant=float(generator.uniform(0.02, 0.22)),
            cladding=bool(generator.random() < (0.7 if body.kind == "suv" else 0.15)),
            plate_m=((low - 0.15) * body.rise, (high - 0.02 if body.kind != "sedan" else high + 0.02) * body.rise),
        )


@dataclass(frozen=True)
class BodyPaint:
    """Painter of "car_body".

    Attributes:
        body: shape and its curves.
        trim: colours and styles.
        cabin: what windows show.
    """

    body: CarBody
    trim: Trim
    cabin: Cabin

    def __call__(self, surface: Surface) -> tuple[Array, Array]:
        """Layers from the paint outwards: plastics, seams, front, rear, glass."""
        spot = _Spot(self.body, surface)
        coat = Coat.plain(len(surface.local), self.trim.paint, 0.05)
        self._plastics(spot, coat)
        self._seams(spot, coat)
        self._front(spot, coat)
        self._rear(spot, coat)
        self._glass(spot, coat, surface)
        return coat.result()

    def _plastics(self, at: _Spot, coat: Coat) -> None:
        coat.lay(beyond(0.25 - at.z, at.foot), 0.025)
        coat.lay(at.inside(0.30 - at.z, at.side), 0.025)
        if self.trim.cladding:
            for axle in self.body.axles_m:
                rim = np.hypot(at.x - axle, at.z - self.body.type.wheel_m) - self.body.type.wheel_m - ARCH_GAP_M
                coat.lay(at.inside(0.055 - rim, at.side, 0.9 - at.z), 0.03, 0.02)
            coat.lay(at.inside(0.37 - at.z, at.side), 0.03, 0.02)

    def _seams(self, at: _Spot, coat: Coat) -> None:
        body, glass = self.body, self.body.type.side_glass
        door = np.minimum(at.belt - at.z, at.z - 0.31)
        last = min(glass[1] - 0.035, body.type.axles[1] - 0.01)
        for along in (glass[0] + 0.02, *body.type.pillars[:1], last):
            coat.lay(stripe(at.x - float(body.x(along)), 0.004, at.foot) * at.inside(door, at.side), 0.01)
        doors = np.minimum(at.t - glass[0] - 0.02, last - at.t) * body.length_m
        coat.lay(stripe(at.z - 0.32, 0.004, at.foot) * at.inside(doors, at.side), 0.01)
        # swage line under the handles catches a shadow
        swage = stripe(at.z - at.belt + 0.19, 0.008, at.foot) * at.inside(doors + 0.3, at.side)
        coat.lay(0.35 * swage, 0.3 * self.trim.paint)
        bonnet = at.inside((0.30 - at.t) * body.length_m, at.up, at.belt + 0.12 - at.z)
        coat.lay(stripe(at.ay - (at.half - 0.13), 0.004, at.foot) * bonnet, 0.01)
        lip = at.inside(at.half - 0.13 - at.ay, (0.2 - at.t) * body.length_m)
        coat.lay(stripe(at.x - float(body.x(0.035)), 0.005, at.foot) * lip, 0.01)

    def _front(self, at: _Spot, coat: Coat) -> None:
        body, trim, foot = self.body, self.trim, at.foot
        front = np.minimum((0.13 - at.t) * body.length_m, (at.nx - 0.2) * _TURN_M)
        lamp0 = body.type.lamps_m[0] * body.rise
        low, high = lamp0 - 0.06, lamp0 + 0.085
        half = trim.grille_part * body.width_m
        bars = (
            grating(at.z, 0.036, 0.36, foot) * 0.5,
            np.maximum(grating(at.z + at.y, 0.05, 0.22, foot), grating(at.z - at.y, 0.05, 0.22, foot)) * 0.25,
            grating(at.y, 0.055, 0.25, foot) * 0.45,
        )[trim.grille]
        grille = np.minimum.reduce([front, at.z - low, high - at.z, half - at.ay])
        coat.lay(beyond(grille + 0.016, foot), *((0.6, 0.3) if trim.chrome else (0.03, 0.03)))
        coat.lay(beyond(grille, foot), 0.012 + bars, 0.03)
        badge = 0.062 - np.hypot(at.y, at.z - (low + high) / 2)
        coat.lay(at.inside(badge, front), 0.7, 0.25)
        coat.lay(at.inside(badge - 0.016, front), 0.12, 0.1)
        # lower intake and fog lamps
        intake = np.minimum.reduce([front, at.z - 0.25, trim.plate_m[0] - 0.09 - at.z, 0.34 * body.width_m - at.ay])
        coat.lay(beyond(intake, foot), 0.012 + 0.05 * grating(at.z, 0.04, 0.25, foot))
        fog = np.hypot(at.ay - 0.40 * body.width_m, at.z - 0.37)
        coat.lay(at.inside(0.055 - fog, front + 0.05), 0.02, 0.03)
        coat.lay(at.inside(0.034 - fog, front + 0.05), 0.75, 0.08)
        # head lamps wrap round the corner
        inner = 0.275 * body.width_m
        bottom = lamp0 - 0.03 + trim.slant * 0.6 * (at.ay - inner)
        top = lamp0 + 0.085 + trim.slant * (at.ay - inner)
        wrap = np.minimum((0.105 - at.t) * body.length_m, (at.nx - 0.03) * _TURN_M)
        lamp = np.minimum.reduce([wrap, at.ay - inner, at.z - bottom, top - at.z])
        coat.lay(beyond(lamp + 0.012, foot), 0.012, 0.03)
        beam = np.hypot(np.mod(at.ay - inner - 0.01, 0.125) - 0.0625, at.z - (bottom + top) / 2)
        bright = trim.lamp + (0.35 - trim.lamp) * beyond(0.050 - beam, foot)
        bright = bright + (0.92 - bright) * beyond(0.026 - beam, foot)
        coat.lay(beyond(lamp, foot), bright, 0.12)

    def _rear(self, at: _Spot, coat: Coat) -> None:
        body, trim, foot = self.body, self.trim, at.foot
        rear = np.minimum((at.t - 0.86) * body.length_m, (-at.nx - 0.25) * _TURN_M)
        base = body.type.lamps_m[1] * body.rise
        tall = body.type.tall_tail
        low, high = (base - 0.02, base + 0.30) if tall else (base - 0.02, base + 0.13)
        inner = (0.355 if tall else 0.27) * body.width_m
        wrap = np.minimum((at.t - 0.945) * body.length_m, (-at.nx - 0.06) * _TURN_M)
        lamp = np.minimum.reduce([wrap, at.ay - inner, at.z - low, high - at.z])
        coat.lay(beyond(lamp + 0.010, foot), 0.02, 0.03)
        coat.lay(beyond(lamp, foot), trim.tail, 0.10)
        white = np.minimum(lamp - 0.012, np.minimum(at.z - low - 0.035, low + 0.085 - at.z))
        coat.lay(beyond(white, foot), 0.6, 0.10)
        coat.lay(at.inside(0.40 - at.z, at.z - 0.20, rear), 0.025)
        bumper = stripe(at.z - (trim.plate_m[1] - 0.13), 0.005, foot)
        coat.lay(bumper * at.inside(0.43 * body.width_m - at.ay, rear), 0.01)
        edge = at.inside(-(at.nx + 0.1) * _TURN_M, at.t - 0.88, at.z - 0.6, at.belt - at.z)
        coat.lay(stripe(at.ay - 0.43 * body.width_m, 0.004, foot) * edge, 0.01)
        recess = np.minimum(0.075 - np.abs(at.z - trim.plate_m[1]), 0.29 - at.ay)
        coat.lay(at.inside(recess, rear), 0.6 * trim.paint + 0.005, 0.03)
        badge = 0.045 - np.hypot(at.y, at.z - trim.plate_m[1] - 0.14)
        coat.lay(at.inside(badge, rear), 0.6, 0.25)

    def _glass(self, at: _Spot, coat: Coat, surface: Surface) -> None:
        body, foot = self.body, at.foot
        first, last = body.type.side_glass
        cowl = float(body.belt_m(0.3))
        roof = body.roof_m
        # side windows: the rear end leans forward with the tail
        lean = np.maximum(at.z - at.belt, 0) * 0.35
        window = np.minimum.reduce(
            [
                at.side, (at.t - first) * body.length_m, (last - at.t) * body.length_m - lean * (body.kind != "van"),
                at.z - at.belt - 0.018, at.top - 0.095 - at.z,
            ]
        )  # fmt: skip
        screen = np.minimum.reduce(
            [
                (0.5 - at.t) * body.length_m, (at.nx - 0.26) * _TURN_M, at.z - cowl - 0.05, roof - 0.105 - at.z,
                (0.66 - at.any) * _TURN_M,
            ]
        )  # fmt: skip
        sill = float(body.belt_m(0.9)) + (0.10 if body.type.tall_tail else 0.13)
        back = np.minimum.reduce(
            [
                (at.t - 0.6) * body.length_m, (-at.nx - 0.26) * _TURN_M, at.z - sill, roof - 0.085 - at.z,
                (0.62 - at.any) * _TURN_M,
            ]
        )  # fmt: skip
        if self.trim.chrome:
            coat.lay(at.inside(window + 0.022, at.side), 0.45, 0.3)
        coat.lay(at.inside(window + 0.008, at.side), 0.012, 0.02)
        pane = np.maximum.reduce([window, screen, back])
        seen = np.flatnonzero(pane > -foot)
        albedo = np.full(len(pane), 0.02, np.float32)
        if len(seen):
            view = -surface.normal if surface.view is None else surface.view
            albedo[seen] = 0.008 + 0.5 * self.cabin.look(surface.local[seen], view[seen])
        coat.lay(beyond(np.maximum(screen, back) + 0.03, foot), 0.014, 0.03)
        coat.lay(beyond(pane, foot), albedo, 0.07)
        pillars = [stripe(at.x - float(body.x(along)), 0.045, foot) for along in body.type.pillars]
        rake = stripe(at.x - float(body.x(last - 0.075)) - 0.7 * (at.z - at.belt), 0.022, foot)
        coat.lay(reduce(np.maximum, [*pillars, rake]) * at.inside(window + 0.008), 0.012, 0.03)
        # wipers and the black band under the windscreen
        wiper = stripe(at.z - cowl - 0.07 - 0.12 * np.mod(at.y / 0.62 + 0.5, 1), 0.006, foot)
        coat.lay(wiper * beyond(screen, foot), 0.01)


class _Spot:
    """The hit points in the coordinates painters think in; all distances in metres, positive inside."""

    def __init__(self, body: CarBody, surface: Surface) -> None:
        self.x, self.y, self.z = surface.local.T
        self.nx, ny, nz = surface.normal.T
        self.foot = surface.footprint_m
        self.ay, self.any = np.abs(self.y), np.abs(ny)
        self.half = 0.5 * body.width_m
        self.t = body.along(self.x).astype(np.float32)
        self.top = body.top_m(self.t).astype(np.float32)
        self.belt = body.belt_m(self.t).astype(np.float32)
        self.side = (self.any - 0.52) * _TURN_M
        self.up = (nz - 0.45) * _TURN_M

    def inside(self, *distances: ArrayLike) -> Array:
        """Coverage of the intersection of regions."""
        return beyond(reduce(np.minimum, distances), self.foot)
