"""PMP: equal to the original program, recovers known blur, abstains where there is nothing to see."""

import cv2
import numpy as np
import pytest
from blind_cases import KERNELS, blurred_scene, check_the_authors_picture, check_vector

from pipeline import blur
from pipeline.blur import pmp
from pipeline.camera import mtf
from pipeline.errors import InputError

# percent, of two patches; motion along an axis is the hardest case
AMAE_BELOW = {"disc": 5, "diagonal": 5, "horizontal": 20}
PUBLISHED = "pmp_udacity_1478020193690486111_car_1_0_k25.npz"


def test_levels_are_the_published_ones():
    assert [size for size, _ in pmp.levels(31)] == [31, 23, 17, 11, 9, 7]
    assert [size for size, _ in pmp.levels(25)] == [25, 19, 13, 9, 7]
    block = 4
    exact, fast = (pmp.SCHEDULES[mode] for mode in ("exact", "fast"))
    images = [192, 134, 94, 67, 47, 32]
    padded = [side + size - 1 for side, (size, _) in zip(images, pmp.levels(31), strict=True)]
    assert [exact.length(side, block) for side in padded] == [224, 156, 110, 77, 55, 39]
    assert all(fast.length(side, block) % block == 0 for side in padded)


@pytest.mark.shared
def test_the_exact_kernel_and_the_authors_picture_are_reproduced(shared):
    """The kernel to rounding, and their 8-bit JPEG of it bit for bit."""
    kernel = check_vector(shared, PUBLISHED, 1e-10)
    check_the_authors_picture(kernel, shared / "vectors/blind/pmp_1478020193690486111_car_1_0.jpg")


@pytest.mark.shared
@pytest.mark.slow
@pytest.mark.parametrize("case", ["kitti_def7_0", "kitti_lin15_0_0", "sim_non15_0_0", "udacity_non7_0_0"])
def test_exact_kernels_of_size_31_are_the_original_programs(shared, case):
    check_vector(shared, f"pmp_{case}_k31.npz", 1e-9)


@pytest.mark.shared
def test_the_authors_stored_mtf_is_that_of_their_picture(shared):
    folder = shared / "vectors/blind"
    picture = cv2.imread(str(folder / "pmp_1478020193690486111_car_1_0.jpg"), cv2.IMREAD_GRAYSCALE)
    found = mtf.sample(picture)
    for row, direction in enumerate("HV"):
        stored = np.load(folder / f"1478020193690486111_car_1_0_MTF-{direction}.npz")["arr_0"].ravel()
        assert found[row] == pytest.approx(stored, abs=1e-9)


@pytest.mark.parametrize("name", sorted(KERNELS))
def test_fast_mode_recovers_a_known_blur(name):
    found = blur.create("pmp", kernel_size=25).estimate(blurred_scene(KERNELS[name]))
    assert not found.abstained.any()
    assert np.median(mtf.amae(found.mtf, mtf.sample(KERNELS[name]))) < AMAE_BELOW[name]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["disc", "diagonal"])
def test_fast_mode_is_no_less_accurate_than_exact_mode(name):
    patches = blurred_scene(KERNELS[name])
    truth = mtf.sample(KERNELS[name])
    error = {}
    for mode in pmp.SCHEDULES:
        found = blur.create("pmp", mode=mode).estimate(patches)
        error[mode] = np.median(mtf.amae(found.mtf, truth))
    assert error["fast"] < error["exact"] + 0.6


@pytest.mark.parametrize("mode", ["exact", "fast"])
def test_kernels_are_non_negative_centred_and_of_unit_sum(mode):
    found = blur.create("pmp", mode=mode, kernel_size=25).estimate(blurred_scene(KERNELS["diagonal"])[:1])
    (kernel,) = found.kernel
    assert kernel.shape == (25, 25)
    assert kernel.dtype == (np.float64 if mode == "exact" else np.float32)
    assert kernel.min() >= 0
    assert kernel.sum() == pytest.approx(1, abs=1e-5)
    centre = np.arange(25) - 12
    assert abs(kernel.sum(axis=0) @ centre) < 0.75
    assert abs(kernel.sum(axis=1) @ centre) < 0.75
    assert found.mtf[0] == pytest.approx(mtf.sample(kernel))


def test_patches_without_structure_abstain_and_keep_their_place():
    patches = np.concatenate([blurred_scene(KERNELS["disc"])[:1]] * 4)
    patches[0] = 0.4
    patches[2] = np.linspace(0.2, 0.8, 192, dtype=np.float32)  # a slope, as of a sky
    patches[3] = 1.0
    found = blur.create("pmp", kernel_size=25).estimate(patches)
    assert found.reason.tolist() == ["flat", "", "no edges", "flat"]
    assert found.abstained.tolist() == [True, False, True, True]
    assert np.isnan(found.kernel[found.abstained]).all()
    assert np.isfinite(found.kernel[~found.abstained]).all()


def test_a_patch_does_not_depend_on_its_company_or_on_workers():
    patches = blurred_scene(KERNELS["disc"])[:2]
    together = blur.create("pmp", kernel_size=25).estimate(patches)
    alone = blur.create("pmp", kernel_size=25).estimate(patches[1:])
    shared_out = blur.create("pmp", kernel_size=25, workers=2).estimate(patches)
    assert np.array_equal(together.kernel[1], alone.kernel[0])
    assert np.array_equal(together.kernel, shared_out.kernel)


def test_calibration_answers_one_for_the_sharp_frames_themselves():
    sharp = blurred_scene(np.ones((1, 1)))
    found = blur.create("pmp", kernel_size=25).calibrated(sharp).estimate(sharp)
    assert np.median(found.mtf) > 0.97


def test_wrong_patches_are_refused():
    with pytest.raises(InputError, match="192"):
        blur.create("pmp").estimate(np.zeros((1, 1, 64, 64), np.float32))
