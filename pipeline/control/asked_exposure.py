"""The total exposure that a policy asks for, carried across the steps that a camera rounds it to.

A law that multiplies total exposure by factors near 1 would never move without it: at six exposure times per stop
whatever changes the exposure by less than 6 % is rounded away, frame after frame.
"""

from __future__ import annotations

from collections import deque

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

    def decision(self, factor: float, state: CameraState, reason: str) -> Decision:
        """Settings of a factor times the total exposure that was asked for when those of a frame were written.

        Args:
            factor: above 0.
            state: settings that the frame was taken with. Where these were not asked for, as in the first frames, their
                own total exposure counts.
            reason: one sentence.
        """
        longest_s = self.limits.exposure_max_s if self.exposure_max_s is None else self.exposure_max_s
        least_s, most_s = self.limits.exposure_min_s * self.limits.gain_min, longest_s * self.limits.gain_max
        total_s = min(max(self._asked_s(state) * factor, least_s), most_s)
        new = self.limits.time_first(total_s, self.exposure_max_s)
        self._written.append((new, total_s))
        return Decision(new, Action.HOLD if new == state else Action.MOVE, reason)

    def hold(self, state: CameraState, reason: str) -> Decision:
        """The settings of a frame, to be written again; what was asked for with them stays."""
        self._written.append((state, self._asked_s(state)))
        return Decision(state, Action.HOLD, reason)

    def _asked_s(self, state: CameraState) -> float:
        """Total exposure asked for with settings that take effect `delay_frames` frames after the next one, s."""
        if len(self._written) == self._written.maxlen:
            written, asked_s = self._written[0]
            if state.is_nearly(written):
                return asked_s
        return state.total_exposure_s
