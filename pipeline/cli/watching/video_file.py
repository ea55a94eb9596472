"""Frames of a video file that is watched: played at its own speed, or every one as fast as it is analysed."""

from __future__ import annotations

import contextlib
import threading
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from pipeline.cli.watching.source_frame import SourceFrame
from pipeline.errors import InputError

DEFAULT_FRAMES_PER_SECOND = 25.0  # of a video that does not state its own


def every_frame(path: Path, stop: threading.Event) -> Iterator[SourceFrame]:
    """Every frame of a video as fast as it is analysed; damage is reported at the end."""
    from pipeline.cli.frames.pictures import readable

    for name, image, problem, coding in readable([path], least_px=1):  # `watch` knows how large pictures must be
        if stop.is_set():
            return
        yield SourceFrame(name, image, problem, coding=coding)


def played_video(path: Path, rate: float, stop: threading.Event) -> Iterator[SourceFrame]:
    """A video at its own speed: the frame that is due is decoded, frames missed meanwhile are dropped.

    Args:
        path: the file; damage is reported at the end.
        rate: most frames per second.
        stop: ends it.
    """
    from pipeline.cli.frames.remarks import video_remarks
    from pipeline.datasets.decoding.video import read_video

    pace = _Pace(rate)
    with contextlib.closing(read_video(path, due=pace.due, remark=video_remarks(str(path), Counter()))) as frames:
        try:
            for number, image, coding in frames:
                if stop.wait(pace.early_s(number)):
                    return
                yield SourceFrame(f"{path}#{number}", image, coding=coding)
                pace.shown()
        except InputError as error:
            yield SourceFrame(str(path), None, str(error))


class _Pace:
    """When the frames of a video are due, from now on.

    Args:
        rate: most frames per second.
    """

    def __init__(self, rate: float) -> None:
        self._rate, self._per_second = rate, DEFAULT_FRAMES_PER_SECOND
        self._next, self._began = 0.0, time.monotonic()

    def due(self, number: int, per_second: float) -> bool:
        """Whether a frame is the next to be shown, by its number and the frames per second that the video states."""
        self._per_second = per_second if 0 < per_second < 1000 else DEFAULT_FRAMES_PER_SECOND
        return number >= self._next

    def early_s(self, number: int) -> float:
        """Seconds until a frame's time."""
        return max(number / self._per_second - (time.monotonic() - self._began), 0.0)

    def shown(self) -> None:
        """A frame has been dealt with: those whose time has passed are not due any more."""
        step = max(1.0, self._per_second / self._rate)
        self._next = max(self._next + step, (time.monotonic() - self._began) * self._per_second)
