"""Where the joints of a person are: walking at a phase of the gait, or reaching for given points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.scenes.mesh import rotation
from pipeline.scenes.objects.figure import ANKLE, FOREARM, HIP, SHANK, SHOULDER, THIGH, UPPER_ARM, Figure

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Limb:
    """Three joints and what hangs at the end.

    Attributes:
        root: (3,) hip or shoulder.
        middle: (3,) knee or elbow.
        end: (3,) ankle or wrist.
        pitch_rad: of the foot: toes down is positive.
    """

    root: Array
    middle: Array
    end: Array
    pitch_rad: float = 0.0


@dataclass(frozen=True)
class Pose:
    """All joints, metres, x forward.

    Attributes:
        pelvis: (3,) middle between the hips.
        lean_rad: forward lean of the trunk.
        legs: left and right.
        arms: left and right.
        spread_rad: largest angle of a thigh from the vertical (skirts and coats must span it).
    """

    pelvis: Array
    lean_rad: float
    legs: tuple[Limb, Limb]
    arms: tuple[Limb, Limb]
    spread_rad: float


def sole(figure: Figure) -> Array:
    """(2, 3) heel and tip of the sole, from the ankle, for a level foot."""
    k = figure.height_m
    return np.array([[-0.036, 0.0, -ANKLE], [0.115, 0.0, -ANKLE]]) * k


def walking(figure: Figure, phase_rad: float) -> Pose:
    """A pose of the gait; the lowest point of the soles is on z = 0.

    A thigh swings forward as ``A sin(phase)`` and back so that its foot, on the ground, keeps pace with the body;
    a knee bends by up to about 50 degrees while its leg swings forward (Winter 2009); heels strike with the toes
    up, and push off with the toes down; arms oppose the legs.
    """
    k, swing = figure.height_m, figure.swing_rad
    effort = min(swing / 0.4, 1.0)
    pelvis = np.array([0.0, 0.0, HIP * k])
    legs = []
    for side, phase in ((1, phase_rad), (-1, phase_rad + np.pi)):
        thigh = float(np.arcsin(np.sin(swing) * _step(phase))) + 0.05 * effort
        knee = 0.07 + 0.85 * effort * max(0.0, np.cos(phase + 0.45)) ** 1.5
        shank = thigh - knee
        hip = pelvis + np.array([0.0, side * 0.050 * k, 0.0])
        middle = hip + THIGH * k * np.array([np.sin(thigh), 0.0, -np.cos(thigh)])
        end = middle + SHANK * k * np.array([np.sin(shank), side * -0.010, -np.cos(shank)])
        push = max(0.0, -np.sin(phase + 0.3)) * effort
        strike = max(0.0, np.sin(phase - 0.3)) ** 3 * effort
        legs.append(Limb(hip, middle, end, float(0.75 * push - 0.30 * strike)))
    low = min(_sole_height(figure, leg) for leg in legs)
    lift = np.array([0.0, 0.0, -low])
    legs = [Limb(leg.root + lift, leg.middle + lift, leg.end + lift, leg.pitch_rad) for leg in legs]
    pelvis = pelvis + lift
    arms = []
    for side, phase in ((1, phase_rad + np.pi), (-1, phase_rad)):
        upper = 0.85 * swing * float(np.sin(phase)) - 0.03
        bend = 0.22 + 0.45 * effort * max(0.0, np.sin(phase))
        shoulder = shoulder_m(figure, pelvis, figure.lean_rad, side)
        out = 0.16 + 0.05 * figure.build
        elbow = shoulder + UPPER_ARM * k * _unit([np.sin(upper), side * out, -np.cos(upper)])
        wrist = elbow + FOREARM * k * _unit([np.sin(upper + bend), side * -0.02, -np.cos(upper + bend)])
        arms.append(Limb(shoulder, elbow, wrist))
    return Pose(pelvis, figure.lean_rad, (legs[0], legs[1]), (arms[0], arms[1]), swing + 0.06)


def shoulder_m(figure: Figure, pelvis: Array, lean_rad: float, side: int) -> Array:
    """Shoulder joint (3,) of a side (1 left, -1 right) for a leaning trunk."""
    k = figure.height_m
    width = 0.102 * figure.build * (0.90 if figure.female else 1.02)
    return pelvis + rotation(lean_rad, "y") @ np.array([0.0, side * width * k, SHOULDER * k])


def reach(
    root: ArrayLike, target: ArrayLike, upper_m: float, lower_m: float, towards: ArrayLike
) -> tuple[Array, Array]:
    """Middle and end joints of a limb that reaches for a point (law of cosines).

    Args:
        root: (3,) hip or shoulder.
        target: (3,) where the end shall be; moved nearer if out of reach.
        upper_m: length of the first bone.
        lower_m: length of the second.
        towards: (3,) direction in which the middle joint bends.
    """
    root, target = np.asarray(root, np.float64), np.asarray(target, np.float64)
    line = target - root
    distance = float(np.clip(np.linalg.norm(line), abs(upper_m - lower_m) + 1e-3, upper_m + lower_m - 1e-3))
    line /= np.linalg.norm(line)
    bend = np.asarray(towards, np.float64)
    bend = _unit(bend - line * (bend @ line))
    along = (upper_m**2 - lower_m**2 + distance**2) / (2 * distance)
    across = np.sqrt(max(upper_m**2 - along**2, 0.0))
    return root + along * line + across * bend, root + distance * line


def _step(phase_rad: float) -> float:
    """Place of a foot between its last (-1) and its foremost (1) point: a sine forward, a straight line back."""
    phase = float(np.mod(phase_rad, 2 * np.pi))
    if np.pi / 2 < phase < 3 * np.pi / 2:
        return 2.0 - 2.0 * phase / np.pi
    return float(np.sin(phase))


def _sole_height(figure: Figure, leg: Limb) -> float:
    turned = sole(figure) @ rotation(leg.pitch_rad, "y").T
    return float((leg.end + turned)[:, 2].min())


def _unit(vector: ArrayLike) -> Array:
    vector = np.asarray(vector, np.float64)
    return np.asarray(vector / np.linalg.norm(vector))
