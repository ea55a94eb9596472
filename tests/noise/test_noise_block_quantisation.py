"""Quantised transform blocks: seen behind real codecs on any grid, never where nothing was coded."""

import numpy as np
import pytest
from skimage import data

from pipeline.camera.processing.codec import Codec, store
from pipeline.noise.block_quantisation import at_corner, block_quantisation, present, suspected
from pipeline.streams import stream


def picture(sigma_dn=0.0, number=0):
    grey = data.camera()[64:320, 64:320].astype(np.float64)
    noise = stream(1, "block quantisation", number, sigma_dn).normal(0, 1, grey.shape)
    return np.clip(np.rint(grey + sigma_dn * noise), 0, 255).astype(np.uint8)


def coded(name, quality, sigma_dn):
    frames = [np.repeat(picture(sigma_dn, number)[..., None], 3, axis=2) for number in range(3)]
    return store(frames[-1], Codec(name, quality), frames[:-1]).mean(axis=2).round().astype(np.float32)


@pytest.mark.parametrize("sigma_dn", [0, 1, 2, 5, 10, 25])
def test_nothing_is_seen_where_nothing_was_coded(sigma_dn):
    frame = picture(sigma_dn).astype(np.float32)
    tiles = [frame[y : y + 128, x : x + 128] for y in (0, 128) for x in (0, 128)]
    traces = [block_quantisation(tile) for tile in tiles]
    assert not any(trace.present for trace in traces)
    assert max(abs(trace.excess_8) for trace in traces) < 0.35


@pytest.mark.parametrize(
    ("name", "quality"), [("jpeg", 60), ("jpeg", 80), ("jpeg", 95), ("mjpeg", 4), ("mpeg4", 4), ("h264", 23)]
)
@pytest.mark.parametrize("sigma_dn", [2, 5])
def test_codecs_leave_their_grid(name, quality, sigma_dn):
    frame = coded(name, quality, sigma_dn)
    traces = [block_quantisation(frame[y : y + 128, x : x + 128]) for y in (0, 128) for x in (0, 128)]
    assert sum(trace.present for trace in traces) >= (2 if name == "h264" else 3)  # which deblocks


@pytest.mark.parametrize("corner", [(0, 0), (3, 5), (6, 1)])
def test_the_grid_may_begin_anywhere(corner):
    frame = coded("jpeg", 80, 2)
    trace = block_quantisation(frame[corner[0] : corner[0] + 160, corner[1] : corner[1] + 160])
    assert trace.present and trace.excess_8 > 0.4 and trace.vanished_8 > 0.4


def test_flat_patches_have_no_grid():
    trace = block_quantisation(np.full((64, 64), 90, np.float32))
    assert not trace.present and abs(trace.excess_4) < 0.001 and abs(trace.excess_8) < 0.001


def test_the_quick_look_sees_a_grid_that_begins_at_the_corner_only():
    frame, plain = coded("jpeg", 80, 10), picture(10).astype(np.float32)
    assert at_corner(frame[128:, 128:]) and not at_corner(plain[128:, 128:])
    assert not at_corner(frame[131:, 129:])  # the search does
    assert block_quantisation(frame[131:, 129:]).present


def test_traces_are_judged_from_their_numbers():
    traces = [block_quantisation(frame[:128, :128]) for frame in (coded("jpeg", 80, 5), picture(5).astype(np.float32))]
    assert present(np.array([trace.numbers for trace in traces]), 128 * 128).tolist() == [True, False]


def test_weak_traces_raise_a_suspicion_that_chance_seldom_raises():
    pixels = 128 * 128
    vanished = 0.6
    deviation = np.sqrt(2 * (1 - vanished) / (vanished * 1000))
    numbers = deviation * np.array([[2.2, 2.2], [2.2, 1.0], [0.5, 3.0], [3.0, 3.0]])
    numbers = np.column_stack([numbers, np.full((4, 2), vanished)])
    assert suspected(numbers, pixels).tolist() == [True, False, False, True]
    assert not present(numbers, pixels)[:2].any()
    assert not suspected(numbers, pixels // 4)[:2].any()  # of fewer blocks chance makes more
    plain = picture(2).astype(np.float32)
    tiles = [plain[y : y + 128, x : x + 128] for y in (0, 64, 128) for x in (0, 64, 128)]
    assert suspected(np.array([block_quantisation(tile).numbers for tile in tiles]), pixels).mean() < 0.2
