"""How estimators are asked: pixels of their own, and answers that are refused where they are none."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.answers import asked, check_answer
from pipeline.blur.base import BlurEstimate
from pipeline.errors import InputError
from pipeline.noise.base import NoiseEstimate

PATCHES = np.full((3, 1, 16, 16), 0.5, np.float32)


def noise_answer(**changes):
    """A right answer for three patches, the last abstained from, with changes."""
    right = {
        "sigma_dn": np.array([2.0, 3.0, np.nan]), "low_dn": np.array([1.0, 2.0, np.nan]),
        "high_dn": np.array([3.0, 3.0, np.nan]), "abstained": np.array([False, False, True]),
        "reason": np.array(["", "", "flat"], object),
    }  # fmt: skip
    return NoiseEstimate(**{**right, **changes})


def blur_answer(mtf=0.5, **changes):
    """The same of blur; of the second patch one frequency is left out."""
    values = np.full((3, 2, 8), mtf)
    values[1, 0, 3] = values[2] = np.nan
    answer = BlurEstimate(values, np.array([False, False, True]), np.array(["", "", "flat"]))
    return replace(answer, **changes)


def test_an_estimator_cannot_spoil_the_pixels_of_the_next():
    patches = PATCHES.copy()

    def in_place(pixels):
        pixels *= 0
        return noise_answer()

    asked("mine", in_place, patches, "sigma_dn")
    np.testing.assert_array_equal(patches, PATCHES)


@pytest.mark.parametrize(
    ("quantity", "answer"),
    [
        ("sigma_dn", noise_answer()),
        ("sigma_dn", noise_answer(sigma_dn=np.array([1 - 1e-9, 3 + 1e-9, np.nan]))),
        ("sigma_dn", noise_answer(low_dn=np.full(3, np.nan), high_dn=np.full(3, np.nan))),
        ("mtf", blur_answer()),
        ("mtf", blur_answer(mtf=1 + 1e-9)),
        ("mtf", blur_answer(low=np.full((3, 2, 8), -0.1), high=np.full((3, 2, 8), 1.2))),
    ],
)
def test_a_right_answer_is_returned_as_it_is(quantity, answer):
    assert asked("mine", lambda _: answer, PATCHES, quantity) is answer


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (None, "returned NoneType, expected pipeline.noise.base.NoiseEstimate"),
        ({"sigma_dn": np.ones(3)}, "returned dict"),
        (blur_answer(), "returned BlurEstimate, expected pipeline.noise"),
        (noise_answer(sigma_dn=np.ones(1)), "answered for 1 of 3 patches; expected all"),
        (noise_answer(sigma_dn=[1.0, 2.0, 3.0]), "sigma_dn is of type list, expected a NumPy array"),
        (noise_answer(sigma_dn=np.array(["a", "b", "c"])), "sigma_dn has the data type <U1, expected numbers"),
        (noise_answer(abstained=np.zeros(3)), "abstained has the data type float64, expected bool"),
        (noise_answer(reason=np.zeros(3)), "reason has the data type float64, expected text"),
        (noise_answer(low_dn=None), "low_dn is of type NoneType"),
        (noise_answer(low_dn=np.ones((3, 1))), r"low_dn has shape \(3, 1\), expected \(3,\)"),
        (noise_answer(at_most_dn=np.ones(2)), r"at_most_dn has shape \(2,\)"),
        (noise_answer(sigma_dn=np.array([2.0, 3.0, 1.0])), "patch 2 is a number in spite of an abstention"),
        (noise_answer(sigma_dn=np.array([2.0, np.nan, np.nan])), "patch 1 is NaN without an abstention"),
        (noise_answer(sigma_dn=np.array([2.0, -3.0, np.nan])), "sigma_dn of patch 1 is -3, expected a finite number"),
        (noise_answer(sigma_dn=np.array([np.inf, 3.0, np.nan])), "sigma_dn of patch 0 is inf"),
        (noise_answer(low_dn=np.array([1.0, 5.0, np.nan])), "patch 1 is 3 with low end 5; expected finite low <= val"),
        (noise_answer(high_dn=np.array([1.5, 4.0, np.nan])), "patch 0 is 2 with high end 1.5"),
        (noise_answer(high_dn=np.array([np.inf, 4.0, np.nan])), "patch 0 is 2 with high end inf"),
    ],
)  # fmt: skip
def test_a_wrong_answer_of_noise_is_refused_by_name(answer, words):
    with pytest.raises(InputError, match=f"^noise estimator 'mine': .*{words}"):
        asked("noise estimator 'mine'", lambda _: answer, PATCHES, "sigma_dn")


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (lambda: np.ones((3, 2, 8)), "returned ndarray, expected pipeline.blur.base.BlurEstimate"),
        (noise_answer, "returned NoiseEstimate"),
        (lambda: BlurEstimate(np.ones((1, 2, 8)), np.zeros(1, bool), np.array([""])), "answered for 1 of 3 patches"),
        (lambda: BlurEstimate(np.ones((3, 8)), np.zeros(3, bool), np.full(3, "")), r"mtf has shape \(3, 8\)"),
        (lambda: BlurEstimate(np.ones((3, 2, 8)).tolist(), np.zeros(3, bool), np.full(3, "")), "mtf is of type list"),
        (lambda: BlurEstimate(0.5, np.zeros(3, bool), np.full(3, "")), "mtf is of type float"),
        (lambda: blur_answer(mtf=7.0), "mtf of patch 0 is 7, expected 0 to 1"),
        (lambda: blur_answer(mtf=np.inf), "mtf of patch 0 is inf, expected 0 to 1"),
        (lambda: blur_answer(mtf=-0.1), "mtf of patch 0 is -0.1"),
        (lambda: blur_answer(low=np.full((3, 2, 8), 0.7)), "mtf of patch 0 is 0.5 with low end 0.7"),
    ],
)
def test_a_wrong_answer_of_blur_is_refused_by_name(answer, words):
    with pytest.raises(InputError, match=f"^blur estimator 'mine': .*{words}"):
        asked("blur estimator 'mine'", lambda _: answer(), PATCHES, "mtf")


def test_an_answer_for_no_patches_is_right():
    nothing = np.empty(0)
    reason = np.empty(0, object)
    check_answer(NoiseEstimate(nothing, nothing, nothing, np.empty(0, bool), reason), "sigma_dn", 0)
    check_answer(BlurEstimate(np.empty((0, 2, 8)), np.empty(0, bool), np.empty(0, str)), "mtf", 0)
