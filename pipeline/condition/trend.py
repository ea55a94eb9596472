"""Trend of a camera's condition over the frames of one stream, with an alarm where noise or blur has grown.

Three quantities are charted (`pipeline.condition.change_point`), each against the stream's first frames:

    noise              ln(1 + sigma / DN)
    blur horizontal    -ln of the mean of the horizontal MTF over its eight frequencies
    blur vertical      likewise

The mean MTF is used and not the MTF50, because it is finite for every picture. The average run length of each chart is
three hours at 10 frames per second, so that all together are to raise less than one false alarm an hour. On simulated
series whose law is the same in the reference of 300 frames as later (``benchmarks/trend_alarms.py``, 600 series of 15
minutes each, three charts at 10 frames per second) they raise, an hour:

    independent: normal, Laplace, exponential, Student t of 3 degrees; 2 % of the frames 0.3 up       0.0 to 0.1
    autoregressive of phi 0.5, 0.9                                                                    0.0, 0.5
    stop and go of 30 s, 0.1 up and down, with scatter of 5 %                                         0.0
    slow scenery and white scatter: phi 0.98, 2.5 % + 5 %; 0.95, 5 % + 5 %; 0.98, 5 % + 3 %           0.8, 1.2, 1.6
    slow scenery alone: phi 0.98, 0.99                                                                3.9, 4.0

The rate is not kept in the last two rows: a reference of 30 s holds few independent frames of scenery that is alike for
2 s (phi 0.95) to 10 s (0.99). With one of 900 frames 0.1 and 0.4 an hour are raised of phi 0.98 (5 s). Nor is it kept
where scenery varies more slowly than in 30 s, or later in another way than in the reference: a drive from a city into a
forest is a change too.

A quantity that drifts within its reference frames (`pipeline.condition.change_point.drift`) has no level to be compared
with. It is charted against their mean all the same, which still shows a large change, but counts as not watched until
as many later frames are a reference without drift; that one takes over unless the chart has begun to rise.

Delays on such series, of scatter of 5 %, median (90th percentile) of 200: defocus that lowers the mean MTF from 0.60 to
0.36 within five minutes, 38 s (56 s); water on the lens, 0.60 to 0.35 at once, 0.3 s (0.7 s); noise that grows from 3
to 6 DN within two minutes as the sensor warms up, 17 s (25 s). With phi 0.9 they are 74, 3.2 and 33 s (96, 5.3 and
45 s), with scenery of phi 0.98, 5 %, and scatter of 3 % 126, 18 and 63 s (174, 20 and 79 s).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.condition.change_point import LEAST_REFERENCE, Chart, Reference, drift
from pipeline.errors import InputError, printable

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
        frame: number of the frame that raised it among those analysed, from 0, frames without estimate counted.
        since_frame: estimated frame of the change, likewise.
        reference: level in the reference period: noise in DN, or mean MTF.
        level: mean level since the change, likewise.
        noisier: of blur, whether the noise has grown too; the estimated MTF then falls a little with blur as it was.
        since_picture: name of the estimated frame of the change; empty where frames have none.
    """

    quantity: str
    frame: int
    since_frame: int
    reference: float
    level: float
    noisier: bool = False
    since_picture: str = ""

    def words(self) -> str:
        """One sentence."""
        since = _frame_words(self.since_frame, self.since_picture)
        beside = "; noise has grown too, which lowers the estimate a little" if self.noisier else ""
        return f"{_change_words(self.quantity, self.reference, self.level)} since {since}{beside}"


@dataclass(frozen=True)
class ReferenceDrift:
    """A reference period in which a quantity drifted.

    Attributes:
        quantity: one of `QUANTITIES`.
        first_frame: number of the first frame of the period among those analysed, from 0, frames without estimate
            counted.
        last_frame: of its last frame.
        before: level in the first third of the period: noise in DN, or mean MTF.
        after: in its last third, likewise.
        instead: first and last frame of a later period without drift that the quantity is compared with; None while
            there is none.
        pictures: names of the first and last frame of the period; empty where frames have none.
        instead_pictures: of the later period, likewise.
    """

    quantity: str
    first_frame: int
    last_frame: int
    before: float
    after: float
    instead: tuple[int, int] | None = None
    pictures: tuple[str, str] = ("", "")
    instead_pictures: tuple[str, str] = ("", "")

    def words(self) -> str:
        """What changed, when, and what the quantity is compared with instead."""
        change = _change_words(self.quantity, self.before, self.after)
        later = ""
        if self.instead is not None:
            later = f", compared with {_period_words(self.instead, self.instead_pictures)} since"
        return f"{change} within {_period_words((self.first_frame, self.last_frame), self.pictures)}{later}"


def _frame_words(frame: int, picture: str) -> str:
    """A frame by the name of its picture, or by its number where it has none."""
    return printable(picture) if picture else f"frame {frame}"


def _period_words(frames: tuple[int, int], pictures: tuple[str, str]) -> str:
    """The first and last frame of a period."""
    if not all(pictures):
        return "frames {} to {}".format(*frames)
    return " to ".join(printable(picture) for picture in pictures)


def _change_words(quantity: str, before: float, after: float) -> str:
    if quantity == "noise":
        return f"noise {before:.1f} to {after:.1f} DN"
    return f"{quantity}: mean MTF {before:.2f} to {after:.2f}"


def _level(quantity: str, value: float) -> float:
    """Noise in DN, or mean MTF, of a charted value."""
    return float(np.expm1(value)) if quantity == "noise" else float(np.exp(-value))


class _Quantity:
    """One quantity: its reference period, then its chart, and the sum of values since the chart was at 0."""

    def __init__(self, name: str, reference_frames: int) -> None:
        self.name, self.reference_frames = name, reference_frames
        self.learned: list[float] = []
        self.chart: Chart | None = None
        self.drift: ReferenceDrift | None = None  # within the first reference
        self.steady = False  # the chart's reference is one without drift
        self.since, self.since_picture, self.total = 0, "", 0.0
        self._first, self._first_picture = 0, ""  # frame that learning began with

    def step(self, value: float, frame: int, picture: str) -> bool:
        if not np.isfinite(value):
            return False
        chart = self.chart
        if not self.steady:
            self._learn(value, frame, picture)
        if self.chart is None or self.chart is not chart:  # a value of the reference is not charted
            return False
        begins = bool(self.chart.step(value))
        steps = int(self.chart.frames_since_zero)
        if steps <= 1:
            self.since, self.since_picture, self.total = frame, picture, 0.0
        self.total += value
        return begins

    def _learn(self, value: float, frame: int, picture: str) -> None:
        """Take a value for the reference; a chart follows from a complete one."""
        if not self.learned:
            self._first, self._first_picture = frame, picture
        self.learned.append(value)
        if len(self.learned) < self.reference_frames:
            return
        before, after, drifted = drift(self.learned)
        worsens = self.chart is not None and float(self.chart.total) > 0  # a new reference would forget that
        self.steady = not drifted and not worsens
        if self.chart is None or self.steady:
            self.chart = Chart(Reference.of(self.learned), FRAMES_BETWEEN_FALSE_ALARMS)
        pictures = self._first_picture, picture
        if drifted and self.drift is None:
            first, last = (_level(self.name, float(part)) for part in (before, after))
            self.drift = ReferenceDrift(self.name, self._first, frame, first, last, pictures=pictures)
        elif self.steady and self.drift is not None:
            self.drift = replace(self.drift, instead=(self._first, frame), instead_pictures=pictures)
        self.learned = []


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
        self._quantities = {name: _Quantity(name, reference_frames) for name in QUANTITIES}

    def step(self, sigma_dn: float, mtf: NDArray[np.floating], picture: str = "") -> list[TrendAlarm]:
        """Take the condition of the next frame.

        Args:
            sigma_dn: noise, DN; NaN where unknown.
            mtf: (2, 8) MTF, horizontal and vertical; NaN where unknown.
            picture: name of the frame, by which alarms and drifts refer to it; empty for its number.

        Returns:
            alarms that begin with this frame.
        """
        values = [float(np.log1p(sigma_dn)), *(-np.log(np.maximum(np.mean(mtf, axis=1), LEAST_MTF)))]
        alarms = []
        for (name, quantity), value in zip(self._quantities.items(), values, strict=True):
            if quantity.step(float(value), self.frames, picture):
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
        """Quantities whose reference period is complete and without drift."""
        return tuple(name for name, part in self._quantities.items() if part.steady)

    @property
    def learning(self) -> dict[str, int]:
        """Quantities whose reference period is not complete, each with how many frames it has an estimate of."""
        return {name: len(part.learned) for name, part in self._quantities.items() if part.chart is None}

    @property
    def drifts(self) -> dict[str, ReferenceDrift]:
        """Quantities that drifted within their first reference period, each with its drift."""
        return {name: part.drift for name, part in self._quantities.items() if part.drift is not None}

    def state(self) -> str:
        """``alarm`` while one is on; else ``learning`` until a reference is complete, without drift; ``watching``."""
        if self.active:
            return "alarm"
        return "watching" if self.watched else "learning"

    def _alarm(self, name: str, quantity: _Quantity) -> TrendAlarm:
        assert quantity.chart is not None
        steps = max(int(quantity.chart.frames_since_zero), 1)
        reference, level = (
            _level(name, value) for value in (float(quantity.chart.reference.median), quantity.total / steps)
        )
        noisier = name != "noise" and "noise" in self.active
        return TrendAlarm(name, self.frames, quantity.since, reference, level, noisier, quantity.since_picture)
