"""Noise that was enlarged with its frame: the bound holds it, and frames with fine detail have none."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from pipeline.condition import ConditionMonitor
from pipeline.condition.coarse_grain import most_coarse_noise_dn
from pipeline.streams import stream


def scene(sigma_dn: float, side: int) -> np.ndarray:
    """(side, side) grey levels: shading with white noise."""
    steps = 60 + 130 * stream(1, "scene").random((6, 6)).astype(np.float32)
    picture = cv2.resize(steps, (side, side), interpolation=cv2.INTER_CUBIC)
    return picture + stream(1, "noise").normal(0, 1, (side, side)).astype(np.float32) * np.float32(sigma_dn)


def enlarged(picture: np.ndarray, times: int) -> np.ndarray:
    wide = cv2.resize(picture, None, fx=times, fy=times, interpolation=cv2.INTER_CUBIC)
    return (np.rint(np.clip(wide, 0, 255)) / 255).astype(np.float32)


def tiles(frame: np.ndarray) -> np.ndarray:
    return np.stack([frame[y : y + 128, x : x + 128] for y in (0, 128, 256) for x in (0, 128, 256)])[:, None]


@pytest.mark.parametrize("times", [3, 4, 6])
@pytest.mark.parametrize("sigma_dn", [3.0, 10.0])
def test_noise_enlarged_with_its_frame_is_within_the_bound(times, sigma_dn):
    side = 384 // times
    frame, clean = (enlarged(scene(sigma, side), times) for sigma in (sigma_dn, 0.0))
    present = 255 * float((frame - clean).std())
    assert present <= most_coarse_noise_dn(tiles(frame)) <= 3 * present
    assert not most_coarse_noise_dn(tiles(clean)) > 3  # NaN where rounding is the finest detail


@pytest.mark.parametrize("sigma_dn", [1.0, 5.0, 25.0])
def test_fine_noise_is_left_to_the_estimators(sigma_dn):
    assert np.isnan(most_coarse_noise_dn(tiles(enlarged(scene(sigma_dn, 384), 1))))


def test_clipped_areas_do_not_count_and_nothing_is_no_bound():
    frame = enlarged(scene(10.0, 96), 4)
    half = frame.copy()
    half[:, ::128] = half[:192] = 1.0  # half of the frame white
    assert most_coarse_noise_dn(tiles(half)[6:]) == pytest.approx(most_coarse_noise_dn(tiles(frame)[6:]), rel=0.3)
    assert np.isnan(most_coarse_noise_dn(np.empty((0, 1, 128, 128), np.float32)))
    assert np.isnan(most_coarse_noise_dn(np.ones((2, 1, 128, 128), np.float32)))


def test_dark_tiles_do_not_take_the_bound_away():
    """A quarter of the tiles black: their variation is unknown, not none."""
    frame = enlarged(scene(10.0, 96), 4)
    dark = np.concatenate([tiles(frame), np.zeros((3, 1, 128, 128), np.float32)])
    assert most_coarse_noise_dn(dark) == most_coarse_noise_dn(tiles(frame)) > 5


def test_the_monitor_does_not_rule_out_coarse_noise():
    frame, clean = (enlarged(scene(sigma, 96), 4) for sigma in (10.0, 0.0))
    present = 255 * float((frame - clean).std())
    state = ConditionMonitor().frame(frame)
    assert state.noise.at_most_dn >= present
    assert np.isnan(state.sigma_dn.value) or state.sigma_dn.high >= present
