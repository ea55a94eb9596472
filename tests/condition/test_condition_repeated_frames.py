"""Repeated frames: equal ones count at once, those of a still behind a codec from the tenth on, live ones never."""

from itertools import pairwise

import cv2
import numpy as np
import pytest
from data_makers import picture

from pipeline.condition.frame_flags import FrameInspector
from pipeline.condition.repeated_frames import ALIKE_DN, BLOCK_ALIKE_DN, LEAST_ALIKE, RepeatCounter, alike
from pipeline.streams import stream

STILL = cv2.GaussianBlur(picture("repeated frames", 320, 240).astype(np.float32), (0, 0), 1.0)
FRAMES = 40


def counts(frames, stream_name="v.mp4"):
    counter = RepeatCounter()
    return [counter.count(frame / 255, stream_name) for frame in frames]


def refined(frames, share):
    """A still whose decoder changes the same pixels to and fro by 1 DN, as encoders do that never settle."""
    changed = stream(0, "refined").random(STILL.shape) < share
    return [STILL + (number % 2) * changed for number in range(frames)]


def live(frames, sigma_dn):
    """A still scene with noise of the camera, in whole grey levels."""
    draws = stream(0, "live still", sigma_dn)
    return [np.rint(STILL + draws.normal(0, sigma_dn, STILL.shape)) for _ in range(frames)]


def behind_mpeg4(path, frames):
    """Grey frames as an MPEG-4 decoder delivers them."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"mp4v"), 10, STILL.shape[::-1])
    for frame in frames:
        writer.write(cv2.cvtColor(np.clip(np.rint(frame), 0, 255).astype(np.uint8), cv2.COLOR_GRAY2BGR))
    writer.release()
    video = cv2.VideoCapture(str(path))
    decoded = []
    while (answer := video.read())[0]:
        decoded.append(cv2.cvtColor(answer[1], cv2.COLOR_BGR2GRAY).astype(np.float32))
    return decoded


def test_equal_frames_count_at_once_and_others_end_the_run():
    assert counts([STILL] * 4 + [STILL + 1] * 3) == [0, 1, 2, 3, 0, 1, 2]
    assert counts([STILL] * 4, stream_name="") == [0] * 4
    counter = RepeatCounter()
    assert [counter.count(STILL / 255, name) for name in ("a", "a", "b", "b")] == [0, 1, 0, 1]
    assert counts([STILL, STILL, STILL[:100], STILL[:100]]) == [0, 1, 0, 1]


def flagged(frames):
    inspector = FrameInspector()
    return ["frozen" in inspector.inspect((frame / 255).astype(np.float32), "v.mp4").names for frame in frames]


@pytest.mark.parametrize("times", [4, 5, 8])
def test_a_stream_stored_at_a_higher_rate_is_frozen_only_where_it_stands_longer_than_usual(times):
    padded = [frame for frame in live(6, 4.0) for _ in range(times)]
    assert not any(flagged(padded)[2 * times :])
    stands = flagged(padded + [padded[-1]] * 3 * times)
    assert not any(stands[2 * times : 7 * times]) and all(stands[7 * times :])
    assert not any(flagged(padded + live(3, 4.0) + padded)[2 * times : 6 * times + 3])


def test_runs_that_key_frames_end_are_not_the_streams_own():
    """A frozen stream: every 12th frame is coded anew, and changes the picture by a little."""
    frames = [STILL + 1.4 * (number % 2) for number in range(8) for _ in range(12)]
    assert all(flag for index, flag in enumerate(flagged(frames)) if index % 12 >= 3)


def test_a_reused_array_is_not_taken_for_a_repeat():
    counter, frame = RepeatCounter(), np.empty_like(STILL)
    answers = []
    for image in live(5, 2.0):
        frame[:] = image / 255
        answers.append(counter.count(frame, "v.mp4"))
    assert answers == [0] * 5


def test_a_still_that_a_codec_keeps_refining_counts_from_the_tenth_repeat_on():
    expected = [number if number >= LEAST_ALIKE else 0 for number in range(FRAMES)]
    assert counts(refined(FRAMES, 0.8 * ALIKE_DN)) == expected
    assert counts(refined(FRAMES, 1.2 * ALIKE_DN)) == [0] * FRAMES


def test_changes_that_add_up_are_not_taken_for_refinement():
    """Neighbours are alike, but the scene drifts away from the first frame of the run."""
    changed = stream(0, "drift").random(STILL.shape)
    step = 0.3 * ALIKE_DN
    frames = [STILL + (changed < step * number) for number in range(FRAMES)]
    assert all(alike(np.float32(before / 255), np.float32(after / 255)) for before, after in pairwise(frames))
    assert counts(frames) == [0] * FRAMES


def test_a_small_object_that_moves_is_not_averaged_away():
    frames = []
    for number in range(FRAMES):
        frame = STILL.copy()
        frame[100:104, 4 * number : 4 * number + 4] = frame[100:104, 4 * number : 4 * number + 4].mean() + 40
        frames.append(frame)
    assert max(np.abs(after - before).mean() for before, after in pairwise(frames)) < ALIKE_DN
    assert counts(frames) == [0] * FRAMES
    faint = STILL.copy()
    faint[96:104, 96:104] += 1.1 * BLOCK_ALIKE_DN * 4  # a quarter of a block
    assert np.abs(faint - STILL).mean() < ALIKE_DN
    assert not alike(np.float32(faint / 255), np.float32(STILL / 255))


@pytest.mark.parametrize("sigma_dn", [0.3, 0.5, 1.0, 3.0])
def test_a_live_camera_before_a_still_scene_is_not_frozen_for_its_noise(sigma_dn):
    assert counts(live(FRAMES, sigma_dn)) == [0] * FRAMES


def test_behind_mpeg4_a_frozen_stream_counts_and_a_live_still_scene_does_not(tmp_path):
    pan = [np.roll(STILL, 4 * number, axis=1) for number in range(5)]
    frozen = counts(behind_mpeg4(tmp_path / "frozen.mp4", [*pan, *[STILL] * FRAMES]))
    assert frozen[: len(pan)] == [0] * len(pan) and min(frozen[-15:]) >= LEAST_ALIKE
    assert max(counts(behind_mpeg4(tmp_path / "live.mp4", live(FRAMES, 1.0)))) == 0
