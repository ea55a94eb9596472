"""Noise behind video codecs whose traces noise estimators do not see.

The default estimator recognises JPEG, MPEG-4 and H.264 by their transform blocks (`pipeline.noise.codec_traces`). HEVC,
VP8, VP9 and AV1 filter the edges of theirs, and most choose among many sizes: most tiles show no trace, weak noise is
gone or smoothed, and the rest is read as next to none. So a frame that is known to have been stored by one of them, and
is read as less than `READ_FROM_DN`, has no answer, and a bound to which what the codec may hide is added in squares:

    most noise = sqrt(high^2 + hidden^2)
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

HIDDEN_DN: Mapping[str, float] = {"hevc": 11.0, "vp8": 13.5, "vp9": 6.0, "av1": 9.5}
"""Codec, as FFmpeg names it -> noise of a decoded frame that is not read, DN: the most that was seen with quantisers
from fine to very coarse (`benchmarks/video_codecs.py`) and, by hand, at 0.5 to 2 Mbit/s. Coarse ones leave coding
errors that change from frame to frame, in large blocks."""

READ_FROM_DN = 6.0
"""Frames read as more are right, but for one in a hundred: HEVC at a constant rate factor of 33 leaves 4 to 7 DN of 10,
most of which are read as 0 to 3; 25 DN are read right."""


OTHER_NAMES: Mapping[str, str] = {
    **dict.fromkeys(("h265", "h.265", "x265", "hvc1", "hev1"), "hevc"),
    **dict.fromkeys(("vp08", "vp80"), "vp8"), **dict.fromkeys(("vp09", "vp90"), "vp9"), "av01": "av1",
}  # fmt: skip
"""Common names and four-character codes, as OpenCV gives them, of the codecs of `HIDDEN_DN` -> FFmpeg's name."""


def ffmpeg_name(codec: str) -> str:
    """FFmpeg's name of a codec of `HIDDEN_DN`, in any case, or one of its `OTHER_NAMES`; others in small letters."""
    name = codec.strip().lower()
    return OTHER_NAMES.get(name, name)


def may_hide(codec: str, frame_dn: float) -> bool:
    """Whether a codec may have removed noise of a frame.

    Args:
        codec: of the video that the frame is of (`ffmpeg_name`); empty where it is unknown, or for a picture.
        frame_dn: noise that is estimated of the frame, DN; NaN where there is no estimate.
    """
    return ffmpeg_name(codec) in HIDDEN_DN and not frame_dn >= READ_FROM_DN


def with_hidden(most_dn: NDArray[np.float64], codec: str) -> NDArray[np.float64]:
    """Bounds (N,) of a frame's tiles, DN, that allow for the noise that a codec of `HIDDEN_DN` may hide."""
    return np.hypot(most_dn, HIDDEN_DN[ffmpeg_name(codec)])
