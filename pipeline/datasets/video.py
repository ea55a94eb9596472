"""Videos: frames as grey levels, with broken ones counted and reported.

A decoder hides damage: a file that is cut short ends early, a broken block is filled with its neighbours. Here the
frames decoded are compared with the number the file declares, and the decoder's error messages are collected.
OpenCV decodes (FFmpeg).
"""

from __future__ import annotations

import contextlib
import os
import re
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.errors import InputError

if TYPE_CHECKING:
    import numpy as np

SUFFIXES = frozenset({".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v", ".mjpg"})
_UNCOUNTED = frozenset({".mkv", ".webm"})
"""Containers without a number of frames: OpenCV derives it from duration and rate, too large where the rate varies."""
_SEVERAL = 2
_ADDRESS = re.compile(r" @ 0x[0-9a-f]+")


class BadVideo(InputError):
    """A video that cannot be read, or some of whose frames are missing or damaged."""


@contextlib.contextmanager
def _decoder_messages(messages: list[str]) -> Iterator[None]:
    """Collect the lines that C libraries write to standard error meanwhile."""
    sys.stderr.flush()
    kept = os.dup(2)
    with tempfile.TemporaryFile() as file:
        os.dup2(file.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            if file.tell():
                file.seek(0)
                text = file.read().decode("utf-8", errors="replace")
                messages += [_ADDRESS.sub("", line.strip()) for line in text.splitlines() if line.strip()]


def grey_frame(frame: np.ndarray) -> np.ndarray:
    """A decoded 8-bit frame, (H, W, 3) BGR or (H, W), as (H, W) float32 grey levels in [0, 1] (BT.601 luma)."""
    import cv2
    import numpy as np

    grey = cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY) if frame.ndim == 3 else frame
    return grey.astype(np.float32) / np.float32(255)


def read_video(path: Path, every: int = 1) -> Iterator[tuple[int, np.ndarray]]:
    """Number and grey picture of each frame of a video that can be decoded.

    Args:
        path: the file.
        every: take each n-th frame.

    Returns:
        frame number, from 0, and (H, W) float32 in [0, 1].

    Raises:
        BadVideo: after the last good frame, if frames are missing or damaged; or at once, if there is none.
    """
    import cv2

    messages: list[str] = []
    with _decoder_messages(messages):
        video = cv2.VideoCapture(str(path))
    declared = int(video.get(cv2.CAP_PROP_FRAME_COUNT)) if video.isOpened() else 0
    per_second = video.get(cv2.CAP_PROP_FPS)
    last_s = longest_s = 0.0  # time of the last frame, longest time between two
    messages.clear()  # remarks on the container; the frames decide
    number = undecoded = 0
    first_damage: int | None = None
    try:
        while _grab(video, messages):
            time_s = video.get(cv2.CAP_PROP_POS_MSEC) / 1000
            last_s, longest_s = time_s, max(longest_s, time_s - last_s if number else 0.0)
            if number % every == 0:
                with _decoder_messages(messages):
                    good, frame = video.retrieve()
                if good:
                    yield number, grey_frame(frame)
                else:
                    undecoded += 1
            if messages and first_damage is None:
                first_damage = number
            number += 1
    finally:
        video.release()
    if number == 0:
        raise BadVideo(f"{path}: not a video that OpenCV can read, or it holds no frame")
    problems = []
    # As if the last frame lasted no longer than the others; half a frame is rounding of the number declared.
    whole = path.suffix.lower() in _UNCOUNTED and declared - 0.5 <= (last_s + longest_s) * per_second + 0.1
    if declared > number and not whole:
        problems.append(f"{declared - number} of the {declared} frames it declares are missing; {number} were read")
    if undecoded:
        problems.append(f"{undecoded} frames cannot be decoded")
    if messages:
        near = f"near frame {first_damage}" if first_damage is not None else "at its end"
        more = f" and {len(messages) - 1} more" if len(messages) >= _SEVERAL else ""
        problems.append(f"the decoder reports damage {near} ({messages[0]}{more})")
    if problems:
        raise BadVideo(f"{path}: damaged or cut short: {'; '.join(problems)}")


def _grab(video: Any, messages: list[str]) -> bool:
    """Advance to the next frame; False after the last."""
    with _decoder_messages(messages):
        return bool(video.grab())
