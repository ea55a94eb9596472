"""Codecs: JPEG files, and one frame of a video (Motion JPEG, MPEG-4 Part 2, H.264, HEVC, VP8, VP9, AV1), for real.

JPEG is OpenCV's (libjpeg-turbo); videos are FFmpeg's through PyAV, one thread, H.264 by the same code on every
processor, so that the same pictures give the same bytes. HEVC, VP8, VP9 and AV1, which no stage stores, choose their
code by the processor. A video frame is predicted from the frames before it, so the frames before are part of the input.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError, did_you_mean

Picture = NDArray[np.uint8]

X264 = {"x264-params": "cpu-independent=1"}
"""The same analysis on every processor: with AVX-512 x264 gave other bytes for 2 % of small pictures, at random."""

X265 = {"x265-params": "log-level=none:pools=none:frame-threads=1"}
REALTIME = {"deadline": "realtime", "cpu-used": "6"}


@dataclass(frozen=True)
class VideoCodec:
    """How FFmpeg makes a video of one codec.

    Attributes:
        encoder: its name.
        worst: largest quality number, the coarsest; the finest is 0 of constant rate factors and 1 of quantisers.
        options: of the encoder, by that number; without any it is a fixed quantiser.
        pixels: format.
    """

    encoder: str
    worst: int = 31
    options: Callable[[int], Mapping[str, str]] | None = None
    pixels: str = "yuv420p"


VIDEO = {
    "h264": VideoCodec("libx264", 51, lambda factor: {"crf": f"{factor}", "preset": "veryfast", **X264}),
    "mpeg4": VideoCodec("mpeg4"),
    "mjpeg": VideoCodec("mjpeg", pixels="yuvj420p"),
    "hevc": VideoCodec("libx265", 51, lambda factor: {"crf": f"{factor}", **X265}),
    "vp8": VideoCodec("libvpx", 63, lambda step: {"qmin": f"{step}", "qmax": f"{step}", "b": "100M", **REALTIME}),
    "vp9": VideoCodec("libvpx-vp9", 63, lambda factor: {"crf": f"{factor}", "b": "0", **REALTIME}),
    "av1": VideoCodec("libsvtav1", 63, lambda factor: {"crf": f"{factor}", "preset": "8"}),
}
CODECS = ("none", "jpeg", *VIDEO)
BLOCK_PX = 8


@dataclass(frozen=True)
class Codec:
    """How a picture is stored.

    Attributes:
        name: one of `CODECS`.
        quality: of JPEG, 1 to 100. Of videos lower is better: the constant rate factor of H.264 and HEVC, 0 to 51, of
            VP9 and AV1, 0 to 63, the quantiser of VP8, 0 to 63, its scale of MPEG-4 and Motion JPEG, 1 to 31.
        full_chroma: JPEG without chroma subsampling (4:4:4); otherwise 4:2:0.
        corner: (rows, columns) cut away before coding, 0 to 7: where the grid of 8 x 8 px blocks begins.
    """

    name: str = "none"
    quality: int = 90
    full_chroma: bool = False
    corner: tuple[int, int] = (0, 0)

    def __post_init__(self) -> None:
        if self.name not in CODECS:
            raise InputError(f"codec: no {self.name!r}; {did_you_mean(self.name, CODECS)}")
        low, high = 1, 100
        if self.name in VIDEO:
            low, high = int(VIDEO[self.name].options is None), VIDEO[self.name].worst
        if self.name != "none" and not low <= self.quality <= high:
            raise InputError(f"codec {self.name}: quality={self.quality}, expected {low} to {high}")
        if not all(0 <= cut < BLOCK_PX for cut in self.corner):
            raise InputError(f"codec {self.name}: corner={self.corner}, expected 0 to {BLOCK_PX - 1} each")


def store(picture: Picture, codec: Codec, before: Sequence[Picture] = ()) -> Picture:
    """A picture as it comes back from storage.

    Args:
        picture: (H, W, 3) uint8 RGB.
        codec: how it is stored.
        before: frames before it in a video, same shape.

    Returns:
        (H, W, 3) uint8; rows and columns that `Codec.corner` cuts keep their values.
    """
    if codec.name == "none":
        return picture
    top, left = codec.corner
    if codec.name == "jpeg":
        coded = jpeg(np.ascontiguousarray(picture[top:, left:]), codec.quality, codec.full_chroma)
    else:
        frames = [np.ascontiguousarray(_even(frame[top:, left:])) for frame in (*before, picture)]
        coded = video(frames, codec.name, codec.quality)[-1]
    result = picture.copy()
    result[top : top + coded.shape[0], left : left + coded.shape[1]] = coded
    return result


def jpeg(picture: Picture, quality: int, full_chroma: bool = False) -> Picture:
    """A picture (H, W, 3) through JPEG at a quality of 1 to 100."""
    import cv2

    sampling = cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444 if full_chroma else cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420
    options = [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, sampling]
    coded = cv2.imencode(".jpg", picture[..., ::-1], options)[1]
    return np.asarray(cv2.imdecode(coded, cv2.IMREAD_COLOR), dtype=np.uint8)[..., ::-1]


def video(frames: Sequence[Picture], name: str, quality: int) -> list[Picture]:
    """Frames through a video codec.

    Motion JPEG turns a grey of 128 into (126, 128, 126): that is FFmpeg's way from RGB to full-range YUV.

    Args:
        frames: (H, W, 3) uint8 RGB, all of one even size.
        name: one of `VIDEO`.
        quality: see `Codec`.

    Returns:
        the decoded frames.
    """
    import av

    with av.open(io.BytesIO(video_file(frames, name, quality)), "r") as stored:
        stored.streams.video[0].codec_context.thread_count = 1
        return [np.asarray(frame.to_ndarray(format="rgb24"), np.uint8) for frame in stored.decode(video=0)]


def video_file(frames: Sequence[Picture], name: str, quality: int) -> bytes:
    """A Matroska file of frames; see `video`."""
    import av
    from av.video.reformatter import ColorRange

    height, width = frames[0].shape[:2]
    file, codec = io.BytesIO(), VIDEO[name]
    with av.open(file, "w", format="matroska") as container:
        options = dict(codec.options(quality)) if codec.options else {}
        stream: Any = container.add_stream(codec.encoder, rate=25, options=options | {"threads": "1"})
        stream.width, stream.height, stream.pix_fmt = width, height, codec.pixels
        stream.codec_context.thread_count = 1
        if codec.options is None:
            stream.codec_context.qmin = stream.codec_context.qmax = quality
        if name == "mjpeg":
            stream.codec_context.color_range = ColorRange.JPEG
        for frame in frames:
            for packet in stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")):
                container.mux(packet)
        for packet in stream.encode():
            container.mux(packet)
    return file.getvalue()


def _even(picture: Picture) -> Picture:
    """The picture without its last row or column where their number is odd (video codecs want even sizes)."""
    return picture[: picture.shape[0] // 2 * 2, : picture.shape[1] // 2 * 2]
