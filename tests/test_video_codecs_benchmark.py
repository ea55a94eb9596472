"""The benchmark of noise behind HEVC, VP8, VP9 and AV1: all codecs that hide noise, and large frames cut."""

from __future__ import annotations

import numpy as np

from benchmarks import video_codecs
from pipeline.condition.video_codecs import HIDDEN_DN


def test_the_codecs_are_those_that_hide_noise():
    assert {codec.name for codec in video_codecs.CODECS} == set(HIDDEN_DN)


def test_large_frames_are_cut_to_their_middle():
    frame = np.arange(1202 * 1920, dtype=np.uint32).reshape(1202, 1920).astype(np.uint8)
    assert np.array_equal(video_codecs.middle(frame), frame[301:901, 348:1572])
