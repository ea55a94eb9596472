"""The benchmark of noise behind HEVC, VP9 and AV1: videos come back as coded, and naming the codec is what differs."""

from __future__ import annotations

import numpy as np
import pytest
from data_makers import picture

from benchmarks import video_codecs
from pipeline.condition.video_codecs import HIDING


def test_the_codecs_are_those_that_hide_noise():
    assert {codec.name for codec in video_codecs.CODECS} == HIDING


@pytest.mark.parametrize("codec", video_codecs.CODECS, ids=lambda codec: f"{codec.name} {codec.factor}")
def test_a_codec_keeps_the_scene_and_changes_noise(codec):
    frame = video_codecs.middle(picture("benchmark")[:129, :161])
    assert frame.shape == (128, 160)
    still = video_codecs.shots(frame, codec, 0.0, "test")
    assert np.array_equal(still[0], still[1]) and still.dtype == np.uint8
    assert np.abs(still[0].astype(float) - frame).mean() < 8
    noisy = video_codecs.shots(frame, codec, 25.0, "test")
    assert 8 < (noisy[0].astype(float) - noisy[1]).std() / 2**0.5 < 25


def test_large_frames_are_cut_to_their_middle():
    frame = np.arange(1202 * 1920, dtype=np.uint32).reshape(1202, 1920).astype(np.uint8)
    assert np.array_equal(video_codecs.middle(frame), frame[301:901, 348:1572])
