"""Counts how many earlier frames of a stream in a row a frame repeats: pixel by pixel, or as far as a codec lets it.

A codec goes on refining a picture that stands still, so that decoded frames of it are hardly ever equal. With x_t the
grey levels of frame t (DN) and x_a those of the first frame of a run, frame t is *alike* where

    mean |x_t - x_a| <= 0.02 DN   and   max over blocks of 16 x 16 px of the block's mean |x_t - x_a| <= 2 DN.

Blocks keep a small object that moves before a still background from being averaged away (an object of 12 x 24 px
changes a frame of 960 x 368 px by 0.01 DN on average, but its blocks by 5). Frames are compared with the first of the
run, not with frame t - 1: what a codec still changes of a still picture stays within the bounds, what it lets through
of a live camera's noise adds up from frame to frame. Frames that are only alike count from the tenth on, equal ones at
once.

Measured on stills of KITTI, Udacity and PolyU behind H.264 (CRF 18 to 35, ultrafast to medium), H.265 and MPEG-4: once
the codec has settled, which takes up to 30 frames after the last motion, neighbours differ by at most 0.015 DN. A key
frame often differs from those before it by more (0.4 to 1.4 DN); the count then begins again.

A stream that is stored at a higher rate than its camera has repeats each frame as often; `RepeatCounter.usual` tells
how often. A run of equal frames counts as usual where the next frame is another picture, by more than
`OTHER_PICTURE_DN` on average, as noise and motion make it and a key frame does not.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

ALIKE_DN = 0.02
BLOCK_ALIKE_DN = 2.0
BLOCK_PX = 16
OTHER_PICTURE_DN = 2.0
USUAL_RUNS = 2  # completed one after the other, from which the shorter is usual
LEAST_ALIKE = 10  # repeats that are not exact do not count before there are this many


class RepeatCounter:
    """Takes the frames of a stream one after the other; remembers the last one and the first one of the run."""

    def __init__(self) -> None:
        self._stream = ""
        self._last = self._first = np.empty((0, 0), np.float32)
        self._equal = self._alike = 0
        self._completed: deque[int] = deque(maxlen=USUAL_RUNS)

    @property
    def usual(self) -> int:
        """How often each frame of the stream was repeated before this run: 0 of a camera's own rate."""
        return min(self._completed) if len(self._completed) == USUAL_RUNS else 0

    def count(self, image: NDArray[np.floating], stream: str) -> int:
        """Take the next frame.

        Args:
            image: (H, W) float in [0, 1]; may be overwritten after the call.
            stream: what it is a frame of; empty for a single picture, which repeats nothing.

        Returns:
            earlier frames in a row that it repeats: those equal to it, or those alike where they are at least ten.
        """
        frame = np.asarray(image, dtype=np.float32)
        known = bool(stream) and stream == self._stream and frame.shape == self._last.shape
        self._stream = stream
        if not known:
            self._completed.clear()
        if known and np.array_equal(frame, self._last):
            self._equal, self._alike = self._equal + 1, self._alike + 1
        else:
            if known:
                self._completed.append(self._equal if self._equal and _is_another(frame, self._last) else 0)
            self._last, self._equal = frame.copy(), 0  # the caller may read the next frame into the array
            if known and alike(self._last, self._first):
                self._alike += 1
            else:
                self._first, self._alike = self._last, 0
        return self._alike if self._alike >= LEAST_ALIKE else self._equal


def _is_another(image: NDArray[np.float32], other: NDArray[np.float32]) -> bool:
    """Whether two frames differ by more than a key frame changes a picture that stands still."""
    import cv2

    return bool(cv2.norm(image, other, cv2.NORM_L1) > OTHER_PICTURE_DN / 255 * image.size)


def alike(image: NDArray[np.float32], other: NDArray[np.float32]) -> bool:
    """Whether two frames differ by no more than a codec changes a picture that stands still.

    Args:
        image: (H, W) float in [0, 1].
        other: (H, W) likewise.
    """
    import cv2

    lines = slice(None, None, BLOCK_PX)  # a sixteenth of the lines suffices to reject most frames of a live camera
    bound = ALIKE_DN / 255 * image.size  # of the sum of all differences
    if not cv2.norm(image[lines], other[lines], cv2.NORM_L1) <= bound:
        return False
    differences = cv2.absdiff(image, other)
    height, width = image.shape
    side = min(BLOCK_PX, height, width)
    whole = differences[: height // side * side, : width // side * side]
    blocks = cv2.resize(whole, (width // side, height // side), interpolation=cv2.INTER_AREA)
    return bool(cv2.sumElems(differences)[0] <= bound and blocks.max() <= BLOCK_ALIKE_DN / 255)
