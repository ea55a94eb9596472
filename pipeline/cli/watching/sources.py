"""Frames of a source that goes on: a camera, a network stream, a video played as one, or a folder that fills.

A live source does not wait: of what it delivers while a frame is analysed, the newest is taken and the rest dropped.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path

from pipeline.cli.addresses import ADDRESS_MARK, without_credentials
from pipeline.cli.watching.folder import filling_folder
from pipeline.cli.watching.newest_frame import RECONNECT_S, NewestFrame
from pipeline.cli.watching.source_frame import SourceFrame
from pipeline.cli.watching.video_file import every_frame, played_video
from pipeline.errors import InputError


def open_source(source: str, rate: float, *, wait: bool, stop: threading.Event) -> Iterator[SourceFrame]:
    """The frames of a source, until it ends or is stopped.

    Args:
        source: camera index, address such as ``rtsp://...``, video file, or folder.
        rate: most frames per second.
        wait: whether a video file is played at its own speed; otherwise every frame comes as soon as it can.
        stop: ends the source when set.

    Raises:
        InputError: no such source.
    """
    from pipeline.datasets.decoding.video import SUFFIXES

    if not source:
        raise InputError("SOURCE is empty; expected a camera index, an address (rtsp://...), a video file or a folder")
    path = Path(source)
    if source.isdigit():
        return live(int(source), f"camera {source}", rate, stop)
    if ADDRESS_MARK in source:
        return live(source, without_credentials(source), rate, stop)
    if path.is_dir():
        return filling_folder(path, stop)
    if path.is_file() and path.suffix.lower() in SUFFIXES:
        return played_video(path, rate, stop) if wait else every_frame(path, stop)
    named = without_credentials(source)
    raise InputError(f"{named}: neither a camera index, an address (rtsp://...), a video file nor a folder")


def live(device: int | str, name: str, rate: float, stop: threading.Event) -> Iterator[SourceFrame]:
    """Newest frames of a camera or network stream; a lost signal is reported once and the stream reopened.

    Frames that must not be measured, as interlaced ones, are left out; each reason is reported once. A ``None`` frame
    without a problem is yielded at every look that brings nothing.

    Args:
        device: index or address; it is opened at once.
        name: for the frames.
        rate: most frames per second.
        stop: ends it.

    Raises:
        InputError: it cannot be opened.
    """
    return _newest_frames(NewestFrame(device, name, stop), name, rate, stop)


def _newest_frames(reader: NewestFrame, name: str, rate: float, stop: threading.Event) -> Iterator[SourceFrame]:
    """See `live`."""
    reader.start()
    shown, number, lost = 0, 0, False
    stated: set[str] = set()
    while not stop.is_set():
        start = time.monotonic()
        count, image, coding = reader.newest(shown)
        if image is not None:
            shown, lost = count, False
            yield SourceFrame(f"{name}#{number}", image, coding=coding)
            number += 1
        elif reader.lost and not lost:
            lost = True
            yield SourceFrame(name, None, "no signal; trying to reopen it", signal_lost=True)
        elif (problem := reader.problem) and problem not in stated:
            stated.add(problem)
            yield SourceFrame(name, None, f"{name}: {problem}")
        else:
            yield SourceFrame(name, None)
        stop.wait(max(1 / rate - (time.monotonic() - start), 0.005))
    reader.join(RECONNECT_S)
