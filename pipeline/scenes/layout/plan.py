"""A plan: everything in a scene and how it moves, from which the world at any time follows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.scenes.layout.traffic import Actor, Track
from pipeline.scenes.light import Light
from pipeline.scenes.pose import Pose
from pipeline.scenes.tone import Tone
from pipeline.scenes.world import World
from pipeline.streams import KeyPart, stream


@dataclass(frozen=True)
class Key:
    """Names the random streams of one viewpoint; every object has its own, so none depends on another's draws."""

    seed: int
    split: str
    number: int

    def stream(self, *parts: KeyPart) -> np.random.Generator:
        """A fresh generator for one purpose, the same at every call."""
        return stream(self.seed, "sim", self.split, self.number, *parts)


@dataclass(frozen=True)
class Camera:
    """A camera carried along a track.

    Attributes:
        track: course of the point on the ground beneath it.
        height_m: above that point.
        turn_rad: heading relative to the track's.
        pitch_rad, roll_rad: see `Pose`.
        focal_px: at a width of 896 pixels.
    """

    track: Track
    height_m: float
    turn_rad: float = 0.0
    pitch_rad: float = 0.0
    roll_rad: float = 0.0
    focal_px: float = 760.0

    def pose(self, time_s: float, width_px: int, height_px: int) -> Pose:
        """Where it is at a time; the field of view does not depend on the number of pixels."""
        stance = self.track.at(time_s)
        return Pose(
            (stance.x_m, stance.y_m, stance.z_m + self.height_m),
            stance.yaw_rad + self.turn_rad,
            self.pitch_rad,
            self.roll_rad,
            self.focal_px * width_px / 896.0,
            width_px,
            height_px,
        )


@dataclass(frozen=True)
class Plan:
    """A scene in motion.

    Attributes:
        actors: everything in it, moving or not.
        camera: who looks.
        light: sun, sky and haze.
        tone: exposure and curve of the camera.
    """

    actors: tuple[Actor, ...]
    camera: Camera
    light: Light
    tone: Tone

    def world(self, time_s: float) -> World:
        """Everything where it is at a time, ready for rays."""
        return World([actor.placed(time_s) for actor in self.actors])


def weather(key: Key, heading_rad: float) -> tuple[Light, Tone]:
    """Light and exposure of a viewpoint: a sun behind one shoulder of the camera, from hazy to clear.

    Args:
        key: of the viewpoint.
        heading_rad: where the camera looks at t = 0.
    """
    generator = key.stream("weather")
    side = generator.choice([-1.0, 1.0])
    clear = generator.uniform(0.0, 1.0)
    light = Light(
        azimuth_rad=heading_rad + np.pi + side * generator.uniform(0.3, 1.45),
        elevation_rad=generator.uniform(0.42, 0.95),
        sun=2.8 + 1.2 * clear,
        ambient=0.68 - 0.20 * clear,
        sky=generator.uniform(1.1, 1.7),
        cover=generator.uniform(0.25, 0.75),
        clouds=(float(generator.uniform()), float(generator.uniform())),
        haze_m=generator.uniform(500.0, 1100.0),
    )
    return light, Tone(exposure=float(generator.uniform(0.38, 0.50)), gamma=float(generator.uniform(1.5, 2.0)))
