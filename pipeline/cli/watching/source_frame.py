"""What a watched source delivers at one look: a frame, or the reason why there is none."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pipeline.datasets.decoding.video_coding import UNKNOWN, Coding

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True)
class SourceFrame:
    """One frame, or the reason why there is none.

    Attributes:
        name: of the frame.
        image: (H, W) float32 in [0, 1], or None.
        problem: why there is no picture; empty where nothing has come.
        signal_lost: whether it is the source itself that delivers nothing.
        coding: how it was stored; unknown for a camera of this computer.
    """

    name: str
    image: NDArray[np.float32] | None
    problem: str = ""
    signal_lost: bool = False
    coding: Coding = UNKNOWN
