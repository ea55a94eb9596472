"""Edges: how steep they are, and that blur which they rule out is no answer."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from skimage import data

from pipeline.blur.base import BlurEstimate
from pipeline.camera import psf
from pipeline.camera.blur import blur
from pipeline.camera.mtf import sample
from pipeline.condition import ConditionMonitor
from pipeline.condition.sharp_edges import CONTRADICTED, LEAST_MTF50, contradicted, slopes, steepness
from pipeline.condition.summary import half_contrast
from pipeline.streams import stream


def edge(width_px: int, low_dn: float = 60.0, high_dn: float = 180.0) -> np.ndarray:
    """(192, 192) DN: an upright edge blurred by a box of a width."""
    columns = np.where(np.arange(192) < 96, low_dn, high_dn).astype(np.float32)
    return cv2.blur(np.tile(columns, (192, 1)), (width_px, 1))


def dots(radius_px: int = 10, step_px: int = 35, size=(400, 600)) -> np.ndarray:
    """A chart of dots, seen by a sharp lens: grey levels in [0, 1]."""
    chart = np.full((size[0] * 4, size[1] * 4), 30, np.uint8)
    for y in range(step_px, size[0], step_px):
        for x in range(step_px, size[1], step_px):
            cv2.circle(chart, (x * 4, y * 4), radius_px * 4, 200, -1)
    small = cv2.resize(chart, size[::-1], interpolation=cv2.INTER_AREA)
    return cv2.GaussianBlur(small, (0, 0), 0.6).astype(np.float32) / 255


@pytest.mark.parametrize("width_px", [1, 2, 3])
def test_a_step_rises_within_one_pixel_by_the_greatest_value_of_its_line_spread(width_px):
    assert steepness(edge(width_px)) == (pytest.approx(1 / width_px, rel=1e-5), 0.0)
    assert steepness(np.ascontiguousarray(edge(width_px).T)) == (0.0, pytest.approx(1 / width_px, rel=1e-5))


def test_noise_makes_no_step_steeper_than_it_is():
    for sigma_dn in (3.0, 10.0):
        noise = sigma_dn * stream(1, "edges", sigma_dn).standard_normal((192, 192))
        assert 0.5 < steepness((edge(1) + noise).astype(np.float32))[0] <= 1.0
        assert max(steepness((edge(9) + noise).astype(np.float32))) < LEAST_MTF50[0][0]


def test_low_steps_and_steps_to_white_tell_nothing():
    levels = edge(1) + np.where(np.arange(192)[:, None] > 150, 60.0, 0.0)  # in all the height, a step counts for less
    assert steepness(edge(1, 100.0, 115.0)) == (0.0, 0.0)
    assert steepness(edge(1, 60.0, 255.0)) == (0.0, 0.0)
    assert steepness(np.minimum(levels, 240.0).astype(np.float32))[0] == pytest.approx(1.0)


@pytest.mark.parametrize("share", [0.001, 0.02])
def test_single_pixels_are_no_steps(share):
    """Hot pixels and impulses of a transmission come after the lens."""
    levels = cv2.GaussianBlur(data.camera()[100:292, 150:342].astype(np.float32), (0, 0), 4)
    generator = stream(1, "impulses", share)
    levels[generator.random(levels.shape) < share] = 240
    assert max(steepness(levels)) < LEAST_MTF50[0][0]


@pytest.mark.parametrize(
    ("kind", "size_px"), [("defocus", 5), ("defocus", 11), ("gaussian", 5), ("linear_motion", 9), ("linear_motion", 21)]
)
@pytest.mark.parametrize("sigma_dn", [0.0, 8.0])
def test_no_blurred_picture_has_steps_that_its_kernel_rules_out(kind, size_px, sigma_dn):
    kernel = psf.create(kind, size_px)
    truth = half_contrast(sample(kernel))[0]
    picture = np.asarray(blur(data.camera().astype(np.float32), kernel))
    noisy = picture + sigma_dn * stream(1, "picture", size_px).standard_normal(picture.shape)
    for y, x in ((100, 150), (0, 0), (250, 200)):
        steep = steepness(np.rint(np.clip(noisy, 0, 255)).astype(np.float32)[y : y + 192, x : x + 192])[0]
        assert np.interp(steep, *LEAST_MTF50) <= truth


def test_the_upper_end_of_an_interval_counts_along_either_axis():
    patches = np.stack([edge(1), edge(1).T, edge(9)])[:, None] / np.float32(255)
    low = np.tile(np.linspace(0.6, 0.0, 8, dtype=np.float32), (3, 2, 1))
    high = np.tile(np.linspace(1.0, 0.9, 8, dtype=np.float32), (3, 2, 1))
    none = np.zeros(3, bool), np.array(["", "", ""])
    assert contradicted(BlurEstimate(low, *none), patches).tolist() == [True, True, False]
    assert not contradicted(BlurEstimate(low, *none, low=low, high=high), patches).any()
    absent = np.full((3, 2, 8), np.nan, np.float32)
    assert not contradicted(BlurEstimate(absent, np.ones(3, bool), np.array(["flat"] * 3)), patches).any()


def test_a_patch_that_is_sharp_in_part_keeps_its_estimate():
    picture = data.camera()[100:292, 150:342].astype(np.float32)
    soft = cv2.GaussianBlur(picture, (0, 0), 4)
    half = np.where(np.arange(192)[:, None] < 96, edge(1), soft)
    inside = np.roll(edge(1), 5, axis=1)  # of blocks
    assert slopes(inside) == pytest.approx(1 / 3) and np.quantile(slopes(soft), 0.9) < 0.2
    assert 0.1 < np.mean(slopes(half) < 0.2) < 0.9
    assert steepness(half)[0] == pytest.approx(1.0)
    low = BlurEstimate(
        np.tile(np.linspace(0.6, 0.0, 8, dtype=np.float32), (1, 2, 1)), np.zeros(1, bool), np.array([""])
    )
    assert not contradicted(low, half[None, None] / np.float32(255)).any()


def test_the_monitor_does_not_call_a_sharp_chart_of_dots_blurred():
    """Its patches were read as MTF50 .08 (.06 to .13), which is strong blur."""
    read = ConditionMonitor(noise_name="pca").frame(dots())
    assert read.reasons["blur"][CONTRADICTED] > 0.7 * len(read.blur.patches)
    soft = np.asarray(blur(dots(20, 70) * 255, psf.create("defocus", 11)), np.float32) / 255
    read = ConditionMonitor(noise_name="pca").frame(soft)
    assert not read.reasons["blur"] and (half_contrast(read.mtf.value) < 0.2).all()


def test_the_monitor_is_not_certain_that_a_sharp_star_is_blurred():
    """Its edges lie aslant; its patches were read as MTF50 .06 (.03 to .12)."""
    y, x = np.mgrid[:1600, :2400]
    star = np.where(np.sin(36 * np.arctan2(y - 800, x - 1200)) > 0, 200, 40).astype(np.uint8)
    star = cv2.resize(star, (600, 400), interpolation=cv2.INTER_AREA).astype(np.float32)
    read = ConditionMonitor(noise_name="pca").frame(cv2.GaussianBlur(star, (0, 0), 0.6) / 255)
    assert read.reasons["blur"][CONTRADICTED] > 0.4 * len(read.blur.patches)
    read = ConditionMonitor(noise_name="pca").frame(cv2.GaussianBlur(star, (0, 0), 3) / 255)
    assert not read.reasons["blur"] and (half_contrast(read.mtf.value) < 0.2).all()
