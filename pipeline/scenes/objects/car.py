"""Cars: body, rolling wheels, mirrors, handles, number plates, roof rails."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.scenes.mesh import Mesh, join, rotation
from pipeline.scenes.objects.base import SceneObject, Surface
from pipeline.scenes.objects.brush import Coat, beyond, stripe
from pipeline.scenes.objects.car_body import CarBody
from pipeline.scenes.objects.car_interior import Cabin
from pipeline.scenes.objects.car_paint import BodyPaint, Trim
from pipeline.scenes.objects.car_types import CAR_TYPES
from pipeline.scenes.objects.materials import MATERIALS
from pipeline.scenes.objects.wheel import HALF_WIDTH_M, RimPaint, wheel
from pipeline.scenes.shapes import both_sides, box, ellipsoid, tube

Array = NDArray[np.float32]
KINDS = tuple(CAR_TYPES)


def make(
    kind: str,
    generator: np.random.Generator,
    travel_m: float = 0.0,
    steer_rad: float = 0.0,
    driver: bool | None = None,
) -> SceneObject:
    """A car at the origin, nose towards +x, wheels on z = 0.

    Everything random is drawn first, so the same generator state gives the same car at any `travel_m`.

    Args:
        kind: one of `KINDS`.
        generator: random numbers.
        travel_m: distance driven; the wheels have rolled that far.
        steer_rad: angle of the front wheels, positive to the left.
        driver: whether somebody sits at the wheel; drawn (one in three) if None.

    Raises:
        InputError: no such kind.
    """
    body = CarBody.draw(kind, generator)
    trim = Trim.draw(body, generator)
    seat, skin, coat, sits = generator.random(4)
    spokes = int(generator.choice([5, 5, 6, 7, 10]))
    rims = RimPaint(
        body.type.wheel_m, spokes, float(generator.uniform(0.32, 0.5)), float(generator.choice([0.55, 0.5, 0.4, 0.06])),
        bool(generator.random() < 0.4),
    )  # fmt: skip
    text = generator.random((7, 12)) < 0.42
    handles = "chrome" if trim.chrome and generator.random() < 0.6 else "car_paint"
    rails = kind in ("wagon", "suv") and bool(generator.random() < 0.6)
    occupied = bool(sits < 0.35) if driver is None else driver
    cabin = Cabin(body, occupied, 0.03 + 0.12 * float(seat**2), 0.18 + 0.3 * float(skin), 0.03 + 0.4 * float(coat**2))

    parts = [body.mesh(), *_wheels(body, travel_m, steer_rad), _mirrors(body), _handles(body, handles)]
    parts += [_lower(body), _antenna(body)]
    if rails:
        parts.append(_rails(body, "chrome" if trim.chrome else "black"))
    solid = join(parts)
    plates = _plates(body, trim)
    # wheels and plates keep coordinates of their own for their painters; the rest is in the car's already
    factor = trim.paint / MATERIALS["car_body"].albedo
    return SceneObject(
        mesh=join([solid, *plates]),
        label="car",
        kind=kind,
        tint={"car_body": factor, "car_paint": factor},
        paint={"car_body": BodyPaint(body, trim, cabin), "rim": rims, "plate": PlatePaint(tuple(map(tuple, text)))},
    )


def _wheels(body: CarBody, travel_m: float, steer_rad: float) -> list[Mesh]:
    radius = body.type.wheel_m
    roll = travel_m / radius
    results = []
    for x, steer in zip(body.axles_m, (steer_rad, 0.0), strict=True):
        for side in (1, -1):
            positions = (x, side * (body.width_m / 2 - HALF_WIDTH_M - 0.012), radius)
            results.append(wheel(radius, roll, left=side > 0).turned(rotation(steer, "z"), positions))
    return results


def _mirrors(body: CarBody) -> Mesh:
    along = body.type.side_glass[0] + 0.035
    x, z = float(body.x(along)), float(body.belt_m(along)) + 0.075
    y = body.width_m / 2
    shell = ellipsoid((x, y + 0.075, z), (0.075, 0.115, 0.078), "car_paint", 12, 8, exponent=0.75)
    glass = ellipsoid((x - 0.052, y + 0.075, z), (0.026, 0.098, 0.064), "chrome", 12, 6, exponent=0.75)
    arm = tube([(x + 0.01, y - 0.06, z - 0.06), (x, y + 0.04, z - 0.035)], 0.024, "black", 6)
    return both_sides(join([shell, glass, arm]))


def _handles(body: CarBody, material: str) -> Mesh:
    results = []
    for along in (body.type.pillars[0] - 0.033, body.type.side_glass[1] - 0.085):
        z = float(body.belt_m(along)) - 0.095
        results.append(
            ellipsoid((float(body.x(along)), body.width_m / 2 * 0.986 + 0.008, z), (0.10, 0.022, 0.017), material, 8, 5)
        )
    return both_sides(join(results))


def _lower(body: CarBody) -> Mesh:
    """Exhaust and the dark floor between the axles, which hides daylight under the sills."""
    rear = -body.length_m / 2
    pipe = tube([(rear + 0.35, 0.48, 0.23), (rear - 0.005, 0.48, 0.23)], 0.032, "black", 8)
    front, back = body.axles_m
    floor = box((back + 0.1, -0.62, 0.15), (front - 0.1, 0.62, 0.22), "black")
    return join([pipe, floor])


def _antenna(body: CarBody) -> Mesh:
    along = min(0.86, body.type.side_glass[1] - 0.01)
    return ellipsoid(
        (float(body.x(along)), 0.0, float(body.top_m(along)) + 0.012), (0.075, 0.018, 0.045), "car_paint", 8, 6
    )


def _rails(body: CarBody, material: str) -> Mesh:
    along = np.linspace(0.46, body.type.side_glass[1] - 0.015, 7)
    cabin = body.roof_m - body.belt_m(0.6)
    y = body.width_m / 2 * 0.955 - body.type.tumble * float(cabin) - 0.13
    height = body.top_m(along) + np.array([-0.01, 0.035, 0.045, 0.048, 0.045, 0.035, -0.01])
    return both_sides(tube(np.stack([body.x(along), np.full(7, y), height], axis=1), 0.014, material, 6))


def _plates(body: CarBody, trim: Trim) -> list[Mesh]:
    half = np.array([0.012, 0.26, 0.057])
    plate = box(-half, half, "plate")
    front = plate.placed(0.0, (body.length_m / 2 + 0.012, 0.0, trim.plate_m[0]))
    rear = plate.placed(np.pi, (-body.length_m / 2 - 0.004, 0.0, trim.plate_m[1]))
    return [front, rear]


@dataclass(frozen=True)
class PlatePaint:
    """Number plate: seven characters of 3 x 4 cells on white, in the plate's own coordinates.

    Attributes:
        cells: (7, 12) which cells are inked.
    """

    cells: tuple[tuple[bool, ...], ...]

    def __call__(self, surface: Surface) -> tuple[Array, Array]:
        """White plate, dark frame, dark characters that blur to grey when they are small."""
        y, z = surface.local[:, 1], surface.local[:, 2]
        foot = surface.footprint_m
        coat = Coat.plain(len(y), 0.74, 0.03)
        slot = (y + 0.224) / 0.064
        letter = np.clip(np.floor(slot).astype(int), 0, 6)
        across = np.clip(((slot - letter) - 0.14) / 0.72, 0, 0.999)
        up = np.clip((z + 0.036) / 0.072, 0, 0.999)
        cell = np.floor(up * 4).astype(int) * 3 + np.floor(across * 3).astype(int)
        inked = np.asarray(self.cells)[letter, cell].astype(np.float32)
        gap = 0.022 - np.abs(np.mod(slot, 1) - 0.5) * 0.064
        inside = np.minimum.reduce([0.036 - np.abs(z), 0.224 - np.abs(y), gap])
        share = np.float32(np.mean(self.cells))
        fade = np.clip(1.5 - foot / 0.02, 0, 1)
        coat.lay(beyond(inside, foot) * (share + (inked - share) * fade), 0.03)
        frame = np.maximum(np.abs(y) - 0.253, np.abs(z) - 0.050)
        coat.lay(beyond(frame, foot), 0.03)
        coat.lay(stripe(z + 0.048, 0.002, foot), 0.10)
        return coat.result()
