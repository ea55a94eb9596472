"""The loop of ``camera-monitor watch``: every frame becomes a JSON line, and so does what begins or ends with it."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pipeline.cli.analysis.frame import series_name
from pipeline.cli.calibration.camera_store import of_other_size
from pipeline.cli.frames.pictures import too_small
from pipeline.cli.watching.alarms import ActiveAlarms, alarm_words
from pipeline.cli.watching.state import RollingState
from pipeline.errors import InputError
from pipeline.store import plain_json

if TYPE_CHECKING:
    from pipeline.cli.analysis.frame import FrameAnalysis
    from pipeline.cli.watching.source_frame import SourceFrame

STATED = (
    "picture", "sigma_dn", "sigma_low_dn", "sigma_high_dn", "sigma_at_most_dn", "mtf50_horizontal", "mtf50_vertical",
    "mtf50_horizontal_status", "mtf50_vertical_status", "ap_percent", "row_noise_dn", "column_noise_dn",
    "dead_lines", "impulse_fraction", "flags", "alarms", "undecided", "milliseconds", "white_sigma_dn",
    "noise_correlation",
)  # fmt: skip


class Watch:
    """The loop of ``camera-monitor watch``: frames in, JSON lines out.

    Args:
        source: that the frames are of, as named on the command line.
        analysis: of the frames.
        window: number of the last frames that the state and undecided alarms regard.
        sharp_px: (H, W) of the calibrated camera's sharp frames, or None.
        least_px: both sides of a frame must be at least this long.

    Attributes:
        frames: number of frames analysed.
        alarms: number of alarms that began.
        set_aside: number of problems.
        problem: the last of them in words, or empty.
    """

    def __init__(
        self,
        source: str,
        analysis: FrameAnalysis,
        window: int,
        sharp_px: tuple[int, int] | None = None,
        least_px: int = 1,
    ) -> None:
        self.source, self.analysis, self.state = source, analysis, RollingState(window)
        self.frames = self.alarms = self.set_aside = 0
        self.problem = ""
        self._sharp_px, self._least_px = sharp_px, least_px
        self._began = time.monotonic()
        self._alarms = ActiveAlarms()
        self._drifted: set[tuple[str, str]] = set()  # sequence and quantity, stated already
        self._undecided: Counter[str] = Counter()
        self._window = window

    def emit(self, event: str, **content: Any) -> None:
        """Print one line and flush it, so that a pipe gets it at once."""
        line = {"event": event, "seconds": round(time.monotonic() - self._began, 3), **content}
        print(json.dumps(plain_json(line)), flush=True)

    def run(self, came: Iterator[SourceFrame], most_frames: int | None, idle_stop: float | None) -> str:
        """Analyse frames until the source ends, enough have come, or nothing comes; why it ended."""
        last = time.monotonic()
        for frame in came:
            if frame.image is not None:
                self._frame(frame)
            elif frame.problem:
                self._problem(frame)
            if frame.image is not None or (frame.problem and not frame.signal_lost):
                last = time.monotonic()  # a file that cannot be used has come, too; to find that out takes time
            if most_frames is not None and self.frames >= most_frames:
                return "frames"
            if idle_stop is not None and time.monotonic() - last > idle_stop:
                return "idle"
        return "end"

    def _frame(self, frame: SourceFrame) -> None:
        assert frame.image is not None
        sequence = series_name(self.source, frame.image.shape)
        try:
            if small := too_small(frame.image.shape, self._least_px):
                raise InputError(f"{frame.name}: {small}")
            row, _ = self.analysis.analyse(frame.name, frame.image, self.source, sequence, coding=frame.coding)
        except InputError as error:
            self._problem(replace(frame, image=None, problem=str(error)))
            return
        self.frames += 1
        if self._sharp_px is not None and frame.image.shape != self._sharp_px:
            reason = of_other_size(frame.name, frame.image.shape, [self._sharp_px])
            self.emit("warning", picture=frame.name, reason=reason)
            self._sharp_px = None  # once is enough
        trend = self.analysis.trends[sequence]
        self.emit(
            "frame", **{name: row[name] for name in STATED}, trend=trend.state(), trend_of=trend.watched,
            state=self.state.add(row),
        )  # fmt: skip
        self._state_alarms(row, sequence)
        self._state_drifts(sequence, row["picture"])
        self._state_undecided(row)

    def _state_alarms(self, row: dict[str, Any], sequence: str) -> None:
        """State the alarms that begin and those that clear with a frame."""
        trends = {
            f"trend {alarm['quantity']}": alarm["words"]
            for alarm in self.analysis.trend_alarms
            if alarm["sequence"] == sequence
        }
        begun, ended = self._alarms.update(_names(row["alarms"]), _names(row["undecided"]))
        for name in begun:
            self.alarms += 1
            words = trends[name] if name in trends else alarm_words(name, row, self.analysis.thresholds)
            self.emit("alarm", alarm=name, picture=row["picture"], words=words)
        for name in ended:
            self.emit("cleared", alarm=name, picture=row["picture"])

    def _state_drifts(self, sequence: str, picture: str) -> None:
        """Warn once of each quantity that changed within the reference frames of its trend."""
        for quantity, drift in self.analysis.trends[sequence].drifts.items():
            if (sequence, quantity) not in self._drifted:
                self._drifted.add((sequence, quantity))
                reason = f"no reliable trend, changed within the reference: {drift.words()}"
                self.emit("warning", picture=picture, reason=reason)

    def _state_undecided(self, row: dict[str, Any]) -> None:
        """State the alarms that no frame of a whole window has decided, once until they are known again."""
        self._undecided = Counter({name: self._undecided[name] + 1 for name in _names(row["undecided"])})
        for name, count in self._undecided.items():
            if count == self._window:
                self.emit("undecided", alarm=name, picture=row["picture"], frames=count)

    def _problem(self, frame: SourceFrame) -> None:
        self.set_aside += 1
        self.problem = frame.problem
        event = "no_signal" if frame.signal_lost else "set_aside"
        self.emit(event, picture=frame.name, reason=frame.problem)


def _names(joined: str) -> list[str]:
    """Names of a column that joins them by commas."""
    return [name for name in joined.split(", ") if name]
