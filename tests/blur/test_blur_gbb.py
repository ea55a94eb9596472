"""GBB: levels and exact kernels are the original program's; what both blind estimators do is in test_blur_blind."""

import pytest
from blind_cases import check_vector

from pipeline.blur import gbb


def test_levels_are_the_published_ones():
    assert [size for size, _ in gbb.levels(31, (192, 192))] == [31, 19, 11, 7, 5]
    assert [shape for _, shape in gbb.levels(31, (192, 192))] == [(side, side) for side in (192, 121, 76, 47, 29)]
    assert [size for size, _ in gbb.levels(25, (192, 192))] == [25, 15, 9, 5]


@pytest.mark.full("the exact mode takes 8 s")
@pytest.mark.shared
@pytest.mark.slow
@pytest.mark.parametrize("case", ["kitti_def7_0", "kitti_lin15_0_0", "udacity_def7_0"])
def test_exact_kernels_of_size_31_are_the_original_programs(shared, case):
    check_vector(shared, f"gbb_{case}_k31.npz", 1e-9)
