"""Speed from a sequence of motion estimates, and the noise ratio."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.control.temporal.noise_ratio import NoiseRatio
from pipeline.control.temporal.speed import (
    BEYOND,
    LONGEST_RESOLVED_PX,
    RESOLUTION_PX,
    SpeedFilter,
    length_error_px,
    resolved_px,
)


def test_speed_short_exposures_do_not_run_away():
    """A length at the resolution of the estimator, seen at ever shorter times, must not be taken for high speed."""
    speed = SpeedFilter()
    speed.update(6.0, 0.008, 2.0)
    for exposure_s in (0.004, 0.002, 0.001, 0.0005):
        speed.update(max(750.0 * exposure_s, 1.5), exposure_s, 5.0)
    assert speed.value_px_s == pytest.approx(750.0, rel=0.15)


def test_speed_strong_noise_is_hardly_believed():
    speed = SpeedFilter()
    for _ in range(5):
        speed.update(6.0, 0.008, 2.0)
    before = speed.value_px_s
    assert speed.update(9.5, 0.001, 27.0) == pytest.approx(before, rel=0.05)


def test_speed_a_sudden_change_is_followed_within_two_frames():
    speed = SpeedFilter()
    for _ in range(6):
        speed.update(2.0, 0.02, 3.0)
    for _ in range(2):
        speed.update(18.0, 0.012, 3.0)
    assert speed.value_px_s == pytest.approx(1500.0, rel=0.2)
    assert speed.high_px_s > speed.value_px_s


@given(st.floats(0.0, 45.0), st.floats(5e-5, 0.033), st.floats(0.1, 60.0))
def test_speed_first_estimate_is_the_resolved_length(length_px, exposure_s, sigma_dn):
    speed = SpeedFilter()
    assert speed.update(length_px, exposure_s, sigma_dn) == pytest.approx(resolved_px(length_px) / exposure_s)
    assert 0.0 <= resolved_px(length_px) <= (1.0 + BEYOND * (length_px >= LONGEST_RESOLVED_PX)) * length_px
    assert length_error_px(length_px, sigma_dn) >= RESOLUTION_PX


def test_noise_ratio_trusts_strong_noise_and_hardly_weak():
    assert NoiseRatio().update(0.66, 0.9) > 0.9
    assert NoiseRatio().update(1.5, 15.0) == pytest.approx(1.5, rel=0.05)
    ratio = NoiseRatio()
    for _ in range(30):
        ratio.update(2.0, 6.0)
    assert ratio.value == pytest.approx(2.0, rel=0.02)


def test_speed_follows_a_sudden_change_at_once():
    """From 100 to 1500 px/s in one frame of 20 ms: no average of both."""
    filtered = SpeedFilter()
    for _ in range(6):
        filtered.update(2.0, 0.020, 2.0)
    assert filtered.value_px_s < 150
    filtered.update(15.0, 0.020, 2.0)
    assert filtered.value_px_s == pytest.approx(750.0, rel=0.01)


def test_speed_follows_a_sudden_change_that_the_monitor_no_longer_resolves():
    """From 100 to 1500 px/s: the line of 30 px looks like 22.6 px; the next, shorter exposure is near the speed."""
    filtered = SpeedFilter()
    for _ in range(6):
        filtered.update(2.8, 0.020, 2.0)
    filtered.update(22.6, 0.020, 2.0)
    assert filtered.value_px_s == pytest.approx(1.5 * 22.6 / 0.020)
    filtered.update(6.0, 0.004, 4.0)
    assert filtered.value_px_s == pytest.approx(1500.0, rel=0.05)


def test_speed_of_unresolved_lines_is_bounded_from_below_and_corrected_by_the_next_frame():
    """Lines of 30 and of 50 px both look like 22.6 px; a shorter exposure then resolves the speed."""
    filtered = SpeedFilter()
    filtered.update(22.6, 0.020, 2.0)
    assert filtered.value_px_s == pytest.approx(1.5 * 22.6 / 0.020)
    filtered.update(6.0, 0.005, 4.0)
    assert filtered.value_px_s == pytest.approx(1200.0, rel=0.08)


def test_speed_is_kept_through_short_exposures_and_given_up_where_a_long_one_shows_no_motion():
    filtered = SpeedFilter()
    filtered.update(4.0, 0.010, 2.0)
    before = filtered.value_px_s
    for _ in range(20):
        filtered.update(0.0, 0.002, 3.0)  # 0.8 px: below the resolution
    assert filtered.value_px_s == pytest.approx(before, rel=0.01)
    for _ in range(20):
        filtered.update(0.0, 0.030, 2.0)
    assert filtered.value_px_s * 0.030 < 1.1 * RESOLUTION_PX


def test_a_ratio_of_noise_that_was_seen_often_is_hardly_moved_by_one_frame():
    once, often = NoiseRatio(), NoiseRatio()
    for _ in range(20):
        often.update(1.0, 10.0)
    assert often.value == 1.0
    assert once.update(2.0, 10.0) > 1.8 > 1.6 > often.update(2.0, 10.0) > 1.3


def test_a_ratio_of_weak_noise_is_believed_less():
    """Estimates err by half a grey level: of 1 DN that is half of it."""
    weak, strong = NoiseRatio(), NoiseRatio()
    assert weak.update(2.0, 1.0) < 1.4 < 1.8 < strong.update(2.0, 20.0) < 2.0
