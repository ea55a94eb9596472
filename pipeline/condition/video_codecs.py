"""Noise behind video codecs whose traces noise estimators do not see.

The default estimator recognises JPEG, MPEG-4 and H.264 by their transform blocks (`pipeline.noise.codec_traces`). HEVC,
VP9 and AV1 choose among blocks of many sizes and filter their edges: most tiles show no trace, weak noise is gone or
smoothed, and the rest is read as next to none. So a frame that is known to have been stored by one of them, and is read
as less than `HIDDEN_DN`, has no answer, and a bound to which what the codec may have removed is added in squares:

    most noise = sqrt(high^2 + HIDDEN_DN^2)
"""

from __future__ import annotations

import numpy as np

from pipeline.noise.base import COMPRESSED, NoiseEstimate

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


def withheld(estimate: NoiseEstimate) -> NoiseEstimate:
    """The estimate of a frame's tiles without answers, and with bounds that allow for what a codec may have removed."""
    nothing = np.full(len(estimate), np.nan)
    return NoiseEstimate(
        nothing, nothing.copy(), nothing.copy(), np.ones(len(estimate), bool),
        np.where(estimate.abstained, estimate.reason, COMPRESSED),
        white_sigma_dn=None if estimate.white_sigma_dn is None else nothing.copy(),
        correlation=None if estimate.correlation is None else nothing.copy(),
        at_most_dn=None if estimate.at_most_dn is None else np.hypot(estimate.at_most_dn, HIDDEN_DN),
    )  # fmt: skip
