"""The split with the highest expected average precision, every frame, made fit for a robot.

Four additions to `iopc_optimal`: hysteresis (a change must promise a point), a rate limit, a hard cap on motion blur
at the upper end of its interval (``t <= d_max / v``), and exposure times in whole periods of lamp flicker.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pipeline.control.decision import Action, Decision
from pipeline.control.iopc import Candidates, IopcPolicy
from pipeline.control.observation import Observation
from pipeline.control.performance import Performance
from pipeline.control.policy import ControlledCamera
from pipeline.control.state import CameraState
from pipeline.errors import InputError


class IopcContinuous(IopcPolicy):
    """Argmax every frame with hysteresis, rate limit, cap and flicker periods.

    Args:
        camera: see `Policy`.
        performance: surface asked.
        target: see `IopcPolicy`.
        tolerance: see `IopcPolicy`.
        least_gain_percent: points that a change must promise; more after reversals (see `IopcPolicy`).
        stops_per_frame: largest change of the exposure time, factors of two, as long as the gain can take the rest.
        max_motion_px: hard cap of motion blur.
        lamp_hz: frequency of light flicker (twice the mains frequency); 0 for none. Where the brightness allows it,
            exposure times are whole periods.
        margin: see `IopcPolicy`.
    """

    def __init__(
        self,
        camera: ControlledCamera,
        performance: Performance | None = None,
        target: float | None = 0.5,
        tolerance: float = 0.1,
        least_gain_percent: float = 1.0,
        stops_per_frame: float = 2.0,
        max_motion_px: float = 20.0,
        lamp_hz: float = 0.0,
        margin: float = 0.2,
    ) -> None:
        super().__init__(camera, performance, target, tolerance, margin, least_gain_percent)
        if stops_per_frame <= 0 or max_motion_px <= 0 or lamp_hz < 0:
            raise InputError(
                "policy iopc_continuous: expected lamp_hz of at least 0, stops_per_frame and max_motion_px above 0"
            )
        self.stops_per_frame, self.max_motion_px, self.lamp_hz = stops_per_frame, max_motion_px, lamp_hz

    def choose(self, observation: Observation, state: CameraState, total: float, factor: float) -> Decision:
        """See `IopcPolicy.choose`."""
        among = self._allowed(self.candidates(observation, state, total))
        choice = self.compare(observation, state, total, among)
        new, action, expected = choice.state, choice.action, choice.ap_percent
        if self._inside(choice.kept) and not choice.improves(self.hysteresis.required_percent):
            new, action, expected = (self.held(state, factor, choice)), Action.MOVE, choice.kept_ap_percent
        ordered = self.ordered(state)
        new = self._limited(new, ordered)
        if new == ordered and action is not Action.REFUSED:
            action = Action.HOLD
        motion = self.speed_px_s * new.exposure_s
        return Decision(new, action, f"speed {self.speed_px_s:.0f} px/s, motion {motion:.1f} px expected", expected)

    def _inside(self, state: CameraState) -> bool:
        """Whether settings respect the cap and the lamp."""
        capped = self.speed_high_px_s * state.exposure_s <= self.max_motion_px * (1 + 1e-9)
        if not self.lamp_hz:
            return capped
        periods = state.exposure_s * self.lamp_hz
        return capped and (periods < 0.95 or abs(periods - round(periods)) < 0.06)

    def _allowed(self, among: Candidates) -> Candidates:
        """Candidates inside cap and lamp periods; the shortest one if there is none."""
        states = among.states
        chosen = np.array([self._inside(state) for state in states])
        if self.lamp_hz:
            whole = np.array([round(state.exposure_s * self.lamp_hz) >= 1 for state in states])
            if (chosen & whole).any():
                chosen &= whole
        if not chosen.any():
            chosen[0] = True
        keep = np.flatnonzero(chosen)
        return replace(
            among,
            states=[states[number] for number in keep],
            sigma_dn=among.sigma_dn[keep],
            motion_px=among.motion_px[keep],
            ap_percent=among.ap_percent[keep],
            value=among.value[keep],
            excess=among.excess[keep],
        )

    def _limited(self, new: CameraState, state: CameraState) -> CameraState:
        """Exposure time within the rate limit; the gain keeps the brightness."""
        stops = math.log2(new.exposure_s / state.exposure_s)
        if abs(stops) <= self.stops_per_frame + 1e-9:
            return new
        time = state.exposure_s * 2.0 ** math.copysign(self.stops_per_frame, stops)
        return self.limits.at_time(new.total_exposure_s, time)
