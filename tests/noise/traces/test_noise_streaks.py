"""Streaks of equal pixels: seen behind median filters, not in noise, smoothed, coded or clipped."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from skimage import data

from pipeline import noise
from pipeline.camera.processing.codec import jpeg
from pipeline.condition import ConditionMonitor
from pipeline.noise.base import STREAKED
from pipeline.noise.networks.correlated_features import fine_windows
from pipeline.noise.traces.streaks import streaked
from pipeline.streams import stream


def frame(sigma_dn: float) -> np.ndarray:
    """A photograph, its brightness halved, with white noise: (512, 512) uint8."""
    grain = sigma_dn * stream(1, "streaks", sigma_dn).standard_normal((512, 512))
    return np.clip(np.rint(60 + data.camera() / 2.0 + grain), 0, 255).astype(np.uint8)


def share(image: np.ndarray) -> float:
    """Of the squares of 128 px, how many show streaks."""
    squares = [image[y : y + 128, x : x + 128] for y in range(0, 512, 128) for x in range(0, 512, 128)]
    return float(np.mean([streaked(fine_windows(square)) for square in squares]))


@pytest.mark.parametrize("sigma_dn", [5.0, 10.0, 20.0])
def test_a_median_filter_leaves_streaks_in_noise(sigma_dn):
    assert share(cv2.medianBlur(frame(sigma_dn), 3)) > 0.8


@pytest.mark.parametrize(("sigma_dn", "most"), [(0.0, 0.15), (1.3, 0.0), (2.0, 0.0), (5.0, 0.0), (20.0, 0.0)])
def test_noise_leaves_none_white_or_smoothed(sigma_dn, most):
    """Without any, a few patches of texture in few grey levels do."""
    noisy = frame(sigma_dn)
    assert share(noisy) <= most
    assert share(cv2.GaussianBlur(noisy, (0, 0), 0.8)) <= most
    assert share(cv2.bilateralFilter(noisy, 5, 25, 2)) <= most


def test_clipped_noise_has_none():
    """Most pixels of a dark picture are 0 and equal, but not by a filter."""
    grain = 20 * stream(1, "streaks in the dark").standard_normal((512, 512))
    assert share(np.clip(np.rint(grain), 0, 255).astype(np.uint8)) == 0


@pytest.mark.parametrize("quality", [60, 80, 95])
def test_coded_noise_has_none(quality):
    whole = np.repeat(frame(5.0)[..., None], 3, axis=2)
    assert share(jpeg(whole, quality)[..., 0]) < 0.1


@pytest.mark.parametrize("factor", [1.5, 2.0, 4.0])
def test_stretched_contrast_has_none(factor):
    """Gaps between grey levels are no streaks."""
    stretched = np.clip(np.rint(factor * (frame(5.0).astype(float) - 60)), 0, 255).astype(np.uint8)
    assert share(stretched) == 0
    assert share(frame(10.0) // 8 * 8) == 0


@pytest.mark.parametrize("side_px", [48, 64])
def test_small_patches_are_judged_too(side_px):
    shown = cv2.medianBlur(frame(10.0), 3)[:, : 512 // side_px * side_px]
    squares = [shown[y : y + side_px, x : x + side_px] for y in (0, 100, 200) for x in range(0, 384, side_px)]
    assert np.mean([streaked(fine_windows(square)) for square in squares]) > 0.7


def test_a_patch_that_is_clipped_in_part_is_judged_by_the_rest():
    shown = cv2.medianBlur(frame(10.0)[:128, :128], 3)
    clipped = np.arange(128)[:, None] < 90
    assert streaked(fine_windows(np.where(clipped, 255, shown)))
    assert not streaked(fine_windows(np.where(clipped, 255, frame(10.0)[:128, :128])))


def test_a_frame_behind_a_median_filter_has_no_noise_level_and_the_reason():
    monitor = ConditionMonitor()
    for sigma_dn in (5.0, 10.0):
        shown = cv2.medianBlur(frame(sigma_dn), 3).astype(np.float32) / 255
        answer = monitor.frame(shown).noise
        assert np.isnan(answer.summary.value)
        assert (answer.estimate.reason == STREAKED).sum() > 0.7 * len(answer.estimate)
        unfiltered = monitor.frame(frame(sigma_dn).astype(np.float32) / 255).noise.summary
        assert abs(unfiltered.value - sigma_dn) < 0.1 * sigma_dn


def test_patches_are_judged_one_by_one():
    """A filtered patch between others does not change their answers."""
    estimator = noise.create("adaptive")
    plain, filtered = frame(5.0)[:128, 128:256], cv2.medianBlur(frame(5.0), 3)[:128, 128:256]
    stack = np.stack([plain, filtered, plain])[:, None].astype(np.float32) / 255
    answer = estimator.estimate(stack)
    assert answer.reason.tolist() == ["", STREAKED, ""]
    alone = estimator.estimate(stack[:1]).sigma_dn[0]
    assert answer.sigma_dn[[0, 2]] == pytest.approx([alone, alone], rel=1e-5)
