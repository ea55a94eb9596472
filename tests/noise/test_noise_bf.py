"""B+F: against the authors' rules written out block by block, and OpenCV's filter."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline import noise
from pipeline.noise.base import FLAT, UNCERTAIN
from pipeline.noise.bf import _least_ratio, _smooth_blocks, _taps
from pipeline.streams import stream


def direct(patch: np.ndarray, eight_bit: bool) -> float:
    """The modified Shin 2005 rules, one block after another, on (H, W) in DN."""
    patch = patch.astype(np.uint8 if eight_bit else np.float64)
    height, width = patch.shape
    blocks = [patch[y : y + 8, x : x + 16] for x in range(0, width - 15, 16) for y in range(0, height - 7, 8)]
    deviations = [float(np.std(block)) for block in blocks]
    least = min([100.0, *deviations])
    size = math.ceil(3 * least)
    size += size % 2 == 0
    differences = []
    for block, deviation in zip(blocks, deviations, strict=True):
        if round(least) - math.floor(least) < 1:
            same = abs(math.floor(deviation) - math.floor(least)) < 2
        else:
            same = abs(round(deviation) - round(least)) < 2
        if same:
            smooth = cv2.GaussianBlur(block, (size, size), least, borderType=cv2.BORDER_REFLECT_101)
            differences.append(block.astype(np.float64) - smooth.astype(np.float64))
    return float(np.std(differences))


def patch_dn(sigma_dn: float, key: int) -> np.ndarray:
    """Bars of changing contrast with white noise, 8 bit, (128, 128)."""
    rows, columns = np.mgrid[:128, :128]
    clean = 120 + (rows / 2.0) * np.sign(np.sin(columns / 7.0)) * (columns > 50)
    return np.rint(np.clip(clean + stream(11, "bars", key).normal(0, sigma_dn, clean.shape), 0, 255))


@pytest.mark.parametrize("eight_bit", [True, False])
@pytest.mark.parametrize("sigma_dn", [0.6, 1.2, 2.4, 5.0, 9.7, 16.0, 30.0, 60.0])
def test_equals_the_rules_block_by_block(sigma_dn: float, eight_bit: bool) -> None:
    patch = patch_dn(sigma_dn, 1)
    estimate = noise.create("bf", quantise_like_paper=eight_bit).estimate((patch / 255)[None, None]).sigma_dn[0]
    expected = direct(patch, eight_bit)
    assert estimate == (math.trunc(expected) if eight_bit else pytest.approx(expected, abs=1e-3))


@given(sigma_px=st.floats(0.05, 100.0), key=st.integers(0, 1000))
def test_smoothing_equals_opencv(sigma_px: float, key: int) -> None:
    """To the bit in 8-bit arithmetic, to float32 rounding otherwise, for filters far wider than a block."""
    block = stream(5, "block", key).integers(0, 256, (8, 16)).astype(np.uint8)
    taps = int(_taps(np.array([sigma_px]))[0])
    centred = block[None].astype(np.float32) - 128
    ours = _smooth_blocks(centred, np.array([sigma_px]), eight_bit=True)[0] + 128
    np.testing.assert_array_equal(ours, cv2.GaussianBlur(block, (taps, taps), sigma_px))
    ours = _smooth_blocks(centred, np.array([sigma_px]), eight_bit=False)[0] + 128
    reference = cv2.GaussianBlur(block.astype(np.float64), (taps, taps), sigma_px)
    np.testing.assert_allclose(ours, reference, atol=2e-4)


@given(sigma_px=st.floats(0.0, 100.0))
def test_number_of_taps_is_odd_and_covers_three_sigma(sigma_px: float) -> None:
    taps = int(_taps(np.array([sigma_px]))[0])
    assert taps % 2 == 1
    assert 3 * sigma_px <= taps < 3 * sigma_px + 2


def test_too_little_noise_to_resolve_is_an_interval_not_a_silent_zero() -> None:
    quiet = 0.5 + stream(2, "quiet").normal(0, 0.2 / 255, (1, 1, 128, 128))
    estimate = noise.create("bf").estimate(quiet)
    assert estimate.sigma_dn[0] == 0.0
    assert not estimate.abstained[0]
    assert estimate.low_dn[0] == 0.0
    assert 0.1 < estimate.high_dn[0] < 0.25


def test_one_block_that_does_not_vary_spoils_the_patch() -> None:
    patch = patch_dn(5.0, 2) / 255
    patch[8:16, 16:32] = 0.5
    estimate = noise.create("bf").estimate(patch[None, None])
    assert estimate.reason[0] == FLAT
    assert noise.create("bf", quantise_like_paper=True).estimate(patch[None, None]).sigma_dn[0] == 0.0


def test_blocks_all_above_the_start_value_leave_nothing_to_pool() -> None:
    """A chessboard of black and white: every block deviates by 127.5 DN."""
    board = (np.indices((64, 64)).sum(axis=0) % 2).astype(np.float32)[None, None]
    estimate = noise.create("bf", saturated_fraction=1.0).estimate(np.clip(board, 0.01, 0.99))
    assert estimate.abstained[0]
    assert np.isnan(estimate.sigma_dn[0])


@pytest.mark.parametrize("sigma_dn", [0.05, 0.15, 0.3])
def test_noise_too_weak_for_the_filter_lies_within_the_interval(sigma_dn):
    """The quietest of 128 blocks varies by a sixth less than the noise; so it is no bound by itself."""
    patches = 0.5 + stream(1, "weak", sigma_dn).normal(0, sigma_dn / 255, (400, 1, 128, 128))
    estimate = noise.create("bf").estimate(patches)
    assert (estimate.sigma_dn == 0).all() and (estimate.low_dn == 0).all()
    assert (estimate.high_dn >= sigma_dn).mean() == pytest.approx(0.95, abs=4 * np.sqrt(0.05 * 0.95 / 400))
    assert estimate.high_dn.max() < 1.25 * sigma_dn


def test_far_taps_of_the_filter_are_zero_for_a_program_that_stops_at_underflow():
    patches = 0.5 + stream(1, "taps").normal(0, [[[[0.5 / 255]]], [[[30 / 255]]]], (2, 1, 128, 128)).clip(-0.4, 0.4)
    expected = noise.create("bf").estimate(patches).sigma_dn
    with np.errstate(all="raise"):
        np.testing.assert_array_equal(noise.create("bf").estimate(patches).sigma_dn, expected)


def test_a_patch_without_a_homogeneous_block_is_uncertain_and_not_flat():
    chessboard = 10.0 + 235 * (np.indices((128, 128)).sum(axis=0) % 2)
    estimate = noise.create("bf").estimate(chessboard[None, None] / 255)
    assert estimate.abstained.all() and estimate.reason[0] == UNCERTAIN


def test_the_quietest_block_falls_below_its_bound_in_one_of_twenty():
    """The bound is of deviations about a block's mean, whose squares are divided by the number of its pixels."""
    parts = [stream(1, "quietest", part).standard_normal((200, 64, 128)).std(axis=2).min(axis=1) for part in range(100)]
    least = np.concatenate(parts)
    share = (least < _least_ratio(64)).mean()
    assert share == pytest.approx(0.05, abs=4 * np.sqrt(0.05 * 0.95 / len(least)))
