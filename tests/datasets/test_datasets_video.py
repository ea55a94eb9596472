"""Videos: every frame is read or accounted for."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from data_makers import picture

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


@pytest.mark.parametrize(("name", "code"), [("a.avi", "MJPG"), ("a.mp4", "mp4v"), ("a.mkv", "MJPG")])
def test_a_whole_video_gives_every_frame_without_remark(tmp_path, capfd, name, code):
    path = film(tmp_path / name, code)
    assert [number for number, _ in read_video(path)] == list(range(FRAMES))
    assert [number for number, _ in read_video(path, every=7)] == [0, 7, 14]
    assert capfd.readouterr() == ("", "")


def test_a_video_cut_short_gives_its_frames_and_then_counts_the_missing(tmp_path, capfd):
    path = film(tmp_path / "a.avi", "MJPG")
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * 0.6)])
    numbers, message = read_until_refused(path)
    assert 8 <= len(numbers) < FRAMES
    assert f"{FRAMES - len(numbers)} of the {FRAMES} frames it declares are missing" in message
    assert capfd.readouterr().err == ""  # the decoder's own lines are part of the message


def test_damage_inside_a_video_is_reported_with_its_frame(tmp_path):
    path = film(tmp_path / "a.mp4", "mp4v")
    content = bytearray(path.read_bytes())
    begin = content.index(b"mdat") + (len(content) - content.index(b"mdat")) // 3
    for index in range(begin, begin + 3000):
        content[index] = (content[index] * 7 + 13) % 256
    path.write_bytes(content)
    numbers, message = read_until_refused(path)
    assert len(numbers) > 0
    assert "the decoder reports damage near frame" in message and str(path) in message


@pytest.mark.parametrize("content", [b"", b"no video at all", b"RIFF" + bytes(100)])
def test_a_file_without_a_frame_is_refused(tmp_path, content):
    (tmp_path / "a.avi").write_bytes(content)
    numbers, message = read_until_refused(tmp_path / "a.avi")
    assert numbers == [] and "not a video" in message
