"""Exposure state of a camera, its limits and steps, and how total exposure splits into time and gain.

Total exposure is time x gain: brightness before clipping is proportional to it. Priority as in built-in controllers:
exposure time first, up to its limit, then gain; gain is reduced first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from pipeline.camera.sensor import check_base_gain
from pipeline.control.options import check_number, is_count, is_number
from pipeline.errors import InputError

BASE_ISO = 100.0
DECIBELS_PER_STOP = 20.0 * math.log10(2.0)
NEARLY_STOPS = 0.05
"""Settings this near are the same: a driver rounds exposure times to microseconds or to lines of the sensor."""


@dataclass(frozen=True)
class CameraState:
    """Settings that one frame was, or will be, taken with.

    Attributes:
        exposure_s: exposure time, above 0 s.
        gain: ISO / base ISO, above 0.
    """

    exposure_s: float
    gain: float

    def __post_init__(self) -> None:
        for name in ("exposure_s", "gain"):
            value = getattr(self, name)
            if not (is_number(value) and math.isfinite(value) and value > 0):
                raise InputError(f"camera state: {name} is {value!r}; expected a finite number above 0")

    @classmethod
    def of(cls, exposure_ms: float, iso: float) -> CameraState:
        """From milliseconds and ISO, base ISO 100.

        Raises:
            InputError: not finite numbers above 0.
        """
        for name, value in (("exposure_ms", exposure_ms), ("iso", iso)):
            if not is_number(value):
                raise InputError(f"camera state: {name} is {value!r}; expected a finite number above 0")
        return cls(exposure_ms / 1e3, iso / BASE_ISO)

    @property
    def exposure_ms(self) -> float:
        """Exposure time in milliseconds."""
        return self.exposure_s * 1e3

    @property
    def iso(self) -> float:
        """Gain as ISO, base ISO 100."""
        return self.gain * BASE_ISO

    @property
    def gain_db(self) -> float:
        """Gain in decibels, ``20 log10 gain``."""
        return 20.0 * math.log10(self.gain)

    @property
    def total_exposure_s(self) -> float:
        """Time x gain; brightness is proportional to it."""
        return self.exposure_s * self.gain

    def error_stops(self, total_exposure_s: float) -> float:
        """How far the total exposure is from one wanted, stops, at least 0."""
        return abs(math.log2(self.total_exposure_s / total_exposure_s))

    def is_nearly(self, other: CameraState) -> bool:
        """Whether exposure time and gain are those of other settings, but for a driver's rounding."""
        stops = (math.log2(self.exposure_s / other.exposure_s), math.log2(self.gain / other.gain))
        return max(map(abs, stops)) <= NEARLY_STOPS

    def traded(self, alpha: float) -> CameraState:
        """Exposure shortened by ``alpha``, gain raised by it: ``(t / alpha, g alpha)``; brightness is kept."""
        if not (math.isfinite(alpha) and alpha > 0):
            raise InputError(f"alpha is {alpha!r}; expected a finite number above 0")
        return CameraState(self.exposure_s / alpha, self.gain * alpha)


@dataclass(frozen=True)
class Limits:
    """What a camera accepts.

    Attributes:
        exposure_min_s, exposure_max_s: range of the exposure time.
        gain_min, gain_max: range of the gain, at least 1.
        exposure_steps_per_stop: settings per factor of two of the exposure time; 0 is continuous.
        gain_step_db: step of the gain; 0 is continuous.
        delay_frames: frames from a register write to the first image with it, beside the next frame itself.
    """

    exposure_min_s: float = 50e-6
    exposure_max_s: float = 33e-3
    gain_min: float = 1.0
    gain_max: float = 32.0
    exposure_steps_per_stop: int = 0
    gain_step_db: float = 0.0
    delay_frames: int = 0

    def __post_init__(self) -> None:
        for low, high in (("exposure_min_s", "exposure_max_s"), ("gain_min", "gain_max")):
            least, most = getattr(self, low), getattr(self, high)
            if not (is_number(least) and is_number(most) and math.isfinite(most) and 0 < least <= most):
                raise InputError(f"limits: expected 0 < {low} <= {high}, got {least!r} and {most!r}")
        check_base_gain("limits: gain_min", self.gain_min)
        step_db, per_stop, delay = self.gain_step_db, self.exposure_steps_per_stop, self.delay_frames
        check_number("limits", "gain_step_db", step_db, "decibels of at least 0", lambda step: 0 <= step < math.inf)
        if not (is_count(per_stop) and per_stop >= 0):
            raise InputError(f"limits: exposure_steps_per_stop is {per_stop!r}; expected a whole number of at least 0")
        if not (is_count(delay) and 0 <= delay <= 10):
            raise InputError(f"limits: delay_frames is {delay!r}; expected a whole number in 0..10")

    def nearest(self, exposure_s: float, gain: float) -> CameraState:
        """The nearest settings the camera accepts, each on its own."""
        time = min(max(exposure_s, self.exposure_min_s), self.exposure_max_s)
        if self.exposure_steps_per_stop:
            steps = round(math.log2(time / self.exposure_min_s) * self.exposure_steps_per_stop)
            time = self._time_of(min(steps, self._steps_up_to(self.exposure_max_s)))
        factor = min(max(gain, self.gain_min), self.gain_max)
        if self.gain_step_db:
            decibels = round(20.0 * math.log10(factor / self.gain_min) / self.gain_step_db)
            most = math.floor(20.0 * math.log10(self.gain_max / self.gain_min) / self.gain_step_db + 1e-9)
            factor = self.gain_min * 10.0 ** (min(decibels, most) * self.gain_step_db / 20.0)
        return CameraState(time, factor)

    def stepped(self, state: CameraState, owner: str) -> CameraState:
        """Settings inside the ranges, on the nearest steps of the camera.

        Args:
            state: wanted settings.
            owner: what wants them, for the error.

        Raises:
            InputError: they lie outside the ranges.
        """
        nearest = self.without_steps().nearest(state.exposure_s, state.gain)
        if not (math.isclose(state.exposure_s, nearest.exposure_s) and math.isclose(state.gain, nearest.gain)):
            raise InputError(
                f"{owner}: {state.exposure_ms:g} ms at ISO {state.iso:g} lies outside the camera's limits; expected "
                f"{self.exposure_min_s * 1e3:g} to {self.exposure_max_s * 1e3:g} ms and ISO "
                f"{self.gain_min * BASE_ISO:g} to {self.gain_max * BASE_ISO:g}"
            )
        return self.nearest(state.exposure_s, state.gain)

    def accepts(self, state: CameraState) -> bool:
        """Whether the camera can have settings: inside the ranges and on the steps, but for rounding."""
        nearest = self.nearest(state.exposure_s, state.gain)
        return math.isclose(state.exposure_s, nearest.exposure_s) and math.isclose(state.gain, nearest.gain)

    def at_time(self, total_exposure_s: float, exposure_s: float) -> CameraState:
        """Settings of a total exposure at (about) an exposure time; time gives way where the gain's range ends.

        The gain makes up for the rounded time. Where the highest or lowest gain does not, the time is the next step.

        Args:
            total_exposure_s: wanted time x gain.
            exposure_s: wanted time.

        Returns:
            settings whose total exposure is within half a step of the gain where the camera has such.
        """
        gain = self.nearest(exposure_s, total_exposure_s / exposure_s).gain
        time = self.nearest(total_exposure_s / gain, gain).exposure_s
        step = 2.0 ** (1.0 / self.exposure_steps_per_stop) if self.exposure_steps_per_stop else 1.0
        state = self.nearest(time, total_exposure_s / time)
        if state.error_stops(total_exposure_s) <= self.gain_step_db / (2.0 * DECIBELS_PER_STOP) + 1e-9:
            return state
        others = [self.nearest(each, total_exposure_s / each) for each in (time * step, time / step)]
        return min([state, *others], key=lambda each: each.error_stops(total_exposure_s))

    def time_first(self, total_exposure_s: float, exposure_max_s: float | None = None) -> CameraState:
        """Settings of a total exposure, by time up to its limit, then by gain.

        Args:
            total_exposure_s: wanted time x gain.
            exposure_max_s: a lower limit of the time than the camera's, which steps of the time do not exceed.

        Raises:
            InputError: the limit is below the shortest exposure time.
        """
        longest = self.longest_up_to(self.exposure_max_s if exposure_max_s is None else exposure_max_s)
        time = min(max(total_exposure_s / self.gain_min, self.exposure_min_s), longest)
        return self.nearest(time, total_exposure_s / time)

    def longest_up_to(self, exposure_s: float) -> float:
        """The longest exposure time that the camera accepts and that is at most so long, s.

        Raises:
            InputError: there is none.
        """
        if not exposure_s >= self.exposure_min_s:
            raise InputError(
                f"limits: no exposure time of at most {exposure_s * 1e3:g} ms; expected at least the shortest one, "
                f"{self.exposure_min_s * 1e3:g} ms"
            )
        longest = min(exposure_s, self.exposure_max_s)
        return self._time_of(self._steps_up_to(longest)) if self.exposure_steps_per_stop else longest

    def _steps_up_to(self, exposure_s: float) -> int:
        """Steps from the shortest exposure time to the last one that is not longer."""
        return math.floor(math.log2(exposure_s / self.exposure_min_s) * self.exposure_steps_per_stop + 1e-9)

    def _time_of(self, steps: int) -> float:
        """Exposure time so many steps above the shortest, s."""
        return float(self.exposure_min_s * 2.0 ** (steps / self.exposure_steps_per_stop))

    def without_steps(self) -> Limits:
        """The same ranges, continuous and without delay."""
        return replace(self, exposure_steps_per_stop=0, gain_step_db=0.0, delay_frames=0)


@dataclass
class DelayLine:
    """Settings on their way to the sensor.

    Attributes:
        waiting: written settings, oldest first; one leaves with every frame.
    """

    waiting: list[CameraState] = field(default_factory=list)

    @classmethod
    def filled(cls, state: CameraState, delay_frames: int) -> DelayLine:
        """A line that gives ``state`` for the first ``delay_frames`` frames."""
        return cls([state] * delay_frames)

    def next(self, written: CameraState) -> CameraState:
        """Write settings; returns those of the next frame."""
        self.waiting.append(written)
        return self.waiting.pop(0)
