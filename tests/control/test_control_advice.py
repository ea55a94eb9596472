"""Advice where motion or noise is uncertain: settings that are better whatever it is, or those there are."""

from __future__ import annotations

import numpy as np
import pytest
from control_makers import CAMERA, darker_performance, performance, seen_mtf

from pipeline.blur.base import BlurEstimate
from pipeline.condition import BlurState, Condition, NoiseState
from pipeline.condition.summary import summarise
from pipeline.control.advice import LEAST_GAIN_PERCENT, advise, inside
from pipeline.control.precision.prediction import predict
from pipeline.control.state import BASE_ISO, CameraState
from pipeline.errors import InputError
from pipeline.noise.base import NoiseEstimate

SURFACE, LEVEL, STATE = performance(), 0.5, CameraState(0.016, 1.0)
IMAGE = np.full((40, 40), LEVEL, np.float32)


def condition(motions_px, sigma_dn=3.0, ends_dn=(3.0, 3.0)):
    """A frame whose motion is estimated at the second length, and may be of the first to the third; noise likewise."""
    high, value, low = (seen_mtf(length).value[None] for length in motions_px)
    no, why = np.zeros(1, bool), np.array([""], dtype=np.str_)
    low_dn, high_dn = (np.array([end]) for end in ends_dn)
    noise = NoiseEstimate(np.array([sigma_dn]), low_dn, high_dn, no, why.astype(object))
    of_noise = summarise(noise.sigma_dn, low_dn, high_dn)
    summary = summarise(value, low, high)
    return Condition(
        BlurState((), BlurEstimate(value, no, why), (1, 1), summary, 1.0),
        NoiseState((), noise, (1, 1), of_noise, noise.sigma_dn.reshape(1, 1), 1.0, ends_dn[1]),
    )


def advice(motions_px, speed_px_s=None, **noise):
    return advise(IMAGE, STATE, CAMERA, SURFACE, None, speed_px_s, condition(motions_px, **noise))


def points_gained(chosen, motions_px, sigma_dn=3.0):
    """By other settings over those of the frame, with each motion."""
    linear, gains = LEVEL**CAMERA.formation.gamma, []
    for motion_px in motions_px:
        true_dn = float(SURFACE.true_sigma_dn(sigma_dn))
        at = predict(CAMERA.formation, true_dn, motion_px, linear, STATE, [STATE, chosen])
        here, there = SURFACE.ap_percent(at.sigma_dn, at.motion_px, at.level)
        gains.append(there - here)
    return np.array(gains)


def test_settings_stay_where_the_motion_decides_and_is_uncertain():
    sure, unsure = advice((13.0, 14.0, 15.0)), advice((0.0, 14.0, 28.0))
    assert sure.action == "move" and sure.best_exposure_ms < 16 and sure.gain_percent > 5 and not sure.undecided
    assert (unsure.action, unsure.best_exposure_ms, unsure.gain_percent) == ("hold", 16.0, 0.0) and unsure.undecided
    assert "the motion decides, which is uncertain (0 to 28 px)" in unsure.reason
    assert unsure.ap_percent == sure.ap_percent
    assert unsure.low_percent < sure.low_percent < sure.high_percent < unsure.high_percent
    assert (unsure.motion_low_px, unsure.motion_high_px) == pytest.approx((0, 28), abs=0.5)


def test_a_known_speed_leaves_no_motion_uncertain():
    known = advice((0.0, 14.0, 28.0), speed_px_s=14.0 / 0.016)
    assert known.action == "move" and not known.undecided
    assert known.motion_low_px == known.motion_px == known.motion_high_px


def test_a_known_speed_counts_whatever_its_sign_and_is_a_finite_number():
    forth, back = (advice((0.0, 14.0, 28.0), speed_px_s=sign * 300.0) for sign in (1, -1))
    assert forth == back and np.isfinite(back.ap_percent)
    for nothing in (np.nan, np.inf):
        with pytest.raises(InputError, match="speed_px_s is (nan|inf); expected a finite number"):
            advice((0.0, 14.0, 28.0), speed_px_s=nothing)


def test_settings_that_are_better_with_any_possible_motion_are_advised_with_their_least_gain():
    wide, exact = advice((4.0, 14.0, 28.0)), advice((13.0, 14.0, 15.0))
    assert wide.action == "move" and "better with any motion of 4 to 28 px" in wide.reason
    assert wide.best_exposure_ms > exact.best_exposure_ms
    chosen = CameraState(wide.best_exposure_ms / 1e3, wide.best_iso / 100)
    gains = points_gained(chosen, np.linspace(4.0, 28.0, 25))
    assert gains.min() > wide.gain_percent - 0.2 > LEAST_GAIN_PERCENT - 0.2
    assert points_gained(chosen, [0.0])[0] < 0  # which is why it matters


def test_noise_that_texture_may_hide_counts_as_far_as_it_may_reach():
    sure = advice((6.9, 7.0, 7.1), sigma_dn=0.02, ends_dn=(0.0, 0.5))
    hidden = advice((6.9, 7.0, 7.1), sigma_dn=0.02, ends_dn=(0.0, 18.0))
    assert hidden.ap_percent == sure.ap_percent and hidden.low_percent < sure.low_percent - 20
    assert "noise up to 18 DN" in hidden.reason or hidden.undecided
    assert hidden.gain_percent < sure.gain_percent


def test_settings_stay_where_noise_may_be_more_than_was_measured():
    beyond = advice((13.0, 14.0, 15.0), sigma_dn=8.0, ends_dn=(3.0, 90.0))
    assert beyond.action == "hold" and beyond.undecided and "more than was measured" in beyond.reason
    assert (beyond.best_exposure_ms, beyond.gain_percent, beyond.low_percent) == (16.0, 0.0, 0.0)


@pytest.mark.parametrize(("motion_px", "sigma_dn"), [(14.0, 3.0), (26.0, 3.0), (1.0, 0.02)])
def test_nothing_is_promised_of_settings_brought_inside_the_limits_where_noise_may_be_beyond_any_measured(
    motion_px, sigma_dn
):
    """150 ms at ISO 100 become 33 ms at 4.5 times the gain: the noise of the estimate, or none, is not the least AP."""
    slow, hidden = CameraState(0.15, 1.0), condition((motion_px,) * 3, sigma_dn=sigma_dn, ends_dn=(0.0, 40.0))
    made = advise(IMAGE, slow, CAMERA, SURFACE, None, None, hidden)
    assert made.undecided and "more than was measured" in made.reason
    assert (made.best_exposure_ms, made.best_iso) == pytest.approx((33.0, 454.5), rel=1e-3)
    assert np.isfinite(made.ap_percent) and np.isnan(made.best_ap_percent) and np.isnan(made.gain_percent)


@pytest.mark.parametrize("exposure_s", [0.001, 0.004, 0.016, 0.033])
@pytest.mark.parametrize("iso", [100, 400, 800, 3200])
@pytest.mark.parametrize("sigma_dn", [0.0, 1.0, 3.0, 10.0])
@pytest.mark.parametrize("motion_px", [1.0, 3.0, 12.0])
def test_other_settings_promise_more_than_the_picture_has_whatever_its_noise_is(exposure_s, iso, sigma_dn, motion_px):
    """Also where the sensor's model takes the noise for much more or less than there is."""
    state = CameraState(exposure_s, iso / BASE_ISO)
    of_picture = condition((motion_px,) * 3, sigma_dn, (sigma_dn, sigma_dn))
    made = advise(IMAGE, state, CAMERA, SURFACE, None, None, of_picture)
    if made.action == "move":
        assert made.gain_percent > LEAST_GAIN_PERCENT
        assert made.best_ap_percent == pytest.approx(made.ap_percent + made.gain_percent)
    elif made.action == "hold":
        assert (made.best_exposure_ms, made.best_iso) == (state.exposure_ms, state.iso)
        assert made.gain_percent == 0 and made.best_ap_percent == made.ap_percent


def test_noise_at_other_settings_is_in_proportion_to_that_of_the_picture():
    """A clean picture at a high gain, of a camera better than the sensor named, may be exposed as short again."""
    fast = CameraState(0.004, 16.0)
    clean, noisy = (
        advise(IMAGE, fast, CAMERA, SURFACE, None, None, condition((9.0,) * 3, dn, (dn, dn))) for dn in (0.5, 25.0)
    )
    assert clean.best_exposure_ms < fast.exposure_ms and clean.gain_percent > 2
    assert noisy.best_exposure_ms > clean.best_exposure_ms


@pytest.mark.parametrize("motions_px", [(3.0,) * 3, (0.0, 14.0, 28.0), (13.0, 14.0, 15.0)])
@pytest.mark.parametrize(("sigma_dn", "ends_dn"), [(3.0, (3.0, 3.0)), (0.02, (0.0, 18.0)), (35.0, (35.0, 35.0))])
@pytest.mark.parametrize("speed_px_s", [None, 14.0 / 0.016])
def test_settings_that_are_kept_promise_what_the_picture_has(motions_px, sigma_dn, ends_dn, speed_px_s):
    made = advice(motions_px, speed_px_s, sigma_dn=sigma_dn, ends_dn=ends_dn)
    assert made.keeps_settings == (made.action == "hold")
    if made.keeps_settings:
        assert (made.best_ap_percent, made.gain_percent) == (made.ap_percent, 0.0)
    assert 0.0 <= made.low_percent <= made.ap_percent <= made.high_percent <= 100.0


def test_advice_needs_no_monitor_beside_a_condition_and_one_of_both():
    estimated = condition((13.0, 14.0, 15.0))
    assert advise(IMAGE, STATE, CAMERA, SURFACE, condition=estimated) == advice((13.0, 14.0, 15.0))
    with pytest.raises(InputError, match="expected a monitor, or the condition"):
        advise(IMAGE, STATE, CAMERA, SURFACE)


def test_an_estimate_of_no_noise_is_as_uncertain_as_the_estimator():
    """Half a grey level: next to nothing, times the ratio of any two settings, would be next to nothing everywhere."""
    fast = CameraState(0.008, 4.0)
    none, some = (
        advise(IMAGE, fast, CAMERA, SURFACE, None, None, condition((12.0,) * 3, dn, (dn, dn))) for dn in (0.001, 0.5)
    )
    assert (none.best_exposure_ms, none.best_iso) == (some.best_exposure_ms, some.best_iso)


def test_settings_that_are_nominally_at_a_limit_are_inside():
    """Cameras report rounded times and gains; a hundredth beyond a limit is the limit."""
    limits = CAMERA.limits
    for state in (
        CameraState(limits.exposure_min_s / 1.01, 2.0),
        CameraState(limits.exposure_max_s * 1.01, 2.0),
        CameraState(0.008, limits.gain_min / 1.01),
        CameraState(0.008, limits.gain_max * 1.01),
    ):
        assert inside(limits, state) == state
    assert inside(limits, CameraState(limits.exposure_min_s / 1.1, 2.0)).exposure_s >= limits.exposure_min_s
    assert inside(limits, CameraState(limits.exposure_max_s * 1.1, 2.0)).exposure_s <= limits.exposure_max_s


def test_a_picture_brighter_than_any_measured_is_compared_like_the_brightest():
    """Its own settings would be unknown, and be kept for that."""
    surface, of_picture = darker_performance(0.0), condition((8.0, 9.0, 10.0), sigma_dn=0.02, ends_dn=(0.0, 4.0))
    levels = (0.5, 0.64)
    usual, bright = (
        advise(np.full((40, 40), level, np.float32), STATE, CAMERA, surface, None, None, of_picture) for level in levels
    )
    assert usual.action == bright.action == "move" and not bright.undecided
    assert "better with any noise up to 4 DN" in usual.reason and "better with any noise up to 4 DN" in bright.reason
    assert max(bright.best_exposure_ms, usual.best_exposure_ms) < STATE.exposure_ms


def test_of_a_picture_darker_than_any_measured_brightness_alone_is_corrected():
    surface, of_picture = darker_performance(0.0), condition((2.0, 4.0, 8.0), ends_dn=(2.0, 4.0))
    made = advise(np.full((40, 40), 0.08, np.float32), STATE, CAMERA, surface, None, None, of_picture)
    assert made.action == "abstained" and not made.undecided and np.isnan(made.gain_percent)
    assert made.reason.startswith("frames of this brightness were not measured")
    assert made.best_exposure_ms == STATE.exposure_ms and made.best_iso > 10 * STATE.iso
