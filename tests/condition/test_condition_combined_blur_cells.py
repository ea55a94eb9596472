"""Errors of the blur read under noise: those of the single experiments, and what propagation of errors expects."""

import pandas as pd
import pytest

from pipeline.blur import evaluation
from pipeline.condition.combined_blur_cells import blur_cells, with_expected
from pipeline.condition.combined_design import DISC


def test_statistics_are_those_of_table_one_where_nothing_is_smoothed(read):
    cells = blur_cells(read, 1, 5)
    single = read[read["experiment"] == "linear_dcsn"]
    sharp = read[read["kernel"] == "sharp"]
    for way in (False, True):
        rows = pd.concat([single, sharp]).drop(columns=["experiment", "filter_px", "smoothed"])
        rows = evaluation.calibrated(rows) if way else rows
        theirs = evaluation.summarise(rows, 1, 0).set_index(["kind", "level_dn"])
        ours = cells[(cells["experiment"] == "linear_dcsn") & (cells["calibrated"] == way)]
        assert len(ours) == 2 and (ours["angles"] == 2).all()
        for row in ours.to_dict("records"):
            beside = theirs.loc[("linear_motion", row["level_dn"])]
            for name in ("amae_percent", "patch_error_percent", "coverage", "count"):
                assert row[name] == pytest.approx(beside[name]), name
            assert row["amae_percent"] == pytest.approx((row["mae_h_percent"] + row["mae_v_percent"]) / 2)


def test_the_error_expected_is_that_of_both_blurs(read):
    cells = blur_cells(read, 1, 5)
    errors = {("defocus_dcsn", 0.0, 0.0, 7.0): 3.0, (DISC, 0.0, 0.0, 5.0): 4.0,
              ("defocus_dcsn", 15.0, 5.0, 7.0): 9.0}  # fmt: skip
    rows = [
        {**cells.iloc[0].to_dict(), "experiment": name, "level_dn": level, "filter_px": filter_px, "size_px": size,
         "amae_percent": value, "calibrated": False}
        for (name, level, filter_px, size), value in errors.items()
    ]  # fmt: skip
    found = with_expected(pd.DataFrame(rows))
    assert set(found["experiment"]) == {"defocus_dcsn"}
    assert found[found["filter_px"] == 5]["expected_amae_percent"].tolist() == [5.0]
    assert found[found["filter_px"] == 0]["expected_amae_percent"].isna().all()
