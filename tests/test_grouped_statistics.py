"""Statistics of groups of rows: robust summaries, weighted means."""

import math

import pandas as pd
import pytest

from pipeline.grouped_statistics import robust_by, weighted_mean
from pipeline.statistics import robust
from pipeline.streams import stream


def test_each_group_has_the_statistics_of_its_rows_in_order_of_appearance():
    table = pd.DataFrame({"name": list("bbbaaa"), "value": [1.0, 2.0, 3.0, 7.0, 8.0, math.nan]})
    cells = robust_by(table, ["name"], "value", 3, "report", "frames")
    assert cells["name"].tolist() == ["b", "a"] and cells["median"].tolist() == [2.0, 7.5]
    assert cells["count"].tolist() == [3, 2] and cells["abstained"].tolist() == [0, 1]
    alone = robust([1.0, 2.0, 3.0], stream(3, "report", "frames", "b"))
    assert (cells["low"][0], cells["high"][0]) == (alone.low, alone.high)  # a group does not depend on the others


def test_rows_without_a_name_form_a_group():
    table = pd.DataFrame(
        {"name": pd.array(["b", None, "b", None, "a"], dtype="string"), "level": [1.0, 1.0, 1.0, 1.0, math.nan],
         "value": [1.0, 5.0, 3.0, 7.0, 9.0]}
    )  # fmt: skip
    cells = robust_by(table, ["name", "level"], "value", 3, "report", "frames")
    assert cells["median"].tolist() == [2.0, 6.0, 9.0] and cells["count"].sum() == len(table)
    assert cells["name"].isna().tolist() == [False, True, False]
    assert cells["level"].isna().tolist() == [False, False, True]
    alone = robust([5.0, 7.0], stream(3, "report", "frames", None, 1.0))
    assert (cells["low"][1], cells["high"][1]) == (alone.low, alone.high)


def test_cells_weigh_by_their_patches_and_cells_without_a_number_not_at_all():
    rows = pd.DataFrame({"error": [1.0, 4.0, math.nan, 9.0], "count": [1, 2, 5, 0]})
    assert weighted_mean(rows, "error") == pytest.approx(3.0)
    assert math.isnan(weighted_mean(rows[rows["error"].isna()], "error"))
    assert math.isnan(weighted_mean(rows[rows["count"] == 0], "error"))
