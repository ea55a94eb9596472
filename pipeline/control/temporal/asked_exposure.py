"""The total exposure that a policy asks for, carried across the steps that a camera rounds it to.

A law that multiplies total exposure by factors near 1 would never move without it: at six exposure times per stop
whatever changes the exposure by less than 6 % is rounded away, frame after frame.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from pipeline.control.decision import Action, Decision
from pipeline.control.state import CameraState, Limits


class AskedExposure:
    """What was asked for with the settings written last.

    Args:
        limits: of the camera.
        exposure_max_s: a lower limit of the exposure time than the camera's, s; None for none.
    """

    def __init__(self, limits: Limits, exposure_max_s: float | None = None) -> None:
        self.limits, self.exposure_max_s = limits, exposure_max_s
        self._written: deque[tuple[CameraState, float]] = deque(maxlen=limits.delay_frames + 1)

    def decision(self, factor: float, state: CameraState, reason: str, to_target: float | None = None) -> Decision:
        """Settings of a factor times the total exposure that was asked for when those of a frame were written.

        Args:
            factor: above 0.
            state: settings that the frame was taken with. Where these were not asked for, as in the first frames, their
                own total exposure counts.
            reason: one sentence.
            to_target: factor on the frame's total exposure that brings its level to the target. Where the camera's
                steps have none nearer to it than the settings written last, these are kept: a law would else step over
                its dead band to and fro. None keeps none.
        """
        longest_s = self.limits.exposure_max_s if self.exposure_max_s is None else self.exposure_max_s
        least_s, most_s = self.limits.exposure_min_s * self.limits.gain_min, longest_s * self.limits.gain_max
        if to_target is not None and self._is_nearest(self.kept(state), state.total_exposure_s * to_target):
            return self._keep(self.kept(state), state, f"{reason}; no step of the camera is nearer to the target")
        total_s = min(max(self._asked_s(state) * factor, least_s), most_s)
        new = self.limits.time_first(total_s, self.exposure_max_s)
        self._written.append((new, total_s))
        return Decision(new, Action.HOLD if new == state else Action.MOVE, reason)

    def hold(self, state: CameraState, reason: str, accepts: Callable[[float], bool]) -> Decision:
        """The settings written last, or those of a frame; what was asked for with them stays.

        With a delay, frames in turn could else keep settings that differ, for ever.

        Args:
            state: settings that the frame was taken with.
            reason: one sentence.
            accepts: whether the law would hold at so many times the frame's total exposure.
        """
        kept = self.kept(state)
        is_accepted = accepts(kept.total_exposure_s / state.total_exposure_s)
        return self._keep(kept if is_accepted else state, state, reason)

    def kept(self, state: CameraState) -> CameraState:
        """The settings written last; those of a frame where these are in force, or where they were not asked for."""
        delay, written = self.limits.delay_frames, self._written
        is_asked = len(written) <= delay or state.is_nearly(written[0][0])
        return written[-1][0] if delay and written and is_asked else state

    def _keep(self, kept: CameraState, state: CameraState, reason: str) -> Decision:
        asked_s = self._asked_s(state) if kept is state else self._written[-1][1]
        self._written.append((kept, asked_s))
        return Decision(kept, Action.HOLD, reason)

    def _is_nearest(self, kept: CameraState, wanted_s: float) -> bool:
        """Whether the camera has no total exposure nearer to one wanted than that of settings kept, in stops.

        Settings that the camera's limits or the cap do not allow are never kept for that.
        """
        if self.exposure_max_s is not None and kept.exposure_s > self.exposure_max_s * (1 + 1e-9):
            return False
        on_a_step = self.limits.nearest(kept.exposure_s, kept.gain)
        if not kept.is_nearly(on_a_step):
            return False
        nearest = self.limits.time_first(wanted_s, self.exposure_max_s)
        return on_a_step.error_stops(wanted_s) <= nearest.error_stops(wanted_s) + 1e-9

    def _asked_s(self, state: CameraState) -> float:
        """Total exposure asked for with settings that take effect `delay_frames` frames after the next one, s."""
        if len(self._written) == self._written.maxlen:
            written, asked_s = self._written[0]
            if state.is_nearly(written):
                return asked_s
        return state.total_exposure_s
