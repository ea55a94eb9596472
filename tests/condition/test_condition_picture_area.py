"""Bars beside the picture and a uniform surround: left out, so that noise and blur are those of the picture."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from data_makers import picture

from pipeline.condition import ConditionMonitor
from pipeline.condition.frame_flags import measure
from pipeline.condition.picture_area import COVERED_REASON, covered, picture_area, picture_circle
from pipeline.errors import InputError
from pipeline.streams import stream

SIGMA_DN = 8.0


def scene(sigma_dn: float = SIGMA_DN, height_px: int = 420, width_px: int = 640) -> np.ndarray:
    """A noisy picture, grey levels."""
    smooth = cv2.GaussianBlur(picture("area", width_px, height_px), (0, 0), 0.7).astype(np.float32)
    noisy = 25 + 0.8 * smooth + sigma_dn * stream(1, "area").normal(0, 1, smooth.shape)
    return np.rint(np.clip(noisy, 0, 255)).astype(np.float32)


def as_frame(levels: np.ndarray) -> np.ndarray:
    return (levels / 255).astype(np.float32)


@pytest.mark.parametrize("level", [0, 16, 128, 255])
def test_bars_are_left_out_and_a_codecs_ripple_is_no_picture(level):
    inner = scene()
    whole = np.full((inner.shape[0] + 101, inner.shape[1] + 70), float(level))
    whole[50:-51, 30:-40] = inner
    whole[:50] += np.arange(whole.shape[1]) % 2 * (1 if level < 255 else -1)
    rows, columns = picture_area(as_frame(whole))
    assert (rows.start, rows.stop) == (56, 470) and (columns.start, columns.stop) == (32, 670)


def test_a_picture_without_bars_is_whole_and_so_is_a_frame_of_nothing_else():
    whole = (slice(0, 420), slice(0, 640))
    assert picture_area(as_frame(scene())) == whole
    assert picture_area(np.full((420, 640), 0.3, np.float32)) == whole
    thin = np.zeros((420, 640), np.float32)
    thin[200:210] = as_frame(scene())[200:210]  # ten lines are no picture
    assert picture_area(thin) == whole


@pytest.mark.parametrize("light", [1.0, 0.05])
def test_the_circle_of_a_fisheye_is_that_of_its_lens_though_shadows_meet_it(light):
    levels = scene()
    levels[150:260, :160] = 4.0
    y, x = np.mgrid[-210:210, -320:320] + 0.5
    inside = np.hypot(x, y) < 300
    circle = picture_circle(as_frame(np.where(inside, levels, 1.0)))
    assert circle is not None and np.mean(circle != inside) < 0.01
    assert picture_circle(as_frame(np.rint(levels * light))) is None
    assert picture_circle(np.zeros((420, 640), np.float32)) is None
    assert picture_circle(np.zeros((16, 16), np.float32)) is None


def test_noise_and_flags_of_a_letterboxed_frame_are_those_of_its_picture():
    inner = scene()
    whole = np.full((inner.shape[0] + 160, inner.shape[1]), 16.0)
    whole[80:-80] = inner
    monitor = ConditionMonitor()
    boxed, alone = monitor.frame(as_frame(whole)), monitor.frame(as_frame(inner))
    assert float(boxed.sigma_dn.value) == pytest.approx(float(alone.sigma_dn.value), rel=0.05)
    assert float(boxed.sigma_dn.low) <= SIGMA_DN <= float(boxed.sigma_dn.high)
    assert {square.y_px for square in boxed.noise.patches} == {square.y_px + 80 for square in alone.noise.patches}
    assert boxed.noise.map_dn.shape == (73, 80) and np.isnan(boxed.noise.map_dn[:10]).all()
    assert measure(as_frame(whole)) == measure(as_frame(inner))


def test_squares_that_a_surround_covers_abstain():
    inner = scene()
    y, x = np.mgrid[: inner.shape[0], : inner.shape[1]]
    whole = np.where(np.hypot(y - 210, x - 320) < 230, inner, 16.0)
    state = ConditionMonitor().frame(as_frame(whole))
    reasons = state.reasons
    assert min(reasons["noise"][COVERED_REASON], reasons["blur"][COVERED_REASON]) >= 2
    answered = np.zeros(state.noise.map_dn.shape, bool)
    for square, without in zip(state.noise.patches, state.noise.estimate.abstained, strict=True):
        rows, columns = (slice(start // 8, -(-(start + 128) // 8)) for start in (square.y_px, square.x_px))
        answered[rows, columns] |= not without
    assert answered.any() and not (np.isfinite(state.noise.map_dn) & ~answered).any()
    assert float(state.sigma_dn.low) <= SIGMA_DN <= float(state.sigma_dn.high)


@pytest.mark.parametrize("sigma_dn", [0.0, 2.0, 25.0])
def test_pictures_are_not_covered(sigma_dn):
    """Without noise large areas of this one are uniform, beside others that hardly vary."""
    drawn = np.kron(np.array([[40.0, 90.0], [160.0, 120.0]]), np.ones((64, 64)))
    drawn += np.where(np.arange(128) > 70, np.arange(128) / 16, 0.0)
    noisy = drawn + sigma_dn * stream(1, "uncovered").normal(0, 1, drawn.shape)
    patch = as_frame(np.rint(np.clip(noisy, 0, 255)))[None, None]
    assert not covered(patch).any()
    patch[..., :20] = 16 / 255
    assert covered(patch).all() == (sigma_dn > 0)


@pytest.mark.parametrize("level", [0, 255])
def test_black_and_white_parts_are_no_surround(level):
    """Estimators leave saturated pixels out by themselves."""
    patch = as_frame(scene())[None, None, :128, :128].copy()
    patch[..., :40] = level / 255
    assert not covered(patch).any()
    patch[..., :40] = 128 / 255
    assert covered(patch).all()


def test_a_calibration_needs_structure():
    """A grey card with noise was taken for a blurred reference."""
    card = as_frame(np.rint(128 + 5 * stream(1, "card").normal(0, 1, (400, 576))))
    with pytest.raises(InputError, match="no patch has structure"):
        ConditionMonitor().calibrate([card])
    sharp = as_frame(scene(0.0, 400, 576))
    alone, beside = ConditionMonitor(), ConditionMonitor()
    alone.calibrate([sharp])
    beside.calibrate([sharp, card, sharp[:100]])  # nor can one be smaller than a patch
    blurred = as_frame(np.rint(cv2.GaussianBlur(scene(0.0, 400, 576), (0, 0), 1.5)))
    assert beside.frame(blurred).mtf.value == pytest.approx(alone.frame(blurred).mtf.value)
