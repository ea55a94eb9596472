"""Videos: frames as grey levels, with broken ones counted and reported.

A decoder hides damage: a file that is cut short ends early, a broken block is filled with its neighbours. Here the
frames decoded are compared with the number the file declares, and the decoder's error messages are collected.
Interlaced frames are not measured: their two fields are pictures of two moments. `pipeline.datasets.video_decoder`
decodes.
"""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.datasets.video_decoder import INTERLACED, TORN, BadVideo, Decoder, defect, grey_levels, remarks
from pipeline.errors import InputError

if TYPE_CHECKING:
    import numpy as np

    from pipeline.datasets.video_coding import Coding

__all__ = ["SUFFIXES", "BadVideo", "read_video"]

_TRANSPORT_STREAMS = frozenset({".ts", ".mts", ".m2ts"})
_WITH_DURATION = frozenset({".mkv", ".webm", ".wmv", ".asf", ".flv", ".mpg", ".mpeg", ".vob"})
SUFFIXES = _TRANSPORT_STREAMS | _WITH_DURATION | {".mp4", ".avi", ".mov", ".m4v", ".3gp", ".mjpg"}
_UNCOUNTED = _TRANSPORT_STREAMS | _WITH_DURATION
"""Containers without a number of frames: it is derived from duration and rate, too large where the rate varies."""
_SEVERAL = 2


def read_video(
    path: Path,
    every: int = 1,
    due: Callable[[int, float], bool] | None = None,
    remark: Callable[[str, str], None] | None = None,
) -> Generator[tuple[int, np.ndarray, Coding], None, None]:
    """Number, grey picture and coding of each frame of a video that can be decoded, its pixels as stored, not turned.

    Args:
        path: the file.
        every: take each n-th frame.
        due: whether to take a frame, by its number and the frames per second that the file states (0 where it does
            not); instead of `every`.
        remark: called with a kind and words (`pipeline.datasets.video_decoder.remarks`), once for each kind.

    Returns:
        frame number, from 0, (H, W) float32 in [0, 1], and how it was stored.

    Raises:
        BadVideo: after the last good frame, if frames are missing, damaged or interlaced; or at once, if there is none.
    """
    with contextlib.closing(Decoder(path)) as decoder:
        account = _Account(decoder.declared, decoder.per_second, decoder.messages)
        stated: set[str] = set()
        while (frame := decoder.read()) is not None:
            problem, number = TORN if decoder.torn else defect(frame), account.number
            taken = due(number, decoder.per_second) if due is not None else number % every == 0
            if taken and not problem:
                try:
                    image = grey_levels(frame)
                except InputError as error:
                    problem = str(error)
                else:
                    for kind, words in remarks(frame).items():
                        if remark is not None and kind not in stated:
                            remark(kind, words)
                        stated.add(kind)
                    yield number, image, decoder.coding
            account.add(decoder.time_s(frame), problem)
    if not account.number:
        reason = f" ({account.messages[0]})" if account.messages else ""
        raise BadVideo(path, f"not a video that FFmpeg can read, or it holds no frame{reason}")
    if problems := account.problems(path):
        raise BadVideo(path, "; ".join(problems))


@dataclass
class _Account:
    """What a video declares, and what was found in it so far.

    Attributes:
        declared: number of frames by its header.
        per_second: frames per second by its header.
        messages: of the decoder, about frames.
        number: frames read.
        interlaced: of them, those stored as two fields.
        undecoded: others without a picture, by the reason.
        first_damage: number of the frame at which the first message came.
        last_s: time of the last frame, seconds.
        longest_s: longest time between two frames, seconds.
    """

    declared: int
    per_second: float
    messages: list[str] = field(default_factory=list)
    number: int = 0
    interlaced: int = 0
    undecoded: Counter[str] = field(default_factory=Counter)
    first_damage: int | None = None
    last_s: float = 0.0
    longest_s: float = 0.0

    def add(self, time_s: float | None, problem: str) -> None:
        """Count a frame at a time in seconds, if known; the problem says why it has no picture."""
        if time_s is None:
            time_s = self.last_s + (1 / self.per_second if self.per_second and self.number else 0.0)
        self.last_s, self.longest_s = time_s, max(self.longest_s, time_s - self.last_s if self.number else 0.0)
        if problem == INTERLACED:
            self.interlaced += 1
        elif problem:
            self.undecoded[problem] += 1
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
        results += [f"frames without a picture: {count}, {reason}" for reason, count in self.undecoded.items()]
        if self.messages:
            near = f"near frame {self.first_damage}" if self.first_damage is not None else "at its end"
            more = f" and {len(self.messages) - 1} more" if len(self.messages) >= _SEVERAL else ""
            results.append(f"the decoder reports damage {near} ({self.messages[0]}{more})")
        damage = [f"damaged or cut short: {'; '.join(results)}"] if results else []
        fields = [f"{self.interlaced} of {self.number} frames are {INTERLACED}"] if self.interlaced else []
        return fields + damage
