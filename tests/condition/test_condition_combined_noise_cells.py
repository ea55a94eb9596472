"""Noise read under blur: behind the optics it keeps its level, before them it is blurred."""

import numpy as np
import pandas as pd
import pytest
from bench_makers import KERNELS, bench

from pipeline.condition.combined_noise_cells import noise_cells
from pipeline.condition.combined_tables import NOISE_READ
from pipeline.datasets.patches import tiles
from pipeline.noise import create as noise_estimator


def test_noise_behind_the_optics_keeps_its_level_and_noise_before_them_is_blurred(frame, patches):
    places = tiles(frame.image().shape)
    made = bench(blur={}, noise={"pca": noise_estimator("pca")}).evaluate(frame, patches, places)[1]
    noise = NOISE_READ.conform(pd.DataFrame(made))
    cells = noise_cells(noise, 1, 5).set_index(["experiment", "size_px", "level_dn"])
    assert noise["kind"].isin(["defocus", "linear_motion"]).all()
    behind, before = (cells.loc[(name, 7.0, 15.0)] for name in ("defocus_dcsn", "photon_defocus"))
    assert behind["added_median_dn"] == pytest.approx(15, rel=0.02)
    assert behind["median_dn"] == pytest.approx(behind["true_median_dn"], rel=0.1)
    # White noise through a disc keeps the root of the sum of squares of its weights.
    kernel = next(kernel for kernel in KERNELS if kernel.kind == "defocus")
    left = np.sqrt((kernel.psf.astype(float) ** 2).sum())
    unblurred = cells.loc[("photon_defocus", 0.0, 15.0)]
    assert unblurred["added_median_dn"] > 10
    assert before["added_median_dn"] == pytest.approx(left * unblurred["added_median_dn"], rel=0.15)
    assert before["median_dn"] < 0.2 * behind["median_dn"]
    assert cells.loc[("defocus_dcsn", 7.0, 0.0)]["added_median_dn"] == 0
