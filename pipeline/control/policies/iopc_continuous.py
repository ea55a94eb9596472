"""The split with the highest expected average precision, every frame, made fit for a robot.

Three additions to `iopc_optimal`. Where they conflict, the first comes before the second and both before the third:

* a cap on motion blur, at the upper end of the interval of the image's speed: ``t <= d_max / v``;
* exposure times in whole periods of lamp flicker;
* a rate limit of the exposure time. Where it would stop between lamp periods or above the cap, the farthest exposure
  time within the limit that respects both is taken, or the next one on the way if there is none within it. The gain
  keeps the brightness meanwhile.

Brightness comes before all of them: where the highest gain does not suffice, the exposure time is the shortest of those
that give the brightness wanted (the lowest one measured, where darker frames were), whatever its motion blur. A frame
without an estimate is followed by a correction of brightness only, as in every `IopcPolicy`.
"""

from __future__ import annotations

import math

import numpy as np

from pipeline.control.iopc import Candidates, Choice, Frame, IopcPolicy
from pipeline.control.performance import Performance
from pipeline.control.policy import ControlledCamera
from pipeline.control.state import CameraState

PERIOD_TOLERANCE = 0.06
"""Of a lamp's period: so near to whole periods an exposure time counts as such."""


class IopcContinuous(IopcPolicy):
    """Argmax every frame with hysteresis, cap, flicker periods and rate limit.

    Args:
        camera: see `Policy`.
        performance: surface asked.
        target: see `IopcPolicy`.
        tolerance: see `IopcPolicy`.
        least_gain_percent: points that a change must promise; more after reversals (see `IopcPolicy`).
        stops_per_frame: rate limit, factors of two of the exposure time, above 0; exceeded where the range of the gain,
            the cap or the lamp leave no such step.
        max_motion_px: cap of motion blur, px, above 0; exceeded only where the highest gain does not suffice.
        lamp_hz: frequency of light flicker (twice the mains frequency); 0 for none. Where brightness and cap allow it,
            exposure times are whole periods (within `PERIOD_TOLERANCE`), else shorter than a period.
        margin: see `IopcPolicy`.

    Raises:
        InputError: an option out of range.
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
        super().__init__(camera, performance, target, tolerance, least_gain_percent, margin)
        for name, value in (("stops_per_frame", stops_per_frame), ("max_motion_px", max_motion_px)):
            self.check(name, value, "a number above 0", lambda number: number > 0)
        self.check("lamp_hz", lamp_hz, "a frequency of at least 0 Hz", lambda number: 0 <= number < math.inf)
        self.stops_per_frame, self.max_motion_px, self.lamp_hz = stops_per_frame, max_motion_px, lamp_hz

    def choose(self, frame: Frame) -> Choice:
        """See `IopcPolicy.choose`."""
        allowed = self._allowed(self.candidates(frame))
        wanted = allowed.states[self.preferred(frame, allowed)]
        new = self._limited(wanted, frame.written, allowed)
        motion = self.speed_px_s * new.exposure_s
        return Choice(new, f"speed {self.speed_px_s:.0f} px/s, motion {motion:.1f} px expected", allowed)

    def times(self, per_stop: int) -> list[float]:
        """See `IopcPolicy.times`; whole periods of the lamp as well."""
        periods = range(1, math.floor(self.limits.exposure_max_s * self.lamp_hz + PERIOD_TOLERANCE) + 1)
        return [*super().times(per_stop), *(number / self.lamp_hz for number in periods)]

    def _respects(self, state: CameraState) -> bool:
        """Whether settings respect the cap and the lamp."""
        capped = self.speed_high_px_s * state.exposure_s <= self.max_motion_px * (1 + 1e-9)
        return capped and (not self.lamp_hz or state.exposure_s * self.lamp_hz < 0.95 or self._is_periodic(state))

    def _is_periodic(self, state: CameraState) -> bool:
        """Whether an exposure time is one or several whole periods of the lamp."""
        periods = state.exposure_s * self.lamp_hz
        return round(periods) >= 1 and abs(periods - round(periods)) < PERIOD_TOLERANCE

    def _allowed(self, among: Candidates) -> Candidates:
        """Candidates that respect cap and lamp, whole periods if there are any; the shortest if there is none."""
        chosen = np.array([self._respects(state) for state in among.states])
        whole = chosen & np.array([self._is_periodic(state) for state in among.states])
        if whole.any():
            chosen = whole
        if not chosen.any():
            chosen[0] = True
        return among.where(chosen)

    def _limited(self, wanted: CameraState, written: CameraState, allowed: Candidates) -> CameraState:
        """The next settings on the way to those wanted, within the rate limit if cap and lamp allow it.

        Args:
            wanted: settings to reach.
            written: settings written last.
            allowed: candidates that respect cap and lamp, those wanted among them.
        """

        def stops(exposure_s: float) -> float:
            return math.log2(exposure_s / written.exposure_s)

        total_s, whole_way, limit = wanted.total_exposure_s, stops(wanted.exposure_s), self.stops_per_frame + 1e-9
        if abs(whole_way) <= limit:
            return wanted
        farthest_s = written.exposure_s * 2.0 ** math.copysign(self.stops_per_frame, whole_way)
        limited = self.limits.at_time(total_s, farthest_s)
        if self._respects(limited):
            return limited
        times = {state.exposure_s for state in allowed.states}
        on_the_way = sorted((each for each in times if 0 < stops(each) / whole_way <= 1), key=lambda t: abs(stops(t)))
        within = [each for each in on_the_way if abs(stops(each)) <= limit]
        new = self.limits.at_time(total_s, within[-1] if within else on_the_way[0])
        return new if self._respects(new) else wanted
