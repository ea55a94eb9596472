"""Hysteresis that grows with reversals: a policy does not hunt between two settings of an unchanged scene.

Estimates err differently at different settings: motion of 5 px is taken for 3 px, one of 6.5 px for 5.5 px. Each of two
settings may then promise more than the other as long as the other is in force. A change has to promise ::

    gain > least 2^n points,    n = min(reversals since the scene changed, 3)

A reversal is a change of the exposure time (of the total exposure where the time stays) against the direction of the
change before it. The scene has changed where its light differs by half a stop from that of the last such change, or
where the speed of the image has jumped (`pipeline.control.temporal.speed`); n is 0 again then.
"""

from __future__ import annotations

import math

from pipeline.control.state import CameraState

MOST_REVERSALS = 3
"""That count: real changes of the scene that are too slow to be noticed as such have to promise eight times as much."""

LIGHT_CHANGE_STOPS = 0.5


class Hysteresis:
    """Points that a change of settings must promise.

    Args:
        least_percent: without reversals, at least 0.
    """

    def __init__(self, least_percent: float) -> None:
        self.least_percent = least_percent
        self.reversals = 0
        self._light_stops = math.nan
        self._speed_jumps: int | None = None
        self._direction = 0

    @property
    def required_percent(self) -> float:
        """Points that a change must promise now."""
        return self.least_percent * 2.0 ** min(self.reversals, MOST_REVERSALS)

    def observe(self, light: float, speed_jumps: int) -> None:
        """Forget reversals if the scene has changed.

        Args:
            light: brightness of the scene in any linear unit, above 0; NaN where the frame does not show it.
            speed_jumps: how often the speed of the image has jumped so far.
        """
        stops = math.log2(light) if math.isfinite(light) else self._light_stops
        if not abs(stops - self._light_stops) < LIGHT_CHANGE_STOPS or speed_jumps != self._speed_jumps:
            self._light_stops, self._speed_jumps = stops, speed_jumps
            self.reversals, self._direction = 0, 0

    def count(self, before: CameraState, after: CameraState) -> None:
        """Count a change of settings that has been decided.

        Args:
            before: settings written last.
            after: settings written now.
        """
        direction = _sign(math.log2(after.exposure_s / before.exposure_s))
        direction = direction or _sign(math.log2(after.total_exposure_s / before.total_exposure_s))
        if direction:
            self.reversals += direction == -self._direction
            self._direction = direction


def _sign(stops: float) -> int:
    """-1, 0 or 1; changes below a hundredth of a stop are none."""
    return (stops > 0.01) - (stops < -0.01)
