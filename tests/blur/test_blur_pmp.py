"""PMP: levels and exact kernels are the original program's; what both blind estimators do is in test_blur_blind."""

import cv2
import numpy as np
import pytest
from blind_cases import check_vector

from pipeline.blur import pmp
from pipeline.camera import mtf


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
@pytest.mark.slow
@pytest.mark.parametrize("case", ["kitti_def7_0", "kitti_lin15_0_0", "sim_non15_0_0", "udacity_non7_0_0"])
def test_exact_kernels_of_size_31_are_the_original_programs(shared, case):
    check_vector(shared, f"pmp_{case}_k31.npz", 1e-9)


@pytest.mark.shared
def test_the_authors_stored_mtf_is_that_of_their_picture(shared):
    folder = shared / "vectors/blind"
    picture = cv2.imread(str(folder / "pmp_1478020193690486111_car_1_0.jpg"), cv2.IMREAD_GRAYSCALE)
    result = mtf.sample(picture)
    for row, direction in enumerate("HV"):
        stored = np.load(folder / f"1478020193690486111_car_1_0_MTF-{direction}.npz")["arr_0"].ravel()
        assert result[row] == pytest.approx(stored, abs=1e-9)
