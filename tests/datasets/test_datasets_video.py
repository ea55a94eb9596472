"""Videos: every frame is read or accounted for."""

from __future__ import annotations

import os
import threading
import time
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest
from data_makers import picture

from pipeline.datasets import video
from pipeline.datasets.video import BadVideo, read_video

FRAMES = 20


def film(path: Path, code: str) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*code), 10, (320, 240))
    for number in range(FRAMES):
        writer.write(cv2.cvtColor(np.roll(picture("film", 320, 240), 3 * number, axis=1), cv2.COLOR_GRAY2BGR))
    writer.release()
    return path


def read_until_refused(path: Path) -> tuple[list[int], str]:
    numbers = []
    with pytest.raises(BadVideo) as caught:
        for number, image in read_video(path):
            assert image.shape == (240, 320) and image.dtype == np.float32
            numbers.append(number)
    return numbers, str(caught.value)


@pytest.mark.parametrize(
    ("name", "code"),
    [("a.avi", "MJPG"), ("a.mp4", "mp4v"), ("a.mkv", "MJPG"), ("a.ts", "mpg2"), ("a.mts", "mpg2"), ("a.m2ts", "mp4v")],
)
def test_a_whole_video_gives_every_frame_without_remark(tmp_path, capfd, name, code):
    path = film(tmp_path / name, code)
    assert path.suffix in video.SUFFIXES
    capfd.readouterr()  # OpenCV's remark on the code of a transport stream that it writes
    assert [number for number, _ in read_video(path)] == list(range(FRAMES))
    assert [number for number, _ in read_video(path, every=7)] == [0, 7, 14]
    assert capfd.readouterr() == ("", "")


def test_a_text_file_named_as_a_transport_stream_is_refused(tmp_path, capfd):
    path = tmp_path / "a.ts"
    path.write_text("const a: number = 1;\n" * 100)
    with pytest.raises(BadVideo, match="a.ts: not a video that OpenCV can read, or it holds no frame"):
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
        numbers = [number for _ in range(3) for number, _ in read_video(path)]
    finally:
        ended.set()
        other.join()
    assert numbers == list(range(FRAMES)) * 3
    written = capfd.readouterr().err.splitlines()
    assert len(written) > 3 and set(written) == {remark}


@pytest.mark.parametrize("unread", [b"|U\0\0", b"\n\x1cV\x85", b"a.\nb", b"\r\n\r\n"])
def test_bytes_that_opencv_quotes_without_having_read_them_are_no_lines(unread, capfd):
    messages = []
    with video._decoder_messages(messages):
        os.write(
            2, b"Unexpected element. Expected: LIST. Got: " + unread + b".\nCorrupt JPEG data: bad code\na plug-in\n"
        )
    assert messages == ["Unexpected element. Expected: LIST. Got: ?.", "Corrupt JPEG data: bad code"]
    assert capfd.readouterr() == ("", "a plug-in\n")


def test_a_video_cut_short_gives_its_frames_and_then_counts_the_missing(tmp_path, capfd):
    path = film(tmp_path / "a.avi", "MJPG")
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * 0.6)])
    numbers, message = read_until_refused(path)
    assert 8 <= len(numbers) < FRAMES
    assert f"{FRAMES - len(numbers)} of the {FRAMES} frames it declares are missing" in message
    assert capfd.readouterr().err == ""  # the decoder's own lines are part of the message


@pytest.mark.parametrize("name", ["phone.mkv", "screen.webm", "phone.mp4"])
def test_a_whole_video_of_a_rate_that_varies_is_not_called_cut_short(tmp_path, name):
    av = pytest.importorskip("av", reason="PyAV is not installed")
    times_ms = (0, 33, 66, 400, 433, 900, 2000, 2033)
    with av.open(str(tmp_path / name), "w") as container:
        video = container.add_stream("libvpx" if name.endswith("webm") else "libx264", rate=30)
        video.width, video.height, video.pix_fmt = 320, 240, "yuv420p"
        video.codec_context.time_base = Fraction(1, 1000)
        for number, time_ms in enumerate(times_ms):
            shifted = np.roll(picture("film", 320, 240), 3 * number, axis=1)
            frame = av.VideoFrame.from_ndarray(shifted, format="gray").reformat(format="yuv420p")
            frame.pts, frame.time_base = time_ms, Fraction(1, 1000)
            container.mux(video.encode(frame))
        container.mux(video.encode())
    assert [number for number, _ in read_video(tmp_path / name)] == list(range(len(times_ms)))


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
