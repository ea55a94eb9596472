"""Proportions of five kinds of car, as side-view curves."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CarType:
    """A kind of car. Positions along the car are fractions t of its length, 0 at the nose, 1 at the tail.

    Attributes:
        length_m: mean length.
        width_m: mean width without mirrors.
        wheel_m: outer radius of a wheel.
        top: (t, z in metres) of the upper contour: bonnet, windscreen, roof, rear screen, tail.
        belt_m: height of the lower edge of the side windows at the nose and at the tail (a straight line).
        axles: t of the axles.
        pillars: t of the dark pillars between the doors, B (and C).
        side_glass: first and last t of the side windows.
        tumble: inward lean of the side windows, metres per metre of height.
        lamps_m: height of the lower edge of the head lamps and of the tail lamps.
        tall_tail: tail lamps stand upright (hatchbacks, vans) rather than lie.
        seats: t of the backs of the rows of seats.
    """

    length_m: float
    width_m: float
    wheel_m: float
    top: tuple[tuple[float, float], ...]
    belt_m: tuple[float, float]
    axles: tuple[float, float]
    pillars: tuple[float, ...]
    side_glass: tuple[float, float]
    tumble: float
    lamps_m: tuple[float, float]
    tall_tail: bool
    seats: tuple[float, ...]


CAR_TYPES: dict[str, CarType] = {
    "sedan": CarType(
        4.70, 1.83, 0.325,
        ((0, 0.57), (0.008, 0.67), (0.03, 0.745), (0.10, 0.82), (0.22, 0.915), (0.29, 0.97),
         (0.41, 1.32), (0.465, 1.41), (0.55, 1.46), (0.65, 1.445), (0.74, 1.36), (0.86, 1.105),
         (0.90, 1.07), (0.97, 1.045), (0.992, 0.95), (1, 0.70)),
        (0.88, 1.00), (0.19, 0.785), (0.575,), (0.325, 0.815), 0.27, (0.60, 0.80), False, (0.555, 0.76),
    ),
    "hatch": CarType(
        4.10, 1.77, 0.315,
        ((0, 0.60), (0.008, 0.70), (0.03, 0.775), (0.10, 0.85), (0.22, 0.955), (0.27, 1.005),
         (0.40, 1.37), (0.465, 1.455), (0.57, 1.50), (0.75, 1.475), (0.88, 1.41), (0.905, 1.37),
         (0.955, 1.12), (0.975, 1.00), (0.993, 0.92), (1, 0.70)),
        (0.90, 1.02), (0.20, 0.815), (0.60,), (0.31, 0.875), 0.25, (0.62, 0.84), True, (0.575, 0.80),
    ),
    "suv": CarType(
        4.55, 1.88, 0.365,
        ((0, 0.72), (0.008, 0.86), (0.03, 0.945), (0.10, 1.015), (0.20, 1.09), (0.26, 1.145),
         (0.375, 1.54), (0.43, 1.63), (0.55, 1.69), (0.75, 1.675), (0.90, 1.61), (0.925, 1.565),
         (0.962, 1.27), (0.978, 1.12), (0.994, 0.98), (1, 0.74)),
        (1.03, 1.13), (0.195, 0.81), (0.57, 0.77), (0.305, 0.90), 0.25, (0.77, 0.95), True, (0.555, 0.765),
    ),
    "van": CarType(
        4.90, 1.93, 0.335,
        ((0, 0.68), (0.008, 0.83), (0.03, 0.945), (0.09, 1.06), (0.145, 1.16), (0.165, 1.205),
         (0.285, 1.74), (0.335, 1.87), (0.44, 1.94), (0.75, 1.955), (0.93, 1.93), (0.955, 1.88),
         (0.985, 1.50), (0.993, 1.15), (0.997, 0.95), (1, 0.72)),
        (1.06, 1.13), (0.175, 0.80), (0.43, 0.68), (0.225, 0.935), 0.17, (0.76, 1.00), True, (0.415, 0.62, 0.82),
    ),
    "wagon": CarType(
        4.70, 1.82, 0.325,
        ((0, 0.57), (0.008, 0.67), (0.03, 0.75), (0.10, 0.83), (0.22, 0.925), (0.285, 0.975),
         (0.405, 1.33), (0.46, 1.42), (0.56, 1.475), (0.77, 1.46), (0.89, 1.405), (0.915, 1.365),
         (0.957, 1.11), (0.976, 1.00), (0.993, 0.91), (1, 0.70)),
        (0.89, 0.99), (0.19, 0.79), (0.555, 0.75), (0.32, 0.89), 0.26, (0.60, 0.82), True, (0.535, 0.735),
    ),
}  # fmt: skip
