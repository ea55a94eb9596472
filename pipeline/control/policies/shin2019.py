"""Noise-aware image quality maximised by a simplex search over exposure and gain (Shin et al. 2019).

Every evaluation is a captured frame, which the robot sees too: probes are decisions like any other. The published
program searches raw microseconds and decibels, starts degenerate at 0 dB and ends after one search per scene; here both
axes run over [0, 1] (exposure in stops, gain in dB), the first steps are at least a tenth of the range, and a new
search starts when quality or mean level has moved by more than 10 % for three frames. The first step is the paper's:
up by ``1.7 (1 - I)`` for a dark frame, down by ``I / 1.7`` for a bright one. A frame is judged once it was taken with
the settings asked for, as nearly as the camera has them.
"""

from __future__ import annotations

import math
from collections.abc import Generator

import numpy as np

from pipeline.control.decision import Action, Decision
from pipeline.control.image.image_quality import quality
from pipeline.control.observation import Observation
from pipeline.control.options import is_count
from pipeline.control.performance import Performance
from pipeline.control.policy import ControlledCamera, Policy
from pipeline.control.state import CameraState
from pipeline.control.temporal.nelder_mead import Point, search
from pipeline.errors import InputError

LEAST_STEP = 0.1
CHANGE = 0.10
PATIENCE = 3
CORNERS = 3
"""Of the simplex over exposure time and gain that a search starts from."""


class Shin2019(Policy):
    """Simplex search, hold, search again after a change.

    Args:
        camera: see `Policy`.
        performance: not used.
        probes: evaluations of one search at most, at least the three that it starts from.
        tolerance: of the search, at least 0.

    Raises:
        InputError: an option out of range.
    """

    def __init__(
        self,
        camera: ControlledCamera,
        performance: Performance | None = None,
        probes: int = 50,
        tolerance: float = 1e-5,
    ) -> None:
        super().__init__(camera, performance)
        if not (is_count(probes) and probes >= CORNERS):
            raise InputError(f"policy Shin2019: probes is {probes!r}; expected a whole number of at least {CORNERS}")
        self.check("tolerance", tolerance, "a number of at least 0", lambda value: 0 <= value < math.inf)
        self.probes, self.tolerance = probes, tolerance
        self._search: Generator[Point, float, tuple[Point, float]] | None = None
        self._asked: CameraState | None = None
        self._waited = 0
        self._held: tuple[float, float] | None = None
        self._strange = 0

    def decide(self, observation: Observation, state: CameraState) -> Decision:
        """See `Policy.decide`."""
        value = quality(observation.image).value
        if self._search is None and self._held is None:
            return self._start(observation, state)
        assert self._asked is not None
        if not self._arrived(state, self._asked):
            action = Action.HOLD if self._search is None else Action.PROBE
            return Decision(self._asked, action, "the settings asked for are still on their way to the sensor")
        if self._search is not None:
            try:
                point = self._search.send(-value)
            except StopIteration as end:
                self._search = None
                best, objective = end.value
                self._strange, self._held = 0, (-objective, math.nan)
                return self._ask(best, Action.MOVE, f"search ended at quality {-objective:.2f}")
            return self._ask(point, Action.PROBE, f"probe after quality {value:.2f}")
        return self._watch(observation, state, value)

    def _arrived(self, state: CameraState, asked: CameraState) -> bool:
        """Whether a frame shows the settings asked for, or as near to them as the camera comes."""
        self._waited += 1
        return state.is_nearly(asked) or self._waited > self.limits.delay_frames + PATIENCE

    def _watch(self, observation: Observation, state: CameraState, value: float) -> Decision:
        assert self._held is not None and self._asked is not None
        held, mean = self._held
        if math.isnan(mean):
            self._held = (value, observation.mean_level)
            return Decision(self._asked, Action.HOLD, f"quality {value:.2f} is kept")
        moved = abs(value - held) > CHANGE * max(abs(held), 0.1) or abs(observation.mean_level - mean) > CHANGE * mean
        self._strange = self._strange + 1 if moved else 0
        if self._strange >= PATIENCE:
            self._held = None
            return self._start(observation, state)
        return Decision(self._asked, Action.HOLD, f"quality {value:.2f} is kept")

    def _start(self, observation: Observation, state: CameraState) -> Decision:
        """First probe of a new search, from the present settings."""
        level, here = observation.mean_level, self._point(state)
        change = 1.7 * (1.0 - level) if level < 0.5 else -level / 1.7
        stops = math.log2(1.0 + change)
        time_step = stops / self._stops()
        gain_step = 20.0 * math.log10(1.0 + change) / max(self._decibels(), 1e-9)
        simplex = np.stack([here, here, here])
        for row, axis, step in ((1, 0, time_step), (2, 1, gain_step)):
            wanted = math.copysign(max(abs(step), LEAST_STEP), step)
            moved = here[axis] + wanted
            simplex[row, axis] = moved if 0.0 <= moved <= 1.0 else here[axis] - wanted
        self._search, self._strange = search(simplex, self.tolerance, self.probes), 0
        return self._ask(next(self._search), Action.PROBE, "new search")

    def _ask(self, point: Point, action: Action, reason: str) -> Decision:
        self._asked, self._waited = self._state(point), 0
        return Decision(self._asked, action, reason)

    def _stops(self) -> float:
        return max(math.log2(self.limits.exposure_max_s / self.limits.exposure_min_s), 1e-9)

    def _decibels(self) -> float:
        return 20.0 * math.log10(self.limits.gain_max / self.limits.gain_min)

    def _point(self, state: CameraState) -> Point:
        time = math.log2(state.exposure_s / self.limits.exposure_min_s) / self._stops()
        gain = 20.0 * math.log10(state.gain / self.limits.gain_min) / max(self._decibels(), 1e-9)
        return np.clip([time, gain], 0.0, 1.0)

    def _state(self, point: Point) -> CameraState:
        time = self.limits.exposure_min_s * 2.0 ** (float(point[0]) * self._stops())
        gain = self.limits.gain_min * 10.0 ** (float(point[1]) * self._decibels() / 20.0)
        return self.limits.nearest(time, gain)
