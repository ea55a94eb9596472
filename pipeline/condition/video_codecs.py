"""Noise behind video codecs whose traces noise estimators do not see.

The default estimator recognises JPEG, MPEG-4 and H.264 by their transform blocks (`pipeline.noise.codec_traces`). HEVC,
VP9 and AV1 choose among blocks of many sizes and filter their edges: most tiles show no trace, weak noise is gone or
smoothed, and the rest is read as next to none. So a frame that is known to have been stored by one of them, and is read
as less than `HIDDEN_DN`, has no answer, and a bound to which what the codec may have removed is added in squares:

    most noise = sqrt(high^2 + HIDDEN_DN^2)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

HIDING = frozenset({"hevc", "vp9", "av1"})
"""Names of the codecs, as FFmpeg has them."""

HIDDEN_DN = 6.0
"""Noise that they may hide (`benchmarks/video_codecs.py`): of 10 DN HEVC at a constant rate factor of 33 leaves 4 to 7,
most of which are read as 0 to 3; 25 DN are read right."""


def may_hide(codec: str, frame_dn: float) -> bool:
    """Whether a codec may have removed noise of a frame.

    Args:
        codec: of the video that the frame is of, by FFmpeg's name; empty where it is unknown, or for a picture.
        frame_dn: noise that is estimated of the frame, DN; NaN where there is no estimate.
    """
    return codec in HIDING and not frame_dn >= HIDDEN_DN


def with_hidden(most_dn: NDArray[np.float64]) -> NDArray[np.float64]:
    """Bounds (N,) of a frame's tiles, DN, that allow for noise that a codec may have removed."""
    return np.hypot(most_dn, HIDDEN_DN)
