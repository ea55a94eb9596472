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
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.errors import InputError

if TYPE_CHECKING:
    import numpy as np

_TRANSPORT_STREAMS = frozenset({".ts", ".mts", ".m2ts"})
SUFFIXES = _TRANSPORT_STREAMS | {".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v", ".mjpg"}
_UNCOUNTED = _TRANSPORT_STREAMS | {".mkv", ".webm"}
"""Containers without a number of frames: OpenCV derives it from duration and rate, too large where the rate varies."""
_SEVERAL = 2
_ADDRESS = re.compile(r" @ 0x[0-9a-f]+")
_DECODER = re.compile(
    r"^(\[[^\]]+ @ 0x[0-9a-f]+\]|\s*Last message repeated|\[ ?(WARN|ERROR|FATAL)\b|OpenCV|VIDEOIO|Unexpected|"
    r"Corrupt JPEG)"
)
"""How lines of FFmpeg, OpenCV and libjpeg begin; others are by threads that write meanwhile."""
_UNSET = re.compile(r"(Unexpected element\. Expected: \w+\. Got: ).{0,4}\.(?=\n|$)", re.DOTALL)
"""OpenCV's remark on a cut AVI quotes four bytes that it never read, line ends now and then among them."""


class BadVideo(InputError):
    """A video that cannot be read, or some of whose frames are missing or damaged."""


@contextlib.contextmanager
def _decoder_messages(messages: list[str]) -> Iterator[None]:
    """Collect the lines that the decoder writes to standard error meanwhile; those of others go there afterwards."""
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
                text = _UNSET.sub(r"\1?.", file.read().decode("utf-8", errors="replace"))
                lines = [line for line in text.splitlines() if line.strip()]
                messages += [_ADDRESS.sub("", line.strip()) for line in lines if _DECODER.match(line)]
                for line in lines:
                    if not _DECODER.match(line):
                        os.write(2, f"{line}\n".encode())


def grey_frame(frame: np.ndarray) -> np.ndarray:
    """A decoded 8-bit frame, (H, W, 3) BGR or (H, W), as (H, W) float32 grey levels in [0, 1] (BT.601 luma)."""
    import cv2
    import numpy as np

    grey = cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY) if frame.ndim == 3 else frame
    return grey.astype(np.float32) / np.float32(255)


def read_video(
    path: Path, every: int = 1, due: Callable[[int, float], bool] | None = None
) -> Generator[tuple[int, np.ndarray], None, None]:
    """Number and grey picture of each frame of a video that can be decoded.

    Args:
        path: the file.
        every: take each n-th frame.
        due: whether to take a frame, by its number and the frames per second that the file states (0 where it does
            not); instead of `every`.

    Returns:
        frame number, from 0, and (H, W) float32 in [0, 1].

    Raises:
        BadVideo: after the last good frame, if frames are missing or damaged; or at once, if there is none.
    """
    import cv2

    account = _Account()
    with _decoder_messages(account.messages):
        # FFmpeg's own threads would report damage at any time, between two frames too, where nobody listens.
        video = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG, [cv2.CAP_PROP_N_THREADS, 1])
        if not video.isOpened():
            video = cv2.VideoCapture(str(path))
    account.declared = int(video.get(cv2.CAP_PROP_FRAME_COUNT)) if video.isOpened() else 0
    account.per_second = per_second = float(video.get(cv2.CAP_PROP_FPS))
    account.messages.clear()  # remarks on the container; the frames decide
    try:
        while _grab(video, account.messages):
            number, time_s, good = account.number, video.get(cv2.CAP_PROP_POS_MSEC) / 1000, True
            if due(number, per_second) if due is not None else number % every == 0:
                with _decoder_messages(account.messages):
                    good, frame = video.retrieve()
                if good:
                    yield number, grey_frame(frame)
            account.add(time_s, good)
    finally:
        video.release()
    if not account.number:
        raise BadVideo(f"{path}: not a video that OpenCV can read, or it holds no frame")
    if problems := account.problems(path):
        raise BadVideo(f"{path}: damaged or cut short: {'; '.join(problems)}")


@dataclass
class _Account:
    """What a video declares, and what was found in it so far.

    Attributes:
        declared: number of frames by its header.
        per_second: frames per second by its header.
        number: frames read.
        undecoded: of them, those without a picture.
        messages: of the decoder, about frames.
        first_damage: number of the frame at which the first message came.
        last_s: time of the last frame, seconds.
        longest_s: longest time between two frames, seconds.
    """

    declared: int = 0
    per_second: float = 0.0
    number: int = 0
    undecoded: int = 0
    messages: list[str] = field(default_factory=list)
    first_damage: int | None = None
    last_s: float = 0.0
    longest_s: float = 0.0

    def add(self, time_s: float, good: bool) -> None:
        """Count a frame at a time in seconds; not good where it cannot be decoded."""
        self.last_s, self.longest_s = time_s, max(self.longest_s, time_s - self.last_s if self.number else 0.0)
        self.undecoded += not good
        if self.messages and self.first_damage is None:
            self.first_damage = self.number
        self.number += 1

    def problems(self, path: Path) -> list[str]:
        """What is wrong with the file, in words, once all of its frames are read; empty where nothing is."""
        results = []
        # As if the last frame lasted no longer than the others; half a frame is rounding of the number declared.
        end = (self.last_s + self.longest_s) * self.per_second + 0.1
        whole = path.suffix.lower() in _UNCOUNTED and self.declared - 0.5 <= end
        if self.declared > self.number and not whole:
            missing = self.declared - self.number
            results.append(f"{missing} of the {self.declared} frames it declares are missing; {self.number} were read")
        if self.undecoded:
            results.append(f"{self.undecoded} frames cannot be decoded")
        if self.messages:
            near = f"near frame {self.first_damage}" if self.first_damage is not None else "at its end"
            more = f" and {len(self.messages) - 1} more" if len(self.messages) >= _SEVERAL else ""
            results.append(f"the decoder reports damage {near} ({self.messages[0]}{more})")
        return results


def _grab(video: Any, messages: list[str]) -> bool:
    """Advance to the next frame; False after the last."""
    with _decoder_messages(messages):
        return bool(video.grab())
