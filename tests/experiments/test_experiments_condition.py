"""Conditions: grids, kernels chosen from a bank, and the part that a slow estimator takes."""

import numpy as np
import pytest

from pipeline.camera.psf.bank import bank
from pipeline.errors import InputError
from pipeline.experiments.condition import (
    Condition,
    Subset,
    chosen_kernels,
    first_rotations,
    grid,
    nearest_rotation,
    sharp_kernel,
    sweep_kernels,
)

KERNELS = bank(["defocus", "linear_motion"], [7], [0, 90], 1)
BLURS = sweep_kernels("linear_motion", [0, 3, 21], [0, 45], "nominal", 1)


def test_the_sharp_kernel_comes_first_and_sizes_keep_their_directions():
    assert [(k.name, k.size_px, k.angle_deg) for k in BLURS] == [
        ("sharp", 0.0, 0.0),
        ("linear_motion_3_0", 3, 0),
        ("linear_motion_3_45", 3, 45),
        ("linear_motion_21_0", 21, 0),
        ("linear_motion_21_45", 21, 45),
    ]
    np.testing.assert_allclose(BLURS[1].psf, [[0, 0, 0], [1 / 3] * 3, [0, 0, 0]], atol=1e-6)  # 0 degrees: horizontal
    assert (BLURS[3].psf > 0.04).sum() == 21


def test_a_grid_goes_through_kernels_then_sources_then_levels():
    listed = [(c.kernel.name, c.noise_source, c.target_sigma_dn) for c in grid(BLURS[:2], ["dcsn", "photon"], [0, 5])]
    assert listed[:3] == [("sharp", "dcsn", 0.0), ("sharp", "dcsn", 5.0), ("sharp", "photon", 0.0)]
    assert len(listed) == 8 and listed[-1] == ("linear_motion_3_0", "photon", 5.0)


def test_the_reference_is_the_sharp_frame_without_noise():
    assert Condition().is_reference and not Condition().blurred and not Condition().noisy
    assert not Condition(KERNELS[0]).is_reference and not Condition(experiment="noise alone").is_reference
    assert not Condition(noise_source="dcsn", target_sigma_dn=5.0).is_reference


def test_a_slow_estimator_takes_its_part_and_always_the_reference():
    part = Subset(sizes_px=[7], angles_deg=[90], target_sigmas_dn=[15], experiments=["linear_dcsn", "defocus_dcsn"])
    listed = [
        Condition(kernel, "dcsn", level, f"{kernel.kind.split('_')[0]}_dcsn")
        for kernel in KERNELS
        for level in (0.0, 15.0)
    ]
    held = [(c.kernel.name, c.target_sigma_dn) for c in listed if part.holds(c)]
    assert held == [("defocus_7", 15.0), ("linear_motion_7_90", 15.0)]  # a disc has no rotation
    assert part.holds(Condition())


def test_a_kernel_the_bank_lacks_is_named():
    with pytest.raises(InputError, match=r"combined.sizes_px: the kernel bank has no defocus of 9 px, only \['7'\]"):
        chosen_kernels(KERNELS, ["defocus"], [7, 9], "combined.sizes_px")
    assert [kernel.name for kernel in chosen_kernels(KERNELS, ["defocus"], [7], "x")] == ["defocus_7"]


def test_rotations_are_chosen_by_their_angle():
    names = [kernel.name for kernel in first_rotations([sharp_kernel(), *KERNELS[::-1]])]
    assert names == ["linear_motion_7_0", "defocus_7"]
    assert nearest_rotation(KERNELS, "linear_motion", 7).angle_deg == 0  # 0 and 90 are as near to 45
    assert nearest_rotation(KERNELS, "linear_motion", 7, 80).angle_deg == 90
    assert nearest_rotation(KERNELS, "linear_motion", 9) is None
