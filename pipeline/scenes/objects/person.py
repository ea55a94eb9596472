"""Pedestrians: a figure in a pose of walking."""

from __future__ import annotations

import numpy as np

from pipeline.scenes.objects.base import SceneObject
from pipeline.scenes.objects.brush import Flat
from pipeline.scenes.objects.figure import Figure
from pipeline.scenes.objects.person_body import mesh
from pipeline.scenes.objects.person_paint import SkinPaint, TopPaint
from pipeline.scenes.objects.pose import Pose, walking


def make(generator: np.random.Generator, phase_rad: float = 0.0, travel_m: float = 0.0) -> SceneObject:
    """A person at the origin, facing +x, soles on z = 0.

    The person is drawn before the pose is used: the same generator state at another phase is the same
    person, walking.

    Args:
        generator: random numbers.
        phase_rad: phase of the gait.
        travel_m: distance walked since; adds the phase at which the feet do not slide.
    """
    figure = Figure.draw(generator)
    phase = phase_rad + 2 * np.pi * travel_m / figure.cycle_m
    return dressed(figure, walking(figure, phase))


def dressed(figure: Figure, pose: Pose) -> SceneObject:
    """A figure in any pose, with its clothes and colours."""
    return SceneObject(
        mesh=mesh(figure, pose),
        label="person",
        kind=figure.outfit,
        tint={
            "top": figure.top,
            "trousers": figure.trousers,
            "skin": figure.skin,
            "hair": figure.hair_tone,
            "bag": figure.bag_tone,
        },
        paint={"top": TopPaint(figure), "skin": SkinPaint(figure), "shoe": Flat(figure.shoe, 0.02)},
    )
