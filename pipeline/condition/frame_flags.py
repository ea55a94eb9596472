"""Faults of a frame beside blur and noise: black, dark, over-exposed and frozen, each with its measure.

The measures are plain statistics of grey levels (DN, 0..255), so that an operator can check them by eye:

| flag | measure | raised when |
|---|---|---|
| ``black`` | ``bright_dn``: 99th percentile | below 8 DN: lens cap, lost signal |
| ``dark`` | ``median_dn`` | below 16 DN, and not black |
| ``over_exposed`` | ``saturated_fraction``: pixels of at least 250 DN | above 0.25 |
| ``frozen`` | ``repeats``: frames in a row that equal this one, pixel by pixel | at least 3 |

Noise makes the frames of a live camera differ, so that equal ones mean a stream that stands still.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

BLACK_BELOW_DN = 8.0
DARK_BELOW_DN = 16.0
SATURATED_DN = 250.0
OVER_EXPOSED_FRACTION = 0.25
FROZEN_REPEATS = 3


@dataclass(frozen=True)
class FrameFlags:
    """Measures of one frame and the flags they raise.

    Attributes:
        bright_dn: 99th percentile of grey levels, DN.
        median_dn: median grey level, DN.
        saturated_fraction: share of pixels of at least 250 DN, 0..1.
        repeats: earlier frames in a row that equal this one; 0 for a picture.
    """

    bright_dn: float
    median_dn: float
    saturated_fraction: float
    repeats: int

    @property
    def names(self) -> tuple[str, ...]:
        """Flags raised, in the order of the module's table."""
        black = self.bright_dn < BLACK_BELOW_DN
        raised = {
            "black": black,
            "dark": not black and self.median_dn < DARK_BELOW_DN,
            "over_exposed": self.saturated_fraction > OVER_EXPOSED_FRACTION,
            "frozen": self.repeats >= FROZEN_REPEATS,
        }
        return tuple(name for name, holds in raised.items() if holds)


class FrameInspector:
    """Measures frames one after the other; remembers the last frame of a stream."""

    def __init__(self) -> None:
        self._stream, self._last, self._repeats = "", np.empty((0, 0), np.float32), 0

    def inspect(self, image: NDArray[np.floating], stream: str = "") -> FrameFlags:
        """Measure one frame.

        Args:
            image: (H, W) float in [0, 1].
            stream: what it is a frame of, e.g. a video's name; empty for a single picture, which repeats nothing.
        """
        same = bool(stream) and stream == self._stream and np.array_equal(image, self._last)
        self._repeats = self._repeats + 1 if same else 0
        self._stream, self._last = stream, np.asarray(image)
        levels_dn = 255.0 * np.asarray(image, dtype=np.float32)
        bright, median = np.percentile(levels_dn, [99, 50])
        # half a level of slack: grey levels of 8 bits come as multiples of 1/255, rounded to float32
        saturated = float(np.mean(levels_dn >= SATURATED_DN - 0.5))
        return FrameFlags(float(bright), float(median), saturated, self._repeats)
