"""Scenarios of the closed loop: light, speed and disturbances over time, as configuration.

Light and speed are knots ``[step, value]``; between knots light is interpolated geometrically and speed linearly,
beyond them both are constant. Neighbouring knots one step apart make a step.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field

import numpy as np

from pipeline.control.settings import EstimatorFault
from pipeline.control.state import CameraState, Limits
from pipeline.errors import InputError

POOR_LIGHT, MOVING_PX_S = 0.25, 100.0
"""Light up to which, and speed from which, motion and noise have to be traded."""

_NEARLY = 1e-9  # interpolated light errs by rounding


@dataclass(frozen=True)
class Flicker:
    """Lamp flicker: light times ``1 + depth sin(2 pi f t)``, averaged over the exposure.

    Attributes:
        frequency_hz: of the light (twice the mains frequency); 0 for none.
        depth: amplitude, 0..1.
    """

    frequency_hz: float = 0.0
    depth: float = 0.0

    def factor(self, start_s: float, exposure_s: float) -> float:
        """Mean light of an exposure that starts at a time, relative to steady light."""
        if not self.frequency_hz or not self.depth:
            return 1.0
        turn = 2.0 * math.pi * self.frequency_hz
        change = math.cos(turn * start_s) - math.cos(turn * (start_s + exposure_s))
        return 1.0 + self.depth * change / (turn * exposure_s)


@dataclass(frozen=True)
class Scenario:
    """One drive.

    Attributes:
        name: in the configuration.
        steps: frames.
        light: knots of the illumination, 1 is full daylight of the rendered scenes.
        speed_px_s: knots of the image's speed.
        direction_deg: of the motion.
        start: settings of the first frame; see `first_state`.
        frame_period_s: between frames.
        delay_frames: see `Limits`.
        sun_radius_fraction: radius of a sun in the picture, fraction of its width; 0 for none.
        flicker: of the lamps.
        fault: of the estimator.
    """

    name: str
    steps: int
    light: tuple[tuple[float, float], ...]
    speed_px_s: tuple[tuple[float, float], ...]
    start: CameraState
    direction_deg: float = 0.0
    frame_period_s: float = 1.0 / 30.0
    delay_frames: int = 0
    sun_radius_fraction: float = 0.0
    flicker: Flicker = field(default_factory=Flicker)
    fault: EstimatorFault = field(default_factory=EstimatorFault)

    def __post_init__(self) -> None:
        for name, knots, least in (("light", self.light, 1e-9), ("speed_px_s", self.speed_px_s, 0.0)):
            places = [knot[0] for knot in knots]
            if not knots or sorted(set(places)) != places or any(not least <= knot[1] < math.inf for knot in knots):
                raise InputError(
                    f"scenario '{self.name}': {name} is a list of [step, value] with rising steps and finite "
                    f"values of at least {least:g}, got {knots!r}"
                )

    def light_at(self, step: int, exposure_s: float) -> float:
        """Mean illumination during the exposure of a step, flicker included."""
        return self._steady_light_at(step) * self.flicker.factor(step * self.frame_period_s, exposure_s)

    def _steady_light_at(self, step: int) -> float:
        """Illumination at a step without flicker."""
        places, values = np.array(self.light).T
        return float(np.exp(np.interp(step, places, np.log(values))))

    def speed_at(self, step: int) -> float:
        """Speed of the image at a step, px/s."""
        places, values = np.array(self.speed_px_s).T
        return float(np.interp(step, places, values))

    @property
    def motion_in_poor_light(self) -> bool:
        """Whether at some step the light is at most a quarter of daylight and the image moves at 100 px/s or more.

        Flicker is not regarded. A correct exposure at base gain would blur by several pixels there: policies that know
        motion are expected to win.
        """
        return any(
            self._steady_light_at(step) <= POOR_LIGHT * (1 + _NEARLY)
            and self.speed_at(step) >= MOVING_PX_S * (1 - _NEARLY)
            for step in range(self.steps)
        )

    def first_state(self, limits: Limits) -> CameraState:
        """Settings of the first frame, on the steps of a camera.

        Args:
            limits: of the camera.

        Raises:
            InputError: `start` lies outside the limits.
        """
        return limits.stepped(self.start, f"scenario '{self.name}': start")

    @property
    def disturbances(self) -> list[int]:
        """Steps from which settling is measured: the start, and the ends of steep changes of light or speed."""
        results = [0]
        for knots, ratio in ((self.light, 2.0), (self.speed_px_s, 1.5)):
            for (before, old), (after, new) in itertools.pairwise(knots):
                if after - before <= 1.0 and max(old, new) > ratio * min(old, new):
                    results.append(int(after))
        return sorted(set(results))
