"""Decoded frames of a video file or network stream, with what the decoder reports about them. FFmpeg decodes (PyAV).

OpenCV's reader of videos is not used. Where its conversion to BGR fails, as on interlaced frames with FFmpeg 8, or
where the pixel format changes, it returns a buffer that holds an earlier frame or was never written, and calls that a
success; PyAV raises an error. Of progressive 8-bit video both give the same pixels, bit for bit.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.datasets.decoding.video_coding import Coding, Quantisers
from pipeline.errors import InputError

if TYPE_CHECKING:
    import numpy as np

    Frame = Any
    """A frame of PyAV, ``av.VideoFrame``."""

INTERLACED = (
    "interlaced: stored as two fields, pictures of two moments; take one of them (ffmpeg -vf field) or "
    "deinterlace them (ffmpeg -vf yadif), which changes the noise"
)
TORN = "cut off"
TURNED, CURVE = "turned", "curve"
"""Kinds of remarks about a video that can be read: see `remarks`."""

VIDEO_BLACK, VIDEO_RANGE = 16, 219  # grey levels of limited range, 16 to 235
_STREAM_OPTIONS = {"rtsp_flags": "prefer_tcp"}  # over UDP packets are lost, and with them parts of frames
CURVES = {
    8: "linear",
    9: "logarithmic",
    10: "logarithmic",
    16: "PQ (SMPTE ST 2084)",
    17: "SMPTE ST 428",
    18: "HLG (ARIB STD-B67)",
}
"""Transfer characteristics (ITU-T H.273) that are far from those of sRGB and BT.709."""


class BadVideo(InputError):
    """A video that cannot be read, or some of whose frames are missing, damaged or interlaced.

    Attributes:
        reason: why, in a few words.
    """

    def __init__(self, source: Path | str, reason: str) -> None:
        self.source, self.reason = source, reason
        super().__init__(f"{source}: {reason}")

    def __reduce__(self) -> tuple[type[BadVideo], tuple[Path | str, str]]:
        return BadVideo, (self.source, self.reason)  # so that it crosses from a worker process


class Decoder:
    """Frames in order; a packet that cannot be decoded is passed over, and what the decoder reports is collected.

    Args:
        source: a file, or an address such as ``rtsp://...``.
        timeout_s: longest wait for a connection and for data, seconds; None for a file.
        threads: of the decoder; 0 for as many as it likes. Messages of threads other than the caller's are lost.

    Attributes:
        messages: errors that the decoder has reported since the caller last cleared the list.
        declared: number of frames that the file states, less those that its edit list hides; where it states none,
            duration times rate; 0 if unknown.
        counted: whether the file states a number of frames.
        per_second: frames per second; 0 if unknown.
        begins_s: the beginning of the video since that of the file, where sound may begin earlier, seconds.
        others_end_s: the end so far of other streams, as of sound, seconds since the beginning of the file.
        torn: whether the file ends within the data of the frame read last; known of codecs without prediction, as
            Motion JPEG, in containers that state how long the data are.

    Raises:
        BadVideo: it cannot be opened, or holds no video that can be decoded.
    """

    def __init__(self, source: Path | str, timeout_s: float | None = None, threads: int = 1) -> None:
        import av

        _quieten()
        self.messages: list[str] = []
        # "file:", lest a colon in the name be taken for the end of a protocol
        address = f"file:{source}" if isinstance(source, Path) else source
        options = {} if isinstance(source, Path) else _STREAM_OPTIONS
        with av.logging.Capture() as logs:
            try:
                self._container: Any = av.open(address, options=options, timeout=timeout_s)
            except (av.FFmpegError, ValueError) as error:  # ValueError: a name that is not valid UTF-8
                reason = logs[-1][2].strip() if logs else _reason(error)
                raise BadVideo(source, f"not a video that FFmpeg can read ({reason})") from None
        stream = self._container.streams.best("video")
        if stream is None or stream.codec_context is None:
            self._container.close()
            reason = "it holds no video" if stream is None else "there is no decoder for its codec"
            raise BadVideo(source, f"not a video that FFmpeg can read ({reason})")
        self._codec: Any = stream.codec_context
        self._codec.thread_count = threads
        self._index = stream.index
        self._packets: Iterator[Any] = self._container.demux()  # of all streams: the duration is that of the longest
        self._frames: deque[Frame] = deque()
        codec = str(self._codec.codec.canonical_name)
        self._name, self._quantisers = codec, Quantisers(stream, codec)
        self._each_alone = bool(self._codec.codec.intra_only)
        self.torn = False
        self._began_s = float((stream.start_time or 0) * stream.time_base) if stream.time_base else 0.0
        began = self._container.start_time if self._container.format.name != "flv" else None
        self._file_began_s = self._began_s if began is None else float(began / av.time_base)
        self.begins_s = self._began_s - self._file_began_s
        self.others_end_s = 0.0
        self.per_second = float(stream.guessed_rate or stream.average_rate or 0)
        self.counted = stream.frames > 0
        self.declared = self._count(stream) if self.counted else round(self._duration_s(stream) * self.per_second)

    def _count(self, stream: Any) -> int:
        if "mp4" not in self._container.format.name:
            return int(stream.frames)
        return sum(not entry.is_discard for entry in stream.index_entries)  # without what an edit list leaves out

    def _duration_s(self, stream: Any) -> float:
        import av

        if self._container.duration:
            before_s = self._file_began_s if self._container.format.name == "flv" else 0.0  # FLV counts from time 0
            return float(self._container.duration / av.time_base) - before_s
        return float(stream.duration * stream.time_base) if stream.duration and stream.time_base else 0.0

    @property
    def coding(self) -> Coding:
        """How the frame read last was stored."""
        return Coding(self._name, self._quantisers.coarsest)

    def read(self) -> Frame | None:
        """The next frame; None after the last, or where the stream breaks off."""
        import av

        with av.logging.Capture() as logs:
            try:
                while not self._frames:
                    packet = next(self._packets, None)
                    if packet is None:
                        break
                    if packet.stream.index != self._index:
                        self._note_end(packet)
                        continue
                    self.torn = self._each_alone and bool(packet.is_corrupt)
                    try:
                        self._frames.extend(packet.decode())
                    except av.error.EOFError:
                        break
                    except av.FFmpegError as error:
                        self._collect(logs, _reason(error))
                    self._quantisers.add(packet)
            except av.FFmpegError as error:  # no packet can be read any more
                self._collect(logs, _reason(error))
                self._packets = iter(())
                self._frames.extend(self._rest())
            self._collect(logs)
        return self._frames.popleft() if self._frames else None

    def _note_end(self, packet: Any) -> None:
        """Note where a packet of another stream ends."""
        if packet.pts is not None and packet.time_base:
            end_s = float((packet.pts + (packet.duration or 0)) * packet.time_base) - self._file_began_s
            self.others_end_s = max(self.others_end_s, end_s)

    def _rest(self) -> list[Frame]:
        """Frames that the decoder has kept back."""
        import av

        try:
            return list(self._codec.decode(None))
        except av.FFmpegError:
            return []

    def _collect(self, logs: list[tuple[int, str, str]], otherwise: str = "") -> None:
        """Move what was logged to `messages`; without any, what is given instead."""
        import av

        # Less than a warning is nothing that was reported: another thread may just read headers (`video_coding`).
        grave = [(name, text.strip()) for level, name, text in logs if level < av.logging.INFO and text.strip()]
        lines = [f"[{name}] {text}" if name else text for name, text in grave]
        self.messages += lines or [otherwise] * bool(otherwise)
        logs.clear()

    def time_s(self, frame: Frame) -> float | None:
        """Time of a frame since the beginning of the video, seconds; None where it has none."""
        ticks = frame.pts if frame.pts is not None else frame.dts
        return None if ticks is None or not frame.time_base else float(ticks * frame.time_base) - self._began_s

    def close(self) -> None:
        """Close the file or connection."""
        self._container.close()


def defect(frame: Frame) -> str:
    """Why a frame must not be measured, in words; empty where it may be."""
    if frame.interlaced_frame:
        return INTERLACED
    return "marked as damaged by the decoder" if frame.is_corrupt else ""


def grey_levels(frame: Frame) -> np.ndarray:
    """A decoded frame as (H, W) float32 grey levels in [0, 1]: 8-bit BT.601 luma, not turned.

    Raises:
        InputError: its pixels cannot be converted.
    """
    import av
    import numpy as np
    from av.video.reformatter import ColorRange

    try:
        # bicubic, as OpenCV's reader converts
        pixels = _full_colour(frame).reformat(format="bgr24", interpolation="BICUBIC").to_ndarray()
    except (av.FFmpegError, ValueError) as error:
        raise InputError(f"pixels of the format {frame.format.name} cannot be converted ({_reason(error)})") from None
    pixels = np.asarray(pixels, np.uint8)
    if frame.format.name.startswith("gray") and frame.color_range == ColorRange.MPEG:
        # FFmpeg takes grey pixels for full range, whatever their file says.
        pixels = np.clip(np.rint((pixels - np.float32(VIDEO_BLACK)) * (255 / VIDEO_RANGE)), 0, 255).astype(np.uint8)
    return grey_frame(pixels)


def _full_colour(frame: Frame) -> Frame:
    """A frame of more than 8 bits with a colour for every pixel; others as they are.

    FFmpeg converts these with fewer colours to 8 bits 1 DN too dark, white to 254.
    """
    layout = frame.format
    bits = max(component.bits for component in layout.components)
    if bits <= 8 or layout.is_rgb or not any(component.width < layout.width for component in layout.components):
        return frame
    return frame.reformat(format=f"yuv444p{bits}le", interpolation="BICUBIC")


def grey_frame(frame: np.ndarray) -> np.ndarray:
    """An 8-bit frame, (H, W, 3) BGR or (H, W), as (H, W) float32 grey levels in [0, 1] (BT.601 luma)."""
    import cv2
    import numpy as np

    grey = cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY) if frame.ndim == 3 else frame
    return grey.astype(np.float32) / np.float32(255)


def remarks(frame: Frame) -> dict[str, str]:
    """What a user should know about a frame that can be measured, by kind (`TURNED`, `CURVE`), in words."""
    results = {}
    if angle := int(frame.rotation) % 360:
        results[TURNED] = f"rotation {angle} degrees"
    if curve := CURVES.get(int(getattr(frame, "color_trc", 0))):
        results[CURVE] = curve
    return results


def _reason(error: Exception) -> str:
    """What went wrong, without the name of the source, which may hold a password."""
    return str(getattr(error, "strerror", None) or error)


def _quieten() -> None:
    """Have PyAV collect error messages, every one of them, and print none."""
    import av

    if av.logging.get_level() is None:
        av.logging.set_level(av.logging.ERROR)
    av.logging.set_skip_repeated(False)  # it would leave out the first message of a file that repeats the last one's
    logger = logging.getLogger("libav")
    if not logger.handlers:
        logger.addHandler(logging.NullHandler())
