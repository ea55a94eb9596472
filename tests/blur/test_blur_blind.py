"""Both blind estimators: the authors' kernel, known blur recovered, nothing said where there is nothing to see."""

import numpy as np
import pytest
from blind_cases import KERNELS, blurred_scene, check_the_authors_picture, check_vector

from pipeline import blur
from pipeline.camera import mtf
from pipeline.errors import InputError

# percent, of two patches; motion along an axis is the hardest case
AMAE_BELOW = {
    "gbb": {"disc": 5, "diagonal": 5, "horizontal": 8},
    "pmp": {"disc": 5, "diagonal": 5, "horizontal": 20},
}
PUBLISHED = "1478020193690486111_car_1_0"

both = pytest.mark.parametrize("estimator", sorted(AMAE_BELOW))


@pytest.mark.shared
@both
def test_the_exact_kernel_and_the_authors_picture_are_reproduced(shared, estimator):
    """The kernel to rounding, and their 8-bit JPEG of it bit for bit."""
    kernel = check_vector(shared, f"{estimator}_udacity_{PUBLISHED}_k25.npz", 1e-10)
    check_the_authors_picture(kernel, shared / f"vectors/blind/{estimator}_{PUBLISHED}.jpg")


@both
@pytest.mark.parametrize("name", sorted(KERNELS))
def test_fast_mode_recovers_a_known_blur(estimator, name):
    estimate = blur.create(estimator, kernel_size=25).estimate(blurred_scene(KERNELS[name]))
    assert not estimate.abstained.any()
    assert np.median(mtf.amae(estimate.mtf, mtf.sample(KERNELS[name]))) < AMAE_BELOW[estimator][name]


@pytest.mark.full("the exact modes take 20 s")
@pytest.mark.slow
@both
@pytest.mark.parametrize("name", ["disc", "diagonal"])
def test_fast_mode_is_no_less_accurate_than_exact_mode(estimator, name):
    patches = blurred_scene(KERNELS[name])
    truth = mtf.sample(KERNELS[name])
    error = {}
    for mode in ("exact", "fast"):
        estimate = blur.create(estimator, mode=mode).estimate(patches)
        error[mode] = np.median(mtf.amae(estimate.mtf, truth))
    assert error["fast"] < error["exact"] + 0.6


@both
@pytest.mark.parametrize("mode", [pytest.param("exact", marks=pytest.mark.full("the exact modes take 10 s")), "fast"])
def test_kernels_are_non_negative_centred_and_of_unit_sum(estimator, mode):
    estimate = blur.create(estimator, mode=mode, kernel_size=25).estimate(blurred_scene(KERNELS["diagonal"])[:1])
    (kernel,) = estimate.kernel
    assert kernel.shape == (25, 25)
    assert kernel.dtype == (np.float64 if mode == "exact" else np.float32)
    assert kernel.min() >= 0
    assert kernel.sum() == pytest.approx(1, abs=1e-5)
    centre = np.arange(25) - 12
    assert abs(kernel.sum(axis=0) @ centre) < 0.75
    assert abs(kernel.sum(axis=1) @ centre) < 0.75
    assert estimate.mtf[0] == pytest.approx(mtf.sample(kernel))


@both
def test_patches_without_structure_abstain_and_keep_their_place(estimator):
    patches = np.concatenate([blurred_scene(KERNELS["disc"])[:1]] * 4)
    patches[0] = 0.4
    patches[2] = np.linspace(0.2, 0.8, 192, dtype=np.float32)  # a slope, as of a sky
    patches[3] = 1.0
    estimate = blur.create(estimator, kernel_size=25).estimate(patches)
    assert estimate.reason.tolist() == ["flat", "", "no edges", "flat"]
    assert estimate.abstained.tolist() == [True, False, True, True]
    assert np.isnan(estimate.kernel[estimate.abstained]).all()
    assert np.isfinite(estimate.kernel[~estimate.abstained]).all()


@both
def test_a_patch_does_not_depend_on_its_company_or_on_workers(estimator):
    patches = blurred_scene(KERNELS["disc"])[:2]
    together = blur.create(estimator, kernel_size=25).estimate(patches)
    alone = blur.create(estimator, kernel_size=25).estimate(patches[1:])
    shared_out = blur.create(estimator, kernel_size=25, workers=2).estimate(patches)
    assert np.array_equal(together.kernel[1], alone.kernel[0])
    assert np.array_equal(together.kernel, shared_out.kernel)


@both
def test_calibration_answers_one_for_the_sharp_frames_themselves(estimator):
    sharp = blurred_scene(np.ones((1, 1)))
    estimate = blur.create(estimator, kernel_size=25).calibrated(sharp).estimate(sharp)
    assert np.median(estimate.mtf) > 0.97


@both
def test_wrong_patches_are_refused(estimator):
    with pytest.raises(InputError, match="192"):
        blur.create(estimator).estimate(np.zeros((1, 1, 64, 64), np.float32))
