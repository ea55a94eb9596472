"""The example's curves: medians over patches of the rotation the paper draws."""

import numpy as np
import pytest
from bench_makers import KERNELS

from pipeline.blur import evaluation
from pipeline.camera import mtf
from pipeline.condition.combined_curves import example_curves


def test_example_curves_are_medians_of_the_rotation_nearest_to_the_diagonal(read):
    curves = example_curves(read, 7.0)
    own = curves[(curves["experiment"] == "linear_dcsn") & (curves["level_dn"] == 15) & ~curves["calibrated"]]
    assert set(own["angle_deg"]) == {0.0} and set(own["axis"]) == {"H", "V", "HV"}  # 0 and 90 are as near
    here = (read["experiment"] == "linear_dcsn") & (read["level_dn"] == 15) & (read["angle_deg"] == 0)
    lowest = read[here & (read["axis"] == "H") & np.isclose(read["frequency"], mtf.FREQUENCIES[0])]["mtf"]
    first = own[(own["axis"] == "H") & (own["place"] == 0)].iloc[0]
    assert first["median"] == pytest.approx(evaluation.robust_median(lowest.to_numpy()))
    kernel = next(kernel for kernel in KERNELS if kernel.name == "linear_motion_7_0")
    both = own[own["axis"] == "HV"].sort_values("place")["true_mtf"].to_numpy()
    assert both == pytest.approx(mtf.sample(kernel.psf).mean(axis=0))
