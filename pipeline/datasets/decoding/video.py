"""Videos: frames as grey levels, with broken ones counted and reported.

A decoder hides damage: a file that is cut short ends early, a broken block is filled with its neighbours. Here the
frames decoded are compared with the number the file declares, and the decoder's error messages are collected.
Interlaced frames are not measured: their two fields are pictures of two moments.
`pipeline.datasets.decoding.video_decoder` decodes.
"""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.datasets.decoding.video_decoder import INTERLACED, TORN, BadVideo, Decoder, defect, grey_levels, remarks
from pipeline.errors import InputError

if TYPE_CHECKING:
    import numpy as np

    from pipeline.datasets.decoding.video_coding import Coding

__all__ = ["SUFFIXES", "BadVideo", "read_video"]

SUFFIXES = frozenset({
    ".mp4", ".avi", ".mov", ".m4v", ".3gp", ".mjpg", ".ts", ".mts", ".m2ts", ".mkv", ".webm", ".wmv", ".asf", ".flv",
    ".mpg", ".mpeg", ".vob",
})  # fmt: skip
_SEVERAL = 2
_SOUND_S = 0.05  # two packets of sound: some durations count what its encoder adds before or behind it


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
        remark: called with a kind and words (`pipeline.datasets.decoding.video_decoder.remarks`), once for each kind.

    Returns:
        frame number, from 0, (H, W) float32 in [0, 1], and how it was stored.

    Raises:
        BadVideo: after the last good frame, if frames are missing, damaged or interlaced; or at once, if there is none.
    """
    with contextlib.closing(Decoder(path)) as decoder:
        account = _Account(decoder)
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
        reason = f" ({decoder.messages[0]})" if decoder.messages else ""
        raise BadVideo(path, f"not a video that FFmpeg can read, or it holds no frame{reason}")
    if problems := account.problems():
        raise BadVideo(path, "; ".join(problems))


@dataclass
class _Account:
    """What was found so far in a video that is read.

    Attributes:
        decoder: what it declares, and the messages about its frames.
        number: frames read.
        interlaced: of them, those stored as two fields.
        undecoded: others without a picture, by the reason.
        first_damage: number of the frame at which the first message came.
        last_s: time of the last frame, seconds.
        longest_s: longest time between two frames, seconds.
    """

    decoder: Decoder
    number: int = 0
    interlaced: int = 0
    undecoded: Counter[str] = field(default_factory=Counter)
    first_damage: int | None = None
    last_s: float = 0.0
    longest_s: float = 0.0

    def add(self, time_s: float | None, problem: str) -> None:
        """Count a frame at a time in seconds, if known; the problem says why it has no picture."""
        if time_s is None:
            per_second = self.decoder.per_second
            time_s = self.last_s + (1 / per_second if per_second and self.number else 0.0)
        self.last_s, self.longest_s = time_s, max(self.longest_s, time_s - self.last_s if self.number else 0.0)
        if problem == INTERLACED:
            self.interlaced += 1
        elif problem:
            self.undecoded[problem] += 1
        if self.decoder.messages and self.first_damage is None:
            self.first_damage = self.number
        self.number += 1

    def problems(self) -> list[str]:
        """What is wrong with the file, in words, once all of its frames are read; empty where nothing is."""
        results = []
        declared, messages = self.decoder.declared, self.decoder.messages
        # A number derived from a duration is too large where the rate varies or the sound is longer. The last frame is
        # taken to last as long as the longest of the others; half a frame is rounding of the number.
        end_s = max(self.decoder.begins_s + self.last_s + self.longest_s, self.decoder.others_end_s + _SOUND_S)
        whole = not self.decoder.counted and declared - 0.5 <= end_s * self.decoder.per_second + 0.1
        if declared > self.number and not whole:
            missing = declared - self.number
            results.append(f"{missing} of the {declared} frames it declares are missing; {self.number} were read")
        results += [f"frames without a picture: {count}, {reason}" for reason, count in self.undecoded.items()]
        if messages:
            near = f"near frame {self.first_damage}" if self.first_damage is not None else "at its end"
            more = f" and {len(messages) - 1} more" if len(messages) >= _SEVERAL else ""
            results.append(f"the decoder reports damage {near} ({messages[0]}{more})")
        damage = [f"damaged or cut short: {'; '.join(results)}"] if results else []
        fields = [f"{self.interlaced} of {self.number} frames are {INTERLACED}"] if self.interlaced else []
        return fields + damage
