"""Noise behind video codecs whose traces noise estimators do not see.

The default estimator recognises JPEG, MPEG-4 and H.264 by their transform blocks (`pipeline.noise.traces.codec`). HEVC,
VP8, VP9 and AV1 filter the edges of theirs, and most choose among many sizes: most tiles show no trace, weak noise is
gone or smoothed, and the rest is read as next to none. So a frame that is known to have been stored by one of them, and
is read as less than what the codec may hide (times `DOUBTED`, at most `READ_FROM_DN`), has no answer, and a bound to
which what may be hidden is added in squares:

    most noise = sqrt(high^2 + hidden^2)

What may be hidden grows with the quantiser q (`pipeline.datasets.decoding.video_coding`), linearly from 0 to the most
that was seen, and is the latter where q is unknown:

    hidden = most * clip((q - first) / (last - first), 0, 1)

The coarsest quantisers of H.264 leave more noise than bounds allow for, too: where one is known it counts likewise.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from math import isfinite
from numbers import Real

from pipeline.errors import InputError, did_you_mean


@dataclass(frozen=True)
class Hidden:
    """Noise of a decoded frame that is not read: at least what was seen with quantisers from fine to very coarse.

    Attributes:
        most_dn: with any quantiser (`benchmarks/video_codecs.py` and, by hand, 0.5 to 2 Mbit/s), DN. Coarse ones leave
            coding errors that change from frame to frame, in large blocks.
        first, last: quantisers up to which none is hidden, and from which `most_dn` is.
        shows: whether the codec leaves traces, so that nothing is hidden unless the quantiser is known to be coarse.
    """

    most_dn: float
    first: int
    last: int
    shows: bool = False

    def at(self, quantiser: int | None) -> float:
        """Noise that a quantiser may hide, DN; None where it is unknown."""
        if quantiser is None:
            return 0.0 if self.shows else self.most_dn
        return self.most_dn * min(max((quantiser - self.first) / (self.last - self.first), 0.0), 1.0)


HIDDEN: Mapping[str, Hidden] = {
    "hevc": Hidden(11.0, 14, 46), "vp8": Hidden(13.5, 0, 110), "vp9": Hidden(6.0, 0, 100), "av1": Hidden(9.5, 0, 180),
    "h264": Hidden(6.0, 44, 48, shows=True),
}  # fmt: skip
"""By FFmpeg's name of the codec."""

READ_FROM_DN = 6.0
"""Frames read as more are right, but for one in a hundred: HEVC at a constant rate factor of 33 leaves 4 to 7 DN of 10,
most of which are read as 0 to 3; 25 DN are read right."""

DOUBTED = 1.3
"""Times what may be hidden: of frames read as little more, a part may not have been read either."""

OTHER_NAMES: Mapping[str, str] = {
    **dict.fromkeys(("h265", "h.265", "x265", "hvc1", "hev1"), "hevc"),
    **dict.fromkeys(("vp08", "vp80"), "vp8"), **dict.fromkeys(("vp09", "vp90"), "vp9"), "av01": "av1",
    **dict.fromkeys(("h.264", "x264", "avc1", "avc3"), "h264"),
}  # fmt: skip
"""Common names and four-character codes, as OpenCV gives them, of the codecs of `HIDDEN` -> FFmpeg's name."""


ENCODERS: Mapping[str, str] = {
    "hevc": r"libx265|libkvazaar|(hevc|h265)_\w+", "vp8": r"libvpx|vp8_\w+", "vp9": r"libvpx-vp9|vp9_\w+",
    "av1": r"libaom-av1|libsvtav1|librav1e|libdav1d|av1_\w+", "h264": r"libx264(rgb)?|libopenh264|h264_\w+",
}  # fmt: skip
"""Patterns of FFmpeg's names of encoders and decoders of the codecs of `HIDDEN`, as ``hevc_nvenc``."""

FOUR_CHARACTERS = frozenset({
    "avc1", "cram", "divx", "dx50", "div3", "dvsd", "ffv1", "ffvh", "fmp4", "h263", "hfyu", "i420", "iyuv", "jpeg",
    "lags", "mjpa", "mjpg", "mp42", "mp43", "mp4v", "mpg1", "mpg2", "mpng", "nv12", "ulrg", "uly0", "uly2", "uyvy",
    "v210", "wmv1", "wmv2", "wmv3", "xvid", "y16", "y800", "yuy2", "yuyv", "yv12",
})  # fmt: skip
"""Of codecs that hide no noise, or show traces, as OpenCV and the containers give them."""


def ffmpeg_name(codec: str) -> str:
    """FFmpeg's name of a codec of `HIDDEN`, from any of its names; others in small letters."""
    name = codec.strip().lower()
    name = OTHER_NAMES.get(name, name)
    return next((known for known, pattern in ENCODERS.items() if re.fullmatch(pattern, name)), name)


@cache
def _warn_if_unknown(name: str) -> None:
    """Warn, once, of a name that nobody knows: noise that its codec hides would be read as none."""
    import av

    if name in av.codecs_available or name in FOUR_CHARACTERS:
        return
    hints = (did_you_mean(name, names) for names in (HIDDEN, av.codecs_available))
    otherwise = "expected FFmpeg's name, as hevc, or '' where it is unknown"
    hint = next((hint for hint in hints if hint.startswith("did")), otherwise)
    message = f"codec {name!r} is not known: noise is read as of a picture without a codec; {hint}"
    warnings.warn(message, stacklevel=4)


def hidden_noise_dn(codec: str, quantiser: int | None = None) -> float:
    """Noise of a frame that its codec may hide, DN; 0 for codecs that hide none.

    Args:
        codec: of the video that the frame is of (`ffmpeg_name`); empty where it is unknown, or for a picture.
        quantiser: of the frame, where it is known.

    A name that is not known is warned of.

    Raises:
        InputError: the codec is no text, or the quantiser no number, as the NaN of a table.
    """
    if not isinstance(codec, str):
        raise InputError(f"codec={codec!r}: expected its name, or '' where it is unknown")
    if quantiser is not None and not (isinstance(quantiser, Real) and isfinite(quantiser)):
        raise InputError(f"quantiser={quantiser!r}: expected a number, or None where it is unknown")
    name = ffmpeg_name(codec)
    if name not in HIDDEN:
        if name:
            _warn_if_unknown(name)
        return 0.0
    return HIDDEN[name].at(quantiser)


def is_doubtful(frame_dn: float, hidden_dn: float) -> bool:
    """Whether a codec may have removed noise of a frame.

    Args:
        frame_dn: noise that is estimated of the frame, DN; NaN where there is no estimate.
        hidden_dn: noise that the codec may hide, DN.
    """
    return hidden_dn > 0 and not frame_dn >= min(READ_FROM_DN, DOUBTED * hidden_dn)
