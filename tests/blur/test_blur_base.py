"""What every blur estimator promises: checked input, counted abstentions, calibration by sharp frames."""

import numpy as np
import pytest
import torch

from pipeline import blur
from pipeline.blur.base import (
    FREQUENCIES,
    SHARP_FLOOR,
    BlurEstimate,
    BlurEstimator,
    Estimator,
    WithoutEmptyFrequencies,
    as_patches,
    unusable,
)
from pipeline.errors import InputError
from pipeline.streams import stream


class Brightness(Estimator):
    """Answers the mean of a patch as its MTF: easy to predict."""

    def measure(self, patches, reason):
        result = np.ones((len(patches), 2, FREQUENCIES)) * patches.mean(axis=(1, 2, 3), dtype=float)[:, None, None]
        result[reason != ""] = np.nan
        return BlurEstimate(result, reason != "", reason, low=result * 0.5, high=result * 1.5)


class Soft(Estimator):
    """Answers an MTF of a fiftieth everywhere."""

    def measure(self, patches, reason):
        return BlurEstimate(np.full((len(patches), 2, FREQUENCIES), 0.02), reason != "", reason)


@pytest.fixture
def patches():
    """(3, 1, 192, 192), means about 0.2, 0.3 and 0.4."""
    noise = stream(1, "patches").random((3, 1, 192, 192), dtype=np.float32)
    return noise * 0.1 + np.array([0.15, 0.25, 0.35], np.float32)[:, None, None, None]


def test_numpy_and_torch_answer_alike(patches):
    of_array = Brightness().estimate(patches)
    of_tensor = Brightness().estimate(torch.from_numpy(patches).double().requires_grad_())
    assert np.array_equal(of_array.mtf, of_tensor.mtf)
    assert of_array.mtf.shape == (3, 2, 8)
    assert len(of_array) == 3


def test_no_patches_is_no_answers(patches):
    assert len(Brightness().estimate(patches[:0])) == 0
    assert blur.create("pmp").estimate(patches[:0]).kernel.shape == (0, 31, 31)


def test_flat_and_saturated_patches_abstain_with_a_reason(patches):
    patches[0] = 0.5
    patches[1, :, :120] = 1.0
    estimate = Brightness().estimate(patches)
    assert estimate.reason.tolist() == ["flat", "saturated", ""]
    assert estimate.abstained.tolist() == [True, True, False]
    assert np.isnan(estimate.mtf[:2]).all()
    assert np.isfinite(estimate.mtf[2]).all()


def test_a_black_frame_is_flat_rather_than_saturated():
    assert unusable(np.zeros((1, 1, 192, 192), np.float32)).tolist() == ["flat"]


def test_calibration_divides_by_the_median_of_sharp_frames_and_clips(patches):
    sharp = np.concatenate([patches[1:2]] * 9 + [np.full_like(patches[:1], 0.3)])  # one of them flat
    plain = Brightness()
    calibrated = plain.calibrated(sharp)
    before, after = plain.estimate(patches), calibrated.estimate(patches)
    mean = patches[1].mean()
    assert after.mtf[0] == pytest.approx(before.mtf[0] / mean, rel=1e-6)
    assert after.low[0] == pytest.approx(before.low[0] / mean, rel=1e-6)
    assert (after.mtf[2] == 1).all()
    assert plain.sharp_mtf is None
    assert np.array_equal(calibrated.calibrated(sharp).sharp_mtf, calibrated.sharp_mtf)  # anew, not on top


def test_calibration_ignores_outliers(patches):
    sharp = np.concatenate([patches[1:2] + 0.001 * index for index in range(20)] + [patches[1:2] + 0.6])
    mean = patches[1].mean()
    assert Brightness().calibrated(sharp).sharp_mtf == pytest.approx(np.full((2, 8), mean + 0.0095), abs=1e-4)


def test_calibration_does_not_divide_by_next_to_nothing(patches):
    dark = patches[:1] * 0.02
    dark[:, :, ::2] += 0.04
    factor = Brightness().calibrated(dark)
    assert factor.sharp_mtf.max() < SHARP_FLOOR
    estimate = factor.estimate(dark)
    assert estimate.mtf == pytest.approx(np.full((1, 2, 8), dark.mean() / SHARP_FLOOR), rel=1e-5)


def test_frequencies_that_the_camera_does_not_pass_take_the_answer_of_the_next_lower(patches):
    """Where it passes less than the floor, what is divided is noise."""
    divided = Soft()
    divided.sharp_mtf = np.array([[0.8, 0.6, 0.4, 0.3, 0.2, 0.06, 0.04, 0.01], [0.8] * 8])
    relative = divided.estimate(patches).mtf
    answer = WithoutEmptyFrequencies(divided).estimate(patches).mtf
    assert np.array_equal(answer[:, 1], relative[:, 1])
    assert np.array_equal(answer[:, 0], relative[:, 0][:, [0, 1, 2, 3, 4, 5, 5, 5]])


def test_calibration_needs_a_patch_that_can_be_measured(patches):
    with pytest.raises(InputError, match="sharp_patches: none of the 2"):
        Brightness().calibrated(np.full((2, 1, 192, 192), 0.5, np.float32))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (np.zeros((2, 192, 192), np.float32), "shape"),
        (np.zeros((2, 1, 128, 128), np.float32), "shape"),
        (np.zeros((2, 3, 192, 192), np.float32), "shape"),
        ([np.zeros((1, side, side), np.float32) for side in (192, 128)], "more than one shape"),
        ([np.zeros((side, 192, 192), np.float32) for side in (1, 3)], "more than one shape"),
        ([torch.zeros(1, side, side) for side in (192, 128)], "more than one shape"),
        (np.zeros((2, 1, 192, 192), np.uint8), "divide 8-bit images by 255"),
        (np.full((2, 1, 192, 192), np.nan, np.float32), "NaN"),
        (np.full((2, 1, 192, 192), 1.5, np.float32), "1.5"),
        (np.full((2, 1, 192, 192), -0.1, np.float32), "-0.1"),
    ],
)
def test_wrong_patches_are_refused_by_name(wrong, message):
    with pytest.raises(InputError, match=message) as error:
        as_patches(wrong, "mine")
    assert str(error.value).startswith("mine:")
    assert "\n" not in str(error.value)


def test_an_answer_is_nan_exactly_where_abstained():
    mtf = np.full((2, 2, 8), 0.5)
    with pytest.raises(InputError, match="NaN exactly where abstained"):
        BlurEstimate(mtf, np.array([True, False]), np.array(["flat", ""]))
    with pytest.raises(InputError, match="kernel"):
        BlurEstimate(mtf, np.zeros(2, bool), np.array(["", ""]), kernel=np.ones((3, 31, 31)))


def test_an_mtf_outside_its_range_is_refused_before_a_calibration_would_cut_it_off():
    class Gain(Brightness):
        """Seven times the right MTF."""

        def measure(self, patches, reason):
            right = super().measure(patches, reason)
            return BlurEstimate(7 * right.mtf, right.abstained, right.reason)

    patches = 0.3 + 0.1 * stream(1, "outside").random((2, 1, 192, 192)).astype(np.float32)
    gain = Gain()
    gain.sharp_mtf = np.ones((2, FREQUENCIES))
    with pytest.raises(InputError, match="mtf of patch 0 is 2.4[0-9]*, expected 0 to 1"):
        gain.estimate(patches)


@pytest.mark.parametrize("name", ["pmp", "gbb"])
def test_names_make_estimators(name):
    assert isinstance(blur.create(name, mode="exact", kernel_size=25), BlurEstimator)
    assert name in blur.REGISTRY.names()


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("pmpp", {}, "did you mean 'pmp'"),
        ("pmp", {"mod": "fast"}, "mod"),
        ("gbb", {"mode": "quick"}, "exact, fast"),
        ("pmp", {"kernel_size": 30}, "odd"),
        ("pmp", {"kernel_size": 31.0}, "odd"),
        ("gbb", {"kernel_size": 5}, "7 to 63"),
        ("gbb", {"workers": 0}, "at least 1"),
    ],
)
def test_wrong_names_and_options_are_refused(name, options, message):
    with pytest.raises(InputError, match=message):
        blur.create(name, **options)


def test_masked_arrays_are_refused(patches):
    masked = np.ma.masked_greater(np.asarray(patches), 0.5)
    with pytest.raises(InputError, match="patches: masked arrays"):
        blur.create("spectral").estimate(masked)
