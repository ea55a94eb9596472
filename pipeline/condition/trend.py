"""Trend of a camera's condition over the frames of one stream, with an alarm where noise or blur has grown.

Three quantities are charted (`pipeline.condition.change_point`), each against the stream's first frames:

    noise              ln(1 + sigma / DN)
    blur horizontal    -ln of the mean of the horizontal MTF over its eight frequencies
    blur vertical      likewise

The mean MTF is used and not the MTF50, because it is finite for every picture. The average run length of each chart is
three hours at 10 frames per second, so that all together raise less than one false alarm an hour. That holds for
frames whose estimates vary as they did in the reference period; a drive from a city into a forest is a change too.

Delays on simulated series of 10 frames per second whose estimates scatter by 5 % (10 %) from frame to frame, median of
ten series each: defocus that lowers the mean MTF from 0.60 to 0.36 within five minutes, 32 s (61 s); water on the lens,
0.60 to 0.35 at once, 0.1 s (0.1 s); noise that doubles within two minutes as the sensor warms up, 11 s (20 s).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.condition.change_point import LEAST_REFERENCE, Chart, Reference
from pipeline.errors import InputError

QUANTITIES = ("noise", "blur horizontal", "blur vertical")
REFERENCE_FRAMES = 300
FALSE_ALARMS_PER_HOUR = 1.0
FRAMES_PER_SECOND = 10.0
FRAMES_BETWEEN_FALSE_ALARMS = 3600 * FRAMES_PER_SECOND / FALSE_ALARMS_PER_HOUR * len(QUANTITIES)
LEAST_MTF = 0.01


@dataclass(frozen=True)
class TrendAlarm:
    """The beginning of an alarm.

    Attributes:
        quantity: one of `QUANTITIES`.
        frame: number of the frame that raised it, from 0, frames without estimate counted.
        since_frame: estimated frame of the change.
        reference: level in the reference period: noise in DN, or mean MTF.
        level: mean level since the change, likewise.
    """

    quantity: str
    frame: int
    since_frame: int
    reference: float
    level: float

    def words(self) -> str:
        """One sentence."""
        if self.quantity == "noise":
            change = f"noise {self.reference:.1f} to {self.level:.1f} DN"
        else:
            change = f"{self.quantity}: mean MTF {self.reference:.2f} to {self.level:.2f}"
        return f"{change} since frame {self.since_frame}"


class _Quantity:
    """One quantity: its reference period, then its chart, and the sum of values since the chart was at 0."""

    def __init__(self, reference_frames: int) -> None:
        self.reference_frames = reference_frames
        self.learned: list[float] = []
        self.chart: Chart | None = None
        self.since, self.total = 0, 0.0

    def step(self, value: float, frame: int) -> bool:
        if not np.isfinite(value):
            return False
        if self.chart is None:
            self.learned.append(value)
            if len(self.learned) == self.reference_frames:
                self.chart = Chart(Reference.of(self.learned), FRAMES_BETWEEN_FALSE_ALARMS)
            return False
        begins = bool(self.chart.step(value))
        steps = int(self.chart.frames_since_zero)
        if steps <= 1:
            self.since, self.total = frame, 0.0
        self.total += value
        return begins


class ConditionTrend:
    """Charts of one stream.

    Args:
        reference_frames: frames that the reference is taken from, at least 100.

    Raises:
        InputError: fewer.
    """

    def __init__(self, reference_frames: int = REFERENCE_FRAMES) -> None:
        if reference_frames < LEAST_REFERENCE:
            raise InputError(
                f"reference of {reference_frames} frames; expected at least {LEAST_REFERENCE}, or the false-alarm rate "
                "cannot be kept"
            )
        self.reference_frames = reference_frames
        self.frames = 0
        self._quantities = {name: _Quantity(reference_frames) for name in QUANTITIES}

    def step(self, sigma_dn: float, mtf: NDArray[np.floating]) -> list[TrendAlarm]:
        """Take the condition of the next frame.

        Args:
            sigma_dn: noise, DN; NaN where unknown.
            mtf: (2, 8) MTF, horizontal and vertical; NaN where unknown.

        Returns:
            alarms that begin with this frame.
        """
        values = [float(np.log1p(sigma_dn)), *(-np.log(np.maximum(np.mean(mtf, axis=1), LEAST_MTF)))]
        alarms = []
        for (name, quantity), value in zip(self._quantities.items(), values, strict=True):
            if quantity.step(float(value), self.frames):
                alarms.append(self._alarm(name, quantity))
        self.frames += 1
        return alarms

    @property
    def active(self) -> tuple[str, ...]:
        """Quantities whose alarm has begun and not cleared."""
        return tuple(
            name for name, part in self._quantities.items() if part.chart is not None and bool(part.chart.alarm)
        )

    @property
    def watched(self) -> tuple[str, ...]:
        """Quantities whose reference period is complete."""
        return tuple(name for name, part in self._quantities.items() if part.chart is not None)

    @property
    def learning(self) -> dict[str, int]:
        """Quantities whose reference period is not complete, each with how many frames it has an estimate of."""
        return {name: len(part.learned) for name, part in self._quantities.items() if part.chart is None}

    def state(self) -> str:
        """``learning`` until a reference is complete, then ``alarm`` or ``watching``."""
        if not self.watched:
            return "learning"
        return "alarm" if self.active else "watching"

    def _alarm(self, name: str, quantity: _Quantity) -> TrendAlarm:
        assert quantity.chart is not None
        steps = max(int(quantity.chart.frames_since_zero), 1)
        levels = float(quantity.chart.reference.mean), quantity.total / steps
        reference, level = (float(np.expm1(y)) if name == "noise" else float(np.exp(-y)) for y in levels)
        return TrendAlarm(name, self.frames, quantity.since, reference, level)
