"""Bicycles with rolling wheels and turning cranks, alone or ridden."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.scenes.mesh import Mesh, join
from pipeline.scenes.objects.base import SceneObject
from pipeline.scenes.objects.brush import Flat
from pipeline.scenes.objects.figure import FOREARM, SHANK, THIGH, UPPER_ARM, Figure
from pipeline.scenes.objects.materials import MATERIALS
from pipeline.scenes.objects.person import dressed
from pipeline.scenes.objects.pose import Limb, Pose, reach, shoulder_m
from pipeline.scenes.shapes import box, ellipsoid, lathe, torus, tube

Array = NDArray[np.float64]

WHEEL_M = 0.340
_CRANK_M = 0.17
_GEAR = 2.4
_REAR = np.array([-0.52, 0.0, WHEEL_M])
_FRONT = np.array([0.54, 0.0, WHEEL_M])
_BRACKET = np.array([-0.08, 0.0, 0.29])
_HEAD = np.array([0.375, 0.0, 0.885])
_CROWN = np.array([0.425, 0.0, 0.735])


@dataclass(frozen=True)
class Build:
    """What differs between two bicycles.

    Attributes:
        step_through: a low frame without a top tube.
        guards: mudguards.
        rack: carrier over the rear wheel.
        basket: wire basket before the bar.
        bar_rise_m: height of the grips above the head tube.
        saddle_m: height of the saddle.
        frame: albedo of the paint.
    """

    step_through: bool
    guards: bool
    rack: bool
    basket: bool
    bar_rise_m: float
    saddle_m: float
    frame: float

    @classmethod
    def draw(cls, generator: np.random.Generator) -> Build:
        """A bicycle."""
        chance = generator.random(4)
        return cls(
            step_through=bool(chance[0] < 0.35),
            guards=bool(chance[1] < 0.6),
            rack=bool(chance[2] < 0.5),
            basket=bool(chance[3] < 0.25),
            bar_rise_m=float(generator.uniform(0.08, 0.22)),
            saddle_m=float(generator.uniform(0.90, 0.97)),
            frame=float(generator.choice([0.03, 0.06, 0.15, 0.30, 0.60])),
        )

    @property
    def saddle(self) -> Array:
        """(3,) middle of the saddle."""
        return np.array([-0.25, 0.0, self.saddle_m])

    @property
    def bar(self) -> Array:
        """(3,) middle of the handle bar."""
        return _HEAD + np.array([0.05, 0.0, self.bar_rise_m])

    def grip(self, side: int) -> Array:
        """(3,) grip of a side, 1 left, -1 right."""
        return self.bar + np.array([-0.09, side * 0.27, 0.025])


def make(generator: np.random.Generator, travel_m: float = 0.0) -> SceneObject:
    """A bicycle at the origin, facing +x, wheels on z = 0.

    Args:
        generator: random numbers.
        travel_m: distance ridden: wheels and cranks have turned accordingly.
    """
    build, crank_rad = _draw(generator, travel_m)
    return SceneObject(
        mesh=join(_parts(build, travel_m / WHEEL_M, crank_rad)),
        label="bicycle",
        kind="step-through" if build.step_through else "diamond",
        tint={"frame": build.frame / MATERIALS["frame"].albedo},
        paint={"frame": Flat(build.frame, 0.04)},
    )


def make_rider(generator: np.random.Generator, travel_m: float = 0.0) -> SceneObject:
    """The person who rides the bicycle that `make` returns for the same generator state; place both alike."""
    build, crank_rad = _draw(generator, travel_m)
    figure = Figure.draw(generator)
    outfit = figure.outfit if figure.outfit == "shorts" else "trousers"
    figure = replace(figure, outfit=outfit, bag="none" if figure.bag == "shoulder" else figure.bag)
    return replace(dressed(figure, riding(figure, build, crank_rad)), kind="rider")


def _draw(generator: np.random.Generator, travel_m: float) -> tuple[Build, float]:
    """The bicycle and the angle of its left crank, forward from the top."""
    build = Build.draw(generator)
    return build, travel_m / WHEEL_M / _GEAR + float(generator.uniform(0, 2 * np.pi))


def riding(figure: Figure, build: Build, crank_rad: float) -> Pose:
    """Pose on a bicycle: seated, hands on the grips, feet on the pedals."""
    k = figure.height_m
    pelvis = build.saddle + np.array([0.02, 0.0, 0.052 * k])
    grips = [build.grip(side) for side in (1, -1)]
    # lean until nearly straight arms reach the bar
    arm = (UPPER_ARM + FOREARM) * k * 0.96
    leans = np.linspace(0.12, 0.95, 40)
    gaps = [abs(float(np.linalg.norm(grips[0] - shoulder_m(figure, pelvis, lean, 1))) - arm) for lean in leans]
    lean = float(leans[int(np.argmin(gaps))])
    legs, arms = [], []
    for side, grip in zip((1, -1), grips, strict=True):
        hip = pelvis + np.array([0.0, side * 0.050 * k, 0.0])
        ankle = _pedal(crank_rad, side) + np.array([-0.055, 0.0, 0.095])
        knee, ankle = reach(hip, ankle, THIGH * k, SHANK * k, (1.0, 0.0, 0.25))
        legs.append(Limb(hip, knee, ankle, 0.18))
        shoulder = shoulder_m(figure, pelvis, lean, side)
        elbow, wrist = reach(
            shoulder, grip + np.array([-0.06, 0.0, 0.02]), UPPER_ARM * k, FOREARM * k, (-0.2, 0.5 * side, -1.0)
        )
        arms.append(Limb(shoulder, elbow, wrist))
    return Pose(pelvis, lean, (legs[0], legs[1]), (arms[0], arms[1]), 0.5)


def _pedal(crank_rad: float, side: int) -> Array:
    angle = crank_rad if side > 0 else crank_rad + np.pi
    return _BRACKET + np.array([_CRANK_M * np.sin(angle), side * 0.13, _CRANK_M * np.cos(angle)])


def _parts(build: Build, roll_rad: float, crank_rad: float) -> list[Mesh]:
    parts = [*_wheel(_REAR, roll_rad), *_wheel(_FRONT, roll_rad + 0.3), *_frame(build), *_drive(crank_rad)]
    if build.guards:
        parts += [_guard(_REAR, -0.6, 2.5), _guard(_FRONT, 0.55, 2.6)]
    if build.rack:
        parts += _rack()
    if build.basket:
        parts += _basket()
    return parts


def _wheel(centre: Array, roll_rad: float, spokes: int = 20) -> list[Mesh]:
    parts = [
        torus(centre, WHEEL_M - 0.020, 0.020, "tyre", 44, 8),
        torus(centre, WHEEL_M - 0.044, 0.011, "chrome", 44, 6),
        ellipsoid(centre, (0.028, 0.042, 0.028), "chrome", 8, 5),
    ]
    for number in range(spokes):
        angle = roll_rad + number / spokes * 2 * np.pi
        # forward is clockwise seen from the left (from +y), so z decreases where x leads
        rim = centre + (WHEEL_M - 0.045) * np.array([np.sin(angle), 0.0, np.cos(angle)])
        hub = centre + np.array([0.0, 0.03 if number % 2 else -0.03, 0.0])
        parts.append(tube([hub, rim], 0.0020, "chrome", 4, round_ends=False))
    return parts


def _rod(start: ArrayLike, end: ArrayLike, radius_m: float, material: str = "frame") -> Mesh:
    return tube(np.stack([np.asarray(start), np.asarray(end)]), radius_m, material, 8, round_ends=False)


def _around(centre: Array, half: tuple[float, float, float]) -> tuple[Array, Array]:
    return centre - np.array(half), centre + np.array(half)


def _frame(build: Build) -> list[Mesh]:
    saddle = build.saddle
    down = (_BRACKET - saddle) / np.linalg.norm(_BRACKET - saddle)
    joint = saddle + 0.22 * down
    low_joint = saddle + 0.42 * down
    parts = [_rod(_BRACKET, joint, 0.0165), _rod(_BRACKET, _CROWN, 0.020), _rod(_CROWN, _HEAD, 0.021)]
    if build.step_through:
        parts.append(_rod(low_joint, _CROWN + np.array([-0.02, 0, 0.06]), 0.017))
    else:
        parts.append(_rod(joint + np.array([0.01, 0, -0.02]), _HEAD + np.array([0, 0, -0.04]), 0.0165))
    for side in (0.055, -0.055):
        drop = _REAR + np.array([0.0, side, 0.0])
        parts += [_rod(drop, _BRACKET, 0.011), _rod(drop, low_joint if build.step_through else joint, 0.010)]
        parts.append(_rod(_FRONT + np.array([0.0, side, 0.0]), _CROWN + np.array([0.0, 0.6 * side, -0.03]), 0.014))
    parts += [
        _rod(joint, saddle + np.array([0.01, 0, -0.01]), 0.0135, "chrome"),
        _rod(_HEAD, build.bar, 0.014, "chrome"),
    ]
    parts.append(ellipsoid(saddle + np.array([-0.035, 0, 0.01]), (0.10, 0.085, 0.035), "black", 12, 7))
    parts.append(ellipsoid(saddle + np.array([0.075, 0, 0.01]), (0.10, 0.030, 0.025), "black", 10, 6))
    for side in (1, -1):
        outer = build.bar + np.array([-0.02, side * 0.20, 0.03])
        parts.append(
            tube(
                [build.bar, build.bar + np.array([0.0, side * 0.08, 0.01]), outer, build.grip(side)],
                0.0125,
                "chrome",
                8,
            )
        )
        grip = [build.grip(side) + np.array([0.04, -side * 0.02, 0.0]), build.grip(side) - np.array([0.07, 0.0, 0.0])]
        parts.append(tube(grip, 0.018, "black", 8))
    parts.append(ellipsoid(_HEAD + np.array([0.075, 0, -0.02]), (0.035, 0.03, 0.03), "lens", 8, 6))
    lamp = saddle + np.array([-0.05, 0.0, -0.10])
    parts.append(box(*_around(lamp, (0.012, 0.025, 0.02)), "lens"))
    return parts


def _drive(crank_rad: float) -> list[Mesh]:
    ring = lathe([(-0.003, 0.05), (-0.003, 0.095), (0.003, 0.095), (0.003, 0.05)], "black", 22)
    parts = [ring.placed(0.0, _BRACKET + np.array([0.0, -0.05, 0.0]))]
    for side in (1, -1):
        pedal = _pedal(crank_rad, side)
        arm = np.array([0.0, -side * 0.06, 0.0])
        parts.append(_rod(_BRACKET + np.array([0.0, side * 0.07, 0.0]), pedal + arm, 0.011, "chrome"))
        parts.append(box(*_around(pedal, (0.045, 0.045, 0.012)), "black"))
    for height in (0.06, -0.06):
        back = _REAR + np.array([0.0, -0.05, 0.55 * height])
        parts.append(_rod(_BRACKET + np.array([0.0, -0.05, 1.5 * height]), back, 0.006, "black"))
    return parts


def _guard(centre: Array, first_rad: float, last_rad: float) -> Mesh:
    """A mudguard from an angle to another, 0 forward, rising over the top."""
    angle = np.linspace(first_rad, last_rad, 14)
    path = centre + (WHEEL_M + 0.018) * np.stack([np.cos(angle), np.zeros(14), np.sin(angle)], axis=1)
    return tube(path, 0.008, "frame", 6, squash=3.4, round_ends=False)


def _rack() -> list[Mesh]:
    top = 0.76
    parts = [_rod((-0.76, y, top), (-0.34, y, top), 0.006, "black") for y in (-0.06, 0.0, 0.06)]
    parts += [_rod((x, -0.06, top), (x, 0.06, top), 0.006, "black") for x in (-0.74, -0.55, -0.36)]
    return parts + [_rod((-0.54, y, WHEEL_M), (-0.62, y, top), 0.006, "black") for y in (-0.065, 0.065)]


def _basket() -> list[Mesh]:
    low = _HEAD + np.array([0.12, 0.0, -0.02])
    parts = []
    for height in np.linspace(0.0, 0.22, 5):
        x, y = 0.13 + 0.15 * height, 0.16 + 0.2 * height
        corners = low + np.array([[-x, -y, height], [x, -y, height], [x, y, height], [-x, y, height], [-x, -y, height]])
        corners[:, 0] += 0.10
        parts += [_rod(a, b, 0.004, "black") for a, b in pairwise(corners)]
    for part in np.linspace(-1, 1, 7):
        for x in (-0.03, 0.23):
            foot = low + np.array([x, 0.16 * part, 0.0])
            parts.append(_rod(foot, foot + np.array([0.03 if x > 0 else -0.03, 0.045 * part, 0.22]), 0.003, "black"))
    return parts
