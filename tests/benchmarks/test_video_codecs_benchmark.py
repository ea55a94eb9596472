"""The benchmark of noise behind HEVC, VP8, VP9 and AV1: videos come back as coded, of all codecs that hide noise."""

from __future__ import annotations

import json

import numpy as np
import pytest
from data_makers import make_folder, picture

from benchmarks import coded_noise, video_codecs
from pipeline.condition.video_codecs import HIDDEN
from pipeline.datasets import open_dataset


def test_the_codecs_are_those_that_hide_noise():
    assert {codec.name for codec in video_codecs.CODECS} == set(HIDDEN)


COARSEST = {"hevc": 33, "vp8": 30, "vp9": 31, "av1": 35, "h264": 28}
"""Quality up to which a codec leaves noise of 25 DN that is plainly there."""

FINE = [codec for codec in video_codecs.CODECS if codec.quality <= COARSEST[codec.name]]


@pytest.mark.parametrize("codec", FINE, ids=coded_noise.described)
def test_a_codec_keeps_the_scene_and_changes_noise(codec):
    frame = video_codecs.middle(picture("benchmark")[:129, :161])
    assert frame.shape == (128, 160)
    still, coding = video_codecs.shots(frame, codec, 0.0, "test")
    assert np.array_equal(still[0], still[1]) and still.dtype == np.uint8
    assert coding.codec == codec.name and coding.quantiser > 0
    assert np.abs(still[0].astype(float) - frame).mean() < 8
    noisy, _ = video_codecs.shots(frame, codec, 25.0, "test")
    assert 8 < (noisy[0].astype(float) - noisy[1]).std() / 2**0.5 < 25


def test_large_frames_are_cut_to_their_middle():
    frame = np.arange(1202 * 1920, dtype=np.uint32).reshape(1202, 1920).astype(np.uint8)
    assert np.array_equal(video_codecs.middle(frame), frame[301:901, 348:1572])


@pytest.mark.parametrize("still", video_codecs.STILLS, ids=str)
def test_pictures_come_back_from_their_files_with_their_coding(still):
    frame = video_codecs.middle(picture("benchmark")[:129, :161])
    same, coding = video_codecs.shots(frame, still, 0.0, "test")
    assert np.array_equal(same[0], same[1]) and same.shape == (video_codecs.SHOTS, 128, 160)
    assert coding.codec == {"heic": "hevc", "avif": "av1"}[still.name] and coding.quantiser > 0
    assert np.abs(same[0].astype(float) - frame).mean() < 12


def test_stills_from_fine_to_coarse_are_recorded_apart(tmp_path, monkeypatch):
    monkeypatch.setattr(video_codecs, "STILLS", video_codecs.STILLS[:1])
    monkeypatch.setattr(video_codecs, "SIGMAS_DN", (10.0,))
    make_folder(tmp_path / "folder", frames=1)
    monkeypatch.setattr(
        video_codecs.coded_noise, "parse", lambda text: open_dataset("folder", "a", tmp_path / "folder")
    )
    video_codecs.main(["--stills", "--out", str(tmp_path / "record.json")])
    cell = json.loads((tmp_path / "record.json").read_text())["by_codec"]["heic 20"]["10"]
    assert set(cell) == {"unknown", "named", "file"}
