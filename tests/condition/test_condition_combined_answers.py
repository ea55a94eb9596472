"""Answers of the blur alone: the disc is divided out, and what it left nothing of abstains."""

import numpy as np
import pandas as pd
import pytest
from bench_makers import readings

from pipeline.camera import mtf
from pipeline.camera.psf.defocus import create as disc
from pipeline.condition.combined_answers import cleared
from pipeline.condition.combined_blur_cells import blur_cells


def test_the_disc_is_divided_out_where_enough_is_left(read):
    exact = mtf.sample(disc(3.0))

    def both(rows):
        known = [exact["HV".index(axis), np.abs(mtf.FREQUENCIES - f).argmin()]
                 for axis, f in zip(rows["axis"], rows["frequency"], strict=True)]  # fmt: skip
        return rows["true_mtf"] * np.array(known)

    clear = cleared(readings(read, both, 3.0))
    answered = clear["mtf"].notna()
    assert clear.loc[answered, "mtf"].to_numpy() == pytest.approx(clear.loc[answered, "true_mtf"].to_numpy())
    product = both(readings(read, both, 3.0))
    assert answered.tolist() == (product > 0.05).tolist() and 0.2 < answered.mean() < 1
    cells = blur_cells(pd.concat([read, readings(read, both, 3.0)]), 1, 5)
    row = cells[(cells["filter_px"] == 3) & ~cells["calibrated"]].iloc[0]
    assert row["amae_percent"] == pytest.approx(0, abs=1e-9) and row["smoothed_share"] == 1
    assert row["frequencies_share"] == pytest.approx(answered.mean())
    assert row["abstained"] == 0


def test_a_patch_of_which_nothing_is_left_abstains(read):
    clear = cleared(readings(read, lambda rows: 0.0, 7.0))
    assert clear["abstained"].all() and set(clear["reason"]) == {"noise"}
    cells = blur_cells(pd.concat([read, readings(read, lambda rows: 0.0, 7.0)]), 1, 5)
    row = cells[(cells["filter_px"] == 7) & ~cells["calibrated"]].iloc[0]
    assert np.isnan(row["amae_percent"]) and row["count"] == 0 and row["abstained"] > 0
