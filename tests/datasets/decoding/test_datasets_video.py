"""Videos: every frame is read or accounted for."""

from __future__ import annotations

import os
import threading
import time
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from av.video.reformatter import ColorRange
from data_makers import picture
from PIL import Image

from pipeline.camera.processing.codec import X264
from pipeline.datasets.decoding import video
from pipeline.datasets.decoding.video import BadVideo, read_video
from pipeline.datasets.decoding.video_decoder import CURVE, TURNED, grey_frame, grey_levels

FRAMES = 20


def film(path: Path, code: str) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*code), 10, (320, 240))
    for number in range(FRAMES):
        writer.write(cv2.cvtColor(np.roll(picture("film", 320, 240), 3 * number, axis=1), cv2.COLOR_GRAY2BGR))
    writer.release()
    return path


def coded(path: Path, codec: str, pixels: str = "yuv420p", frames: int = 6, rate: int = 10, **options: str) -> Path:
    """The same panning scene as `film`, by FFmpeg's own encoders."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=rate, options=options)
        stream.width, stream.height, stream.pix_fmt = 320, 240, pixels
        stream.thread_count = 1  # more share a picture among them: other bytes by the number of cores
        for number in range(frames):
            shifted = np.roll(picture("film", 320, 240), 3 * number, axis=1)
            frame = av.VideoFrame.from_ndarray(shifted, format="gray").reformat(format=pixels)
            if codec == "libx265":
                frame.color_trc = stream.codec_context.color_trc = 16  # PQ
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def read_until_refused(path: Path) -> tuple[list[int], str]:
    numbers = []
    with pytest.raises(BadVideo) as caught:
        for number, image, _ in read_video(path):
            assert image.shape == (240, 320) and image.dtype == np.float32
            numbers.append(number)
    return numbers, str(caught.value)


@pytest.mark.parametrize("pixels", ["gray", "gray10le", "yuv420p"])
@pytest.mark.parametrize("limited", [False, True])
def test_grey_levels_of_limited_range_are_expanded_of_grey_pixels_too(pixels: str, limited: bool) -> None:
    """Black is 16 and white 235 there, and noise smaller by as much."""
    levels = np.arange(256, dtype=np.float64)[None].repeat(16, axis=0)
    depth = 4 if "10" in pixels else 1
    stored = np.rint(depth * (16 + levels * 219 / 255 if limited else levels)).astype(
        np.uint16 if depth > 1 else np.uint8
    )
    frame = av.VideoFrame(256, 16, pixels)
    planes = [stored, *[np.full((8, 128), 128, np.uint8)] * 2]
    for plane, values in zip(frame.planes, planes, strict=False):
        lines = np.zeros((plane.height, plane.line_size), np.uint8)
        lines[:, : values.shape[1] * values.itemsize] = values.view(np.uint8)
        plane.update(lines.tobytes())
    frame.color_range = ColorRange.MPEG if limited else ColorRange.JPEG
    assert np.abs(grey_levels(frame) * 255 - levels).max() <= 1.1
    assert grey_levels(frame).max() == 1 and grey_levels(frame).min() == 0


@pytest.mark.parametrize(
    ("name", "code"),
    [("a.avi", "MJPG"), ("a.mp4", "mp4v"), ("a.mkv", "MJPG"), ("a.ts", "mpg2"), ("a.mts", "mpg2"), ("a.m2ts", "mp4v")],
)
def test_a_whole_video_gives_every_frame_without_remark(tmp_path, capfd, name, code):
    path = film(tmp_path / name, code)
    assert path.suffix in video.SUFFIXES
    capfd.readouterr()  # OpenCV's remark on the code of a transport stream that it writes
    assert [number for number, *_ in read_video(path)] == list(range(FRAMES))
    assert [number for number, *_ in read_video(path, every=7)] == [0, 7, 14]
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("name", "codec"),
    [("a.wmv", "wmv2"), ("a.asf", "msmpeg4"), ("a.flv", "libx264"), ("a.flv", "flv"), ("a.3gp", "libx264"),
     ("a.mpg", "mpeg2video"), ("a.mpeg", "mpeg1video"), ("a.vob", "mpeg2video")],
)  # fmt: skip
def test_other_containers_are_read_whole_and_missed_when_cut(tmp_path, name, codec):
    path = coded(tmp_path / name, codec, frames=50, **({} if codec == "libx264" else {"g": "12"}), rate=25)
    assert path.suffix in video.SUFFIXES
    assert [number for number, *_ in read_video(path)] == list(range(50))
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * 0.6)])
    numbers, message = read_until_refused(path)
    assert len(numbers) < 40 and name in message


def test_a_text_file_named_as_a_transport_stream_is_refused(tmp_path, capfd):
    path = tmp_path / "a.ts"
    path.write_text("const a: number = 1;\n" * 100)
    with pytest.raises(BadVideo, match="a.ts: not a video that FFmpeg can read"):
        list(read_video(path))
    assert capfd.readouterr().out == ""


def test_what_others_write_meanwhile_is_no_damage_and_is_not_lost(tmp_path, capfd):
    path, remark = film(tmp_path / "a.avi", "MJPG"), "a plug-in: 12 patches skipped"
    ended = threading.Event()

    def chatter():
        while not ended.is_set():
            os.write(2, f"{remark}\n".encode())
            time.sleep(0.001)

    other = threading.Thread(target=chatter)
    other.start()
    try:
        numbers = [number for _ in range(3) for number, *_ in read_video(path)]
    finally:
        ended.set()
        other.join()
    assert numbers == list(range(FRAMES)) * 3
    written = capfd.readouterr().err.splitlines()
    assert len(written) > 3 and set(written) == {remark}


def test_a_video_cut_short_gives_its_frames_and_then_counts_the_missing(tmp_path, capfd):
    path = film(tmp_path / "a.avi", "MJPG")
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * 0.6)])
    numbers, message = read_until_refused(path)
    assert 8 <= len(numbers) < FRAMES
    read = len(numbers) + 1  # the last is torn, and not measured
    assert f"{FRAMES - read} of the {FRAMES} frames it declares are missing; {read} were read" in message
    assert "frames without a picture: 1, cut off" in message
    assert capfd.readouterr().err == ""  # the decoder's own lines are part of the message


@pytest.mark.parametrize("name", ["phone.mkv", "screen.webm", "phone.mp4"])
def test_a_whole_video_of_a_rate_that_varies_is_not_called_cut_short(tmp_path, name):
    times_ms = (0, 33, 66, 400, 433, 900, 2000, 2033)
    with av.open(str(tmp_path / name), "w") as container:
        video = container.add_stream("libvpx" if name.endswith("webm") else "libx264", rate=30)
        video.width, video.height, video.pix_fmt = 320, 240, "yuv420p"
        video.codec_context.time_base, video.thread_count = Fraction(1, 1000), 1
        for number, time_ms in enumerate(times_ms):
            shifted = np.roll(picture("film", 320, 240), 3 * number, axis=1)
            frame = av.VideoFrame.from_ndarray(shifted, format="gray").reformat(format="yuv420p")
            frame.pts, frame.time_base = time_ms, Fraction(1, 1000)
            container.mux(video.encode(frame))
        container.mux(video.encode())
    assert [number for number, *_ in read_video(tmp_path / name)] == list(range(len(times_ms)))


def with_sound(path: Path, codec: str, sound: str, sound_s: float, options: dict[str, str] | None = None) -> Path:
    """3 seconds of the panning scene at 30 frames a second, with silence of some length."""
    with av.open(str(path), "w", options=options or {}) as container:
        stream, silence = container.add_stream(codec, rate=30), container.add_stream(sound, rate=48000)
        stream.width, stream.height, stream.pix_fmt = 320, 240, "yuv420p"
        stream.thread_count = 1  # threads that wait for each other take 50 s on a busy machine
        packets = []
        for number in range(90):
            shifted = np.roll(picture("film", 320, 240), 3 * number, axis=1)
            packets += stream.encode(av.VideoFrame.from_ndarray(shifted, format="gray"))
        packets += stream.encode()
        width = 1 if silence.format.is_packed else 2
        values = np.zeros((width, 960 * 2 // width), np.int16 if silence.format.name.startswith("s16") else np.float32)
        for begin in range(0, round(sound_s * 48000), 960):
            part = av.AudioFrame.from_ndarray(values, format=silence.format.name, layout="stereo")
            part.sample_rate, part.pts = 48000, begin
            packets += silence.encode(part)
        packets += silence.encode()
        for packet in sorted(packets, key=lambda each: each.dts * each.time_base):
            container.mux(packet)
    return path


@pytest.mark.parametrize(
    "sound_s", [3.3, *(pytest.param(length_s, marks=pytest.mark.full("7 more take 7 s")) for length_s in (3.0, 4.0))]
)
@pytest.mark.parametrize(
    ("name", "codec", "sound", "options"),
    [("a.mkv", "libx264", "aac", {}), ("a.webm", "libvpx", "libopus", {}), ("a.ts", "libx264", "aac", {}),
     ("a.flv", "libx264", "aac", {}), ("a.mpg", "mpeg2video", "mp2", {}), ("a.mov", "libx264", "aac", {}),
     ("a.mp4", "libx264", "aac", {"movflags": "frag_keyframe+empty_moov"})],
)  # fmt: skip
def test_a_whole_video_with_sound_is_not_called_cut_short(tmp_path, name, codec, sound, options, sound_s):
    path = with_sound(tmp_path / name, codec, sound, sound_s, options)
    assert [number for number, *_ in read_video(path)] == list(range(90))


def test_a_cut_video_with_sound_is_missed(tmp_path):
    path = with_sound(tmp_path / "a.mkv", "libx264", "aac", 4.0)
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * 0.6)])
    numbers, message = read_until_refused(path)
    assert len(numbers) < 80 and "frames it declares are missing" in message


@pytest.mark.parametrize("name", ["trimmed.mp4", "trimmed.mov"])
def test_frames_that_an_edit_list_hides_are_not_missed(tmp_path, name):
    """As telephones trim: packets from the key frame before are there, those before the beginning are not shown."""
    whole = coded(tmp_path / "whole.mp4", "libx264", frames=60, rate=25, g="25", bf="0")
    with av.open(str(whole)) as source, av.open(str(tmp_path / name), "w") as trimmed:
        stream = source.streams.video[0]
        copy, shift = trimmed.add_stream_from_template(stream), round(Fraction(18, 25) / stream.time_base)
        for packet in source.demux(stream):
            if packet.dts is not None:
                packet.pts, packet.dts, packet.stream = packet.pts - shift, packet.dts - shift, copy
                trimmed.mux(packet)
    shown = [image for _, image, _ in read_video(tmp_path / name)]
    assert np.array_equal(shown, [image for _, image, _ in read_video(whole)][18:])
    content = bytearray((tmp_path / name).read_bytes())
    duration = content.index(b"elst") + 12  # of the first entry, in thousandths of a second
    content[duration : duration + 4] = (800).to_bytes(4)
    (tmp_path / name).write_bytes(content)
    assert len(list(read_video(tmp_path / name))) in (20, 21)  # 0.8 s at 25 frames a second


def test_the_last_frames_of_a_cut_film_without_a_number_of_frames_are_missed(tmp_path):
    path = film(tmp_path / "a.mkv", "MJPG")
    content = path.read_bytes()
    path.write_bytes(content[: content.rindex(b"\xff\xd8\xff")])  # before its last picture
    numbers, message = read_until_refused(path)
    assert numbers == list(range(FRAMES - 1)) and f"1 of the {FRAMES} frames it declares are missing" in message


def test_damage_inside_a_video_is_reported_with_its_frame(tmp_path):
    path = film(tmp_path / "a.mp4", "mp4v")
    content = bytearray(path.read_bytes())
    begin = content.index(b"mdat") + (len(content) - content.index(b"mdat")) // 3
    for index in range(begin, begin + 3000):
        content[index] = (content[index] * 7 + 13) % 256
    path.write_bytes(content)
    for _ in range(10):  # FFmpeg's own threads report when they like, so that some readings would miss it
        numbers, message = read_until_refused(path)
        assert len(numbers) > 0
        assert "the decoder reports damage near frame" in message and str(path) in message


@pytest.mark.parametrize("content", [b"", b"no video at all", b"RIFF" + bytes(100)])
def test_a_file_without_a_frame_is_refused(tmp_path, content):
    (tmp_path / "a.avi").write_bytes(content)
    numbers, message = read_until_refused(tmp_path / "a.avi")
    assert numbers == [] and "not a video" in message


INTERLACED = {"flags": "+ilme+ildct"}


@pytest.mark.parametrize(
    ("name", "codec", "options"),
    [
        ("a.ts", "mpeg2video", INTERLACED),
        ("a.avi", "mpeg2video", INTERLACED),
        ("a.ts", "libx264", {**INTERLACED, "x264-params": "tff=1"}),
        ("a.mkv", "libx264", {**INTERLACED, "x264-params": "tff=1"}),
    ],
)
def test_interlaced_frames_are_never_measured(tmp_path, capfd, name, codec, options):
    """OpenCV 5 fails to convert them and returns a buffer that was never written, as a frame."""
    numbers, message = read_until_refused(coded(tmp_path / name, codec, **options))
    assert numbers == [] and "6 of 6 frames are interlaced" in message and "ffmpeg -vf yadif" in message
    assert "damaged" not in message and "missing" not in message
    assert capfd.readouterr() == ("", "")


def test_progressive_frames_among_interlaced_ones_are_read(tmp_path):
    parts = [coded(tmp_path / "p.ts", "mpeg2video"), coded(tmp_path / "i.ts", "mpeg2video", **INTERLACED)]
    path = tmp_path / "a.ts"
    path.write_bytes(b"".join(part.read_bytes() for part in parts))
    numbers, message = read_until_refused(path)
    assert numbers in (list(range(5)), list(range(6)))  # where the parts meet the decoder may lose one
    assert "6 of 1" in message and "frames are interlaced" in message


@pytest.mark.parametrize(
    ("codec", "pixels", "name"),
    [
        ("libx264", "yuv420p", "a.mp4"),
        ("libx264", "yuvj420p", "a.mp4"),
        ("libx264", "yuv444p", "a.mkv"),
        ("mjpeg", "yuvj422p", "a.avi"),
        ("ffv1", "gray", "a.mkv"),
        ("ffv1", "gray16le", "a.mkv"),
        ("prores_ks", "yuv422p10le", "a.mov"),
        ("libx264", "yuv420p10le", "a.mp4"),
    ],
)
def test_progressive_frames_are_those_of_opencv(tmp_path, codec, pixels, name):
    path = coded(tmp_path / name, codec, pixels)
    reader, images = cv2.VideoCapture(str(path)), [image for _, image, _ in read_video(path)]
    assert len(images) == 6
    largest = (4 if "10" in pixels else 2) / 255  # those of 10 bits are darker there
    for image in images:
        good, frame = reader.read()
        assert good and np.abs(image - grey_frame(frame)).max() <= largest  # equal where both have the same FFmpeg
    assert np.abs(images[0] * 255 - picture("film", 320, 240)).std() < 4


@pytest.mark.parametrize("full", [False, True])
@pytest.mark.parametrize("pixels", ["yuv420p", "yuv420p10le", "yuv422p10le", "yuv444p10le", "yuv420p12le", "p010le"])
def test_black_grey_and_white_are_the_same_whatever_the_bits(pixels, full):
    """FFmpeg converts 4:2:0 of 10 bits to 8 bits 1 DN too dark, so that white would not count as saturated."""
    frame = av.VideoFrame(64, 48, pixels)
    extra = frame.format.components[0].bits - 8
    shift = 16 - extra - 8 if pixels == "p010le" else 0  # its values lie at the top of 16 bits
    frame.color_range = 2 if full else 1
    for code, level in ((0, 0), (128, 128), (255, 255)) if full else ((16, 0), (126, 128), (235, 255)):
        for index, plane in enumerate(frame.planes):
            white = full and code == 255
            value = ((code + white << extra) - white if index == 0 else 128 << extra) << shift
            kind = np.uint16 if extra else np.uint8
            plane.update(np.full(plane.buffer_size // np.dtype(kind).itemsize, value, kind).tobytes())
        assert np.all(np.abs(grey_levels(frame) * 255 - level) < (0.01 if level != 128 else 0.6)), (pixels, code)


def test_frames_whose_pixel_format_or_size_changes_are_converted_anew(tmp_path):
    """As of trail cameras that write a first frame of 4:2:2 and then 4:2:0."""
    scene = np.dstack([picture("film", 320, 240)] * 3)
    path, shapes = tmp_path / "a.mjpg", [(240, 320), (240, 320), (112, 160), (240, 320)]
    for number, (height, width) in enumerate(shapes):
        part = tmp_path / f"{number}.jpg"
        Image.fromarray(scene[:height, :width].copy()).save(part, quality=95, subsampling=1 + number % 2)
        path.open("ab").write(part.read_bytes())
    images = [image for _, image, _ in read_video(path)]
    assert [image.shape for image in images] == shapes
    for image in images:
        height, width = image.shape
        assert np.abs(image * 255 - scene[:height, :width, 0]).max() < 20


def turned(path: Path) -> Path:
    """A video whose header asks for a quarter turn."""
    content = bytearray(path.read_bytes())
    begin = content.index(b"tkhd") + 44  # the matrix, in a header of version 0
    content[begin : begin + 36] = b"".join(
        value.to_bytes(4, signed=True) for value in (0, 65536, 0, -65536, 0, 0, 240 << 16, 0, 1 << 30)
    )
    path.write_bytes(content)
    return path


def test_a_turned_video_is_read_as_stored_and_pointed_out_once(tmp_path):
    path, remarks = coded(tmp_path / "a.mp4", "libx264"), []
    plain = [image for _, image, _ in read_video(path, remark=lambda *remark: remarks.append(remark))]
    assert remarks == []
    stored = [image for _, image, _ in read_video(turned(path), remark=lambda *remark: remarks.append(remark))]
    assert np.array_equal(stored, plain) and [kind for kind, _ in remarks] == [TURNED]
    assert "270 degrees" in remarks[0][1]


def test_a_video_of_another_transfer_curve_keeps_its_code_values_and_is_pointed_out(tmp_path):
    """OpenCV 5 converts them, by another curve than that of sRGB."""
    options = {"crf": "4", "x265-params": "log-level=none:transfer=smpte2084"}
    path, remarks = coded(tmp_path / "a.mp4", "libx265", "yuv420p10le", **options), []
    images = [image for _, image, _ in read_video(path, remark=lambda *remark: remarks.append(remark))]
    assert remarks == [(CURVE, "PQ (SMPTE ST 2084)")]
    assert abs(float(images[0].mean()) * 255 - picture("film", 320, 240).mean()) < 2


@pytest.mark.skipif("libsvtav1" not in av.codec.codecs_available, reason="AV1: this PyAV has no encoder of it")
def test_av1_is_read(tmp_path):
    path = coded(tmp_path / "a.mkv", "libsvtav1", crf="10", preset="12")
    assert [number for number, *_ in read_video(path)] == list(range(6))


def test_frames_that_the_decoder_marks_as_damaged_are_not_measured(tmp_path):
    path = coded(tmp_path / "a.mp4", "libx264", frames=12, g="12", crf="10", **X264)
    content = bytearray(path.read_bytes())
    middle = content.index(b"mdat") + (len(content) - content.index(b"mdat")) // 2
    content[middle : middle + 3000] = bytes(3000)
    path.write_bytes(content)
    numbers, message = read_until_refused(path)
    assert 0 < len(numbers) < 12 and "marked as damaged" in message and "the decoder reports damage" in message


def test_damage_is_reported_of_every_file_that_has_the_same(tmp_path):
    """The log of FFmpeg passes over a message that repeats the last one."""
    path = film(tmp_path / "a.mkv", "MJPG")
    content = bytearray(path.read_bytes())
    begin = content.index(b"\xff\xda", len(content) // 2) + 200
    content[begin : begin + 300] = bytes(300)
    path.write_bytes(content)
    messages = [read_until_refused(path)[1] for _ in range(3)]
    assert len(set(messages)) == 1 and "the decoder reports damage" in messages[0]


def test_a_name_with_a_colon_is_a_file(tmp_path, monkeypatch):
    film(tmp_path / "http:a.avi", "MJPG")
    monkeypatch.chdir(tmp_path)
    assert len(list(read_video(Path("http:a.avi")))) == FRAMES
