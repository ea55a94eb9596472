"""How a frame was stored: its codec, and how coarsely that quantised, from headers of the bit stream.

The quantiser is the index of the step size that a frame's header states, before changes from block to block:

| codec | quantiser | range |
|---|---|---|
| `h264` | of a slice: 26 + ``pic_init_qp_minus26`` + ``slice_qp_delta`` (ITU-T H.264, 7.4.3) | 0 to 51 |
| `hevc` | of a slice: 26 + ``init_qp_minus26`` + ``slice_qp_delta`` (ITU-T H.265, 7.4.7.1) | 0 to 51 |
| `vp8` | ``base_qindex`` (RFC 6386, 9.6) | 0 to 127 |
| `vp9`, `av1` | ``base_q_idx`` (VP9 and AV1 bit stream specifications) | 0 to 255 |

FFmpeg's bit-stream filter ``trace_headers`` reads the headers, in a tenth of a millisecond a frame.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any

RECENT_FRAMES = 24
"""The quantiser of a frame is the coarsest of as many: a frame is predicted from others, is decoded before or after
them, and what those lack it lacks as well."""

FILTER = "trace_headers"
CODECS = ("h264", "hevc", "vp8", "vp9", "av1")
_PARAMETER_SETS = ("pic_parameter_set_id", "pps_pic_parameter_set_id", "slice_pic_parameter_set_id")
_MIDDLES = ("pic_init_qp_minus26", "init_qp_minus26")
_INDICES = ("base_qindex", "base_q_idx")
_NAMES = frozenset([*_PARAMETER_SETS, *_MIDDLES, *_INDICES, "slice_qp_delta"])
_LINE = re.compile(r"(\S+)\s+[01]*\s*= (-?[0-9]+)\s*$")
_LOGGING = Lock()
"""Held while FFmpeg logs more than errors: the filter writes what it reads to the log, whose level is the process's."""


@dataclass(frozen=True)
class Coding:
    """How a frame was stored.

    Attributes:
        codec: FFmpeg's name of it, e.g. ``"hevc"``; empty where it is unknown.
        quantiser: see the module; None where it is unknown.
    """

    codec: str = ""
    quantiser: int | None = None

    def or_by(self, codec: str) -> Coding:
        """This coding, or that by a codec named where none is known."""
        return self if self.codec else Coding(codec)


UNKNOWN = Coding()


class Quantisers:
    """The quantisers of a video's frames, packet by packet.

    Args:
        stream: of PyAV, of a file or network stream.
        codec: FFmpeg's name of it; of those that are not in the module's table nothing is read.

    Attributes:
        coarsest: the greatest of the last `RECENT_FRAMES`; None where none is known.
    """

    coarsest: int | None = None

    def __init__(self, stream: Any, codec: str) -> None:
        import av
        from av.bitstream import BitStreamFilterContext

        self._filter: Any = None
        self._recent: deque[int] = deque(maxlen=RECENT_FRAMES)
        self._middle: dict[int, int] = {}
        """Identifier of a picture parameter set -> the quantiser that its slices differ from."""
        self._set = 0
        if codec in CODECS:
            # a ValueError where FFmpeg was built without the filter
            with _header_fields() as fields, suppress(av.FFmpegError, ValueError):
                self._filter = BitStreamFilterContext(FILTER, stream)
            self._stated(fields)

    def add(self, packet: Any) -> None:
        """Read the headers of a packet of PyAV, which must have been decoded: the filter empties it."""
        import av

        if self._filter is None or not packet.size:
            return
        with _header_fields() as fields, suppress(av.FFmpegError):  # the decoder reports damage
            self._filter.filter(packet)
        if stated := self._stated(fields):
            self._recent.append(max(stated))
            self.coarsest = max(self._recent)

    def _stated(self, fields: Sequence[tuple[str, int]]) -> list[int]:
        """The quantisers of a packet's pictures or slices; parameter sets are kept for the packets that follow."""
        quantisers = []
        for name, value in fields:
            if name in _PARAMETER_SETS:
                self._set = value
            elif name in _MIDDLES:
                self._middle[self._set] = 26 + value
            elif name == "slice_qp_delta" and self._set in self._middle:
                quantisers.append(self._middle[self._set] + value)
            elif name in _INDICES:
                quantisers.append(value)
        return quantisers


def coding_of_items(path: Path) -> Coding:
    """How the picture of a HEIF or AVIF file was stored, which may be in many tiles: the coarsest quantiser counts.

    Tiles of an auxiliary picture, as a map of gains for bright displays, are not told from those of the picture.

    Returns:
        `UNKNOWN` where FFmpeg does not read the file.
    """
    import av
    from av.stream import Disposition

    primary = Disposition.default | Disposition.dependent
    with av.logging.Capture(), suppress(av.FFmpegError, ValueError), av.open(f"file:{path}") as container:
        streams = [
            stream for stream in container.streams.video
            if stream.codec_context is not None and stream.disposition & primary
        ]  # fmt: skip
        codecs = [str(stream.codec_context.codec.canonical_name) for stream in streams]
        quantisers = {stream.index: Quantisers(stream, codec) for stream, codec in zip(streams, codecs, strict=True)}
        for packet in container.demux(streams) if streams else ():
            quantisers[packet.stream.index].add(packet)
        known = [tile.coarsest for tile in quantisers.values() if tile.coarsest is not None]
        return Coding(codecs[0] if codecs else "", max(known, default=None))
    return UNKNOWN


@contextmanager
def _header_fields() -> Iterator[list[tuple[str, int]]]:
    """Names and values of the header fields used here that the filter reads meanwhile; they are there at the end."""
    import av

    fields: list[tuple[str, int]] = []
    with _LOGGING, av.logging.Capture() as logs:
        level = av.logging.get_level()
        av.logging.set_level(av.logging.INFO)
        try:
            yield fields
        finally:
            av.logging.set_level(level)
            matches = (_LINE.search(text) for _, _, text in logs if not _NAMES.isdisjoint(text.split()))
            fields += [(match[1], int(match[2])) for match in matches if match]
