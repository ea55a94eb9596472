"""Words for a condition: grades, direction and cause follow from the numbers; what is unknown is stated."""

import numpy as np
import pytest
from control_makers import REFERENCE, darker_performance, formula_ap, performance

from pipeline.camera.mtf import FREQUENCIES, sample
from pipeline.camera.psf import create
from pipeline.condition.summary import half_contrast
from pipeline.condition.verdict import (
    blurred_fraction,
    bound_words,
    directed,
    grade,
    is_partly_blurred,
    noise_ends,
    noise_parts_words,
)
from pipeline.control.motion import motion_mtf
from pipeline.control.precision.expected_precision import equivalent_motion, expected_precision
from pipeline.streams import stream

LENS = np.tile(np.exp(-0.5 * np.linspace(0.05, 0.6, 8)), (2, 1))


def blurred(kind, size_px, angle_deg=0.0):
    return LENS * sample(create(kind, size_px, angle_deg, stream(0, "verdict", kind, size_px)))


@pytest.mark.parametrize(
    ("kind", "size_px", "angle_deg", "blur", "direction", "cause"),
    [
        ("linear_motion", 7, 0, "moderately blurred", "horizontal", "probably motion"),
        ("linear_motion", 7, 90, "moderately blurred", "vertical", "probably motion"),
        ("linear_motion", 21, 0, "strongly blurred", "horizontal", "probably motion"),
        ("linear_motion", 11, 45, "moderately blurred", "", "defocus, water on the lens or diagonal motion"),
        ("defocus", 11, 0, "moderately blurred", "", "defocus, water on the lens or diagonal motion"),
    ],
)
def test_grades_of_known_kernels(kind, size_px, angle_deg, blur, direction, cause):
    grades = grade(2.0, blurred(kind, size_px, angle_deg))
    assert (grades.blur, grades.direction, grades.blur_cause, grades.noise) == (blur, direction, cause, "low")


def test_sharp_pictures_have_neither_direction_nor_cause():
    grades = grade(0.5, LENS * np.array([[0.95], [0.7]]))
    assert (grades.blur, grades.direction, grades.causes()) == ("sharp", "", [])
    assert grades.words() == ["sharp", "noise very low"]


@pytest.mark.parametrize(
    ("low_px", "high_px", "blur_range", "cause"),
    [
        (21, 7, "", "probably motion"),
        (21, 4, "slightly blurred to strongly blurred", ""),
        (21, 0, "sharp to strongly blurred", ""),
        (7, 0, "sharp to moderately blurred", ""),
    ],
)
def test_a_grade_whose_interval_reaches_two_grades_off_is_uncertain(low_px, high_px, blur_range, cause):
    """No cause is named then: sharp frames with noise were given one."""
    low, high = (blurred("linear_motion", size_px) if size_px else LENS for size_px in (low_px, high_px))
    grades = grade(2.0, blurred("linear_motion", 7), ends=(low, high))
    assert (grades.blur_range, grades.blur_cause) == (blur_range, cause)
    uncertain = f" (uncertain: {blur_range})" if blur_range else ""
    assert grades.words()[0] == f"moderately blurred, mainly horizontal{uncertain}"
    nothing = np.full((2, 8), np.nan)
    assert grade(2.0, LENS, ends=(nothing, nothing)).blur_range == ""


@pytest.mark.parametrize(
    ("low_dn", "high_dn", "uncertain"),
    [(1.5, 3.1, False), (1.7, 6.0, False), (0.0, 3.9, False), (0.0, 4.0, True), (0.0, 19.0, True), (3.0, 12.0, True)],
)
def test_noise_is_reckoned_with_as_far_as_its_interval_reaches_two_grades(low_dn, high_dn, uncertain):
    assert noise_ends(2.5, low_dn, high_dn) == ((low_dn, high_dn) if uncertain else (2.5, 2.5))
    assert noise_ends(2.5, np.nan, np.nan) == (2.5, 2.5)


def test_what_is_unknown_is_stated():
    grades = grade(np.nan, np.full((2, 8), np.nan))
    assert grades.words() == ["blur unknown", "noise unknown"] and grades.causes() == []


def test_strong_noise_of_a_dark_picture_comes_from_little_light():
    assert grade(15.0, LENS, 20.0).causes() == ["little light"]
    assert grade(15.0, LENS, 120.0).causes() == ["probably high gain"]
    assert grade(9.0, LENS, 20.0).causes() == []


def test_expected_precision_is_that_of_the_motion_which_leaves_the_same_contrast():
    surface = performance()
    for length_px in (0.0, 5.0, 12.0):
        curve = REFERENCE * np.abs(np.sinc(0.0)) + 0.0
        curve[:, 0] = motion_mtf(length_px, REFERENCE, 0)
        assert equivalent_motion(surface, float(curve[:, 0].mean())) == pytest.approx(length_px, abs=0.15)
        here = expected_precision(surface, 10.0, curve)
        assert here.ap_percent == pytest.approx(formula_ap(9.0, length_px), rel=0.08)
        assert here.low_percent <= here.ap_percent <= here.high_percent < here.best_percent
        relative = expected_precision(surface, 10.0, curve / REFERENCE, relative=True)
        assert relative.ap_percent == pytest.approx(here.ap_percent, rel=1e-9)


def test_expected_precision_is_that_of_the_frames_brightness():
    surface, curve = darker_performance(-8.0), REFERENCE
    bright, dark, middle, glaring = (
        expected_precision(surface, 10.0, curve, level=level).ap_percent for level in (0.5, 0.25, 0.5**1.5, 0.9)
    )
    assert dark == pytest.approx(bright - 8.0) and middle == pytest.approx(bright - 4.0)
    assert glaring == bright == expected_precision(surface, 10.0, curve).ap_percent
    assert np.isnan(expected_precision(surface, 10.0, curve, level=0.1).ap_percent)  # darker than any measured


def test_an_unmeasured_or_unknown_condition_has_no_precision():
    surface = performance()
    for sigma, contrast in ((80.0, 0.9), (5.0, 0.0), (np.nan, 0.9), (5.0, np.nan)):
        here = expected_precision(surface, sigma, np.full((2, 8), contrast))
        assert np.isnan(here.ap_percent) and here.best_percent > 80


def test_a_bound_is_rounded_up_and_nothing_where_it_is_unknown():
    assert [bound_words(dn) for dn in (3.2, 7.0, float("nan"))] == ["at most 4 DN", "at most 7 DN", ""]


def test_noise_is_taken_apart_in_words_where_there_is_enough_of_it():
    processed, white = noise_parts_words(3.14, 1.12, 0.552), noise_parts_words(5.0, 5.0, -0.001)
    assert processed == (
        "Noise of 3.1 DN, of which 1.1 DN white; neighbouring pixels correlate by 0.55: "
        "the camera has processed its noise"
    )
    assert white == "Noise of 5.0 DN, of which 5.0 DN white; neighbouring pixels correlate by 0.00"
    for numbers in ((np.nan, 1.0, 0.5), (3.0, np.nan, 0.5), (3.0, 1.0, np.nan), (0.9, 0.3, 0.6)):
        assert noise_parts_words(*numbers) == ""


def test_no_direction_is_told_where_little_contrast_is_left_on_both_axes():
    """A disc of 25 px: estimates of .04 and .06 of the contrast tell no direction."""
    faint = np.stack([np.geomspace(0.5, 0.02, 8), np.geomspace(0.5, 0.01, 8) * 0.6])
    assert half_contrast(faint).max() < 0.11
    graded = grade(2.0, faint)
    assert (graded.blur, graded.direction) == ("strongly blurred", "")
    assert graded.blur_cause == "defocus, water on the lens or diagonal motion"
    moved = np.stack([np.geomspace(0.5, 0.02, 8), np.linspace(1, 0.8, 8)])
    assert grade(2.0, moved).direction == "horizontal" and grade(2.0, moved).blur_cause == "probably motion"


def test_the_share_of_blurred_patches_counts_those_that_are_surely_blurred():
    sharp, soft, strong = (np.stack([np.linspace(1, end, 8)] * 2) for end in (0.9, -0.4, -3.0))
    soft, strong = np.maximum(soft, 0), np.maximum(strong, 0)
    none = np.full((2, 8), np.nan)
    mtf = np.stack([sharp, strong, strong, none])
    assert blurred_fraction(mtf, mtf) == pytest.approx(2 / 3)
    assert blurred_fraction(mtf, np.stack([sharp, strong, sharp, none])) == pytest.approx(1 / 3)
    assert blurred_fraction(mtf, None) == pytest.approx(2 / 3)
    moved = np.stack([np.stack([sharp[0], strong[0]]), np.stack([strong[0], sharp[0]]), sharp])  # on one axis each
    assert blurred_fraction(moved, moved) == pytest.approx(2 / 3)
    assert np.isnan(blurred_fraction(none[None], None))


def with_half_contrast_at(mtf50):
    """An MTF, alike on both axes, that falls to half there."""
    return np.tile(0.5 ** (FREQUENCIES / mtf50), (2, 1))


def test_a_patch_is_surely_blurred_where_its_interval_ends_below_slight_blur():
    """Of sharp frames with noise, patches whose interval ends at .30 or .34 of Nyquist made many partly blurred."""
    mtf = np.stack([with_half_contrast_at(0.1)] * 4)
    high = np.stack([with_half_contrast_at(mtf50) for mtf50 in (0.2, 0.26, 0.3, 0.34)])
    assert blurred_fraction(mtf, high) == pytest.approx(0.5)


def test_a_frame_is_partly_blurred_where_its_grade_does_not_say_so():
    assert is_partly_blurred("sharp", 0.2) and is_partly_blurred("slightly blurred", 0.4)
    assert not is_partly_blurred("sharp", 0.19) and not is_partly_blurred("", float("nan"))
    assert not is_partly_blurred("moderately blurred", 0.6) and not is_partly_blurred("strongly blurred", 1.0)


@pytest.mark.parametrize(
    ("share", "direction", "cause"),
    [
        (0.7, "horizontal", "probably motion"),
        (0.6, "", ""),  # most directions that sharp frames were given had between half and 70 % of the patches
        (0.4, "", "defocus, water on the lens or diagonal motion"),
    ],
)
def test_neither_direction_nor_cause_is_named_where_patches_do_not_agree(share, direction, cause):
    grades = grade(2.0, blurred("linear_motion", 7), shares=(share, 0.0))
    assert (grades.blur, grades.direction, grades.blur_cause) == ("moderately blurred", direction, cause)


def test_a_direction_is_that_of_the_blurred_patches_not_of_medians_over_sharp_ones():
    """Seven patches, four of them blurred alike in both axes: medians per axis differ, no patch has a direction."""
    sharp, blurred = np.full((2, 8), 0.95), np.linspace(0.7, 0.05, 8) * np.ones((2, 1))
    patches = np.stack([sharp, sharp, sharp, *[blurred] * 4])
    between = np.stack([blurred[0] + 0.3, blurred[1]])
    assert directed(patches) == (0.0, 0.0)
    assert grade(3.0, between).direction == "vertical"
    grades = grade(3.0, between, shares=directed(patches))
    assert (grades.direction, grades.blur_cause) == ("", "defocus, water on the lens or diagonal motion")
    moved = np.stack([np.stack([sharp[0], blurred[1]])] * 3 + [blurred, sharp, np.full((2, 8), np.nan)])
    assert directed(moved) == (0.0, 0.75)
    assert grade(3.0, between, shares=directed(moved)).direction == "vertical"
    assert directed(np.empty((0, 2, 8))) == (0.0, 0.0)
