"""Cells of a data frame: estimates with intervals, pivots, orders and means."""

import math

import pandas as pd
import pytest

from pipeline.report.tables import Estimate, amae, estimate, mean_cell, ordered, pivot, totals

ROW = {"amae_percent": 5.0, "low_percent": 4.0, "high_percent": 6.5, "median_dn": 9.0, "low_dn": 8.0, "high_dn": 9.5,
       "count": 72.0, "paper_percent": 5.2}  # fmt: skip


def test_a_row_gives_its_value_interval_count_and_reference():
    assert estimate("amae_percent", "low_percent", "high_percent")(ROW) == Estimate(5.0, 4.0, 6.5)
    assert estimate("median_dn", "low_dn", "high_dn", "count")(ROW) == Estimate(9.0, 8.0, 9.5, 72)
    assert amae(ROW) == Estimate(5.0, 4.0, 6.5, 72, 5.2)
    assert amae(ROW | {"paper_percent": math.nan, "count": math.nan}) == Estimate(5.0, 4.0, 6.5)
    assert amae({"median_dn": 9.0}) is None


def test_a_pivot_keeps_the_order_of_rows_and_leaves_absent_cells_out():
    frame = pd.DataFrame({"kind": ["b", "a", "b"], "name": ["x", "x", "y"], "value": [1.0, 2.0, 3.0]})
    rows = pivot(frame, ["kind"], "name", lambda row: row["value"])
    assert rows == [{"kind": "b", "x": 1.0, "y": 3.0}, {"kind": "a", "x": 2.0}]


def test_rows_are_sorted_by_each_columns_own_order():
    frame = pd.DataFrame({"dataset": ["kitti", "sim", "mine", "sim"], "size": [1, 3, 2, 1]})
    shown = ordered(frame, dataset=["sim", "kitti"], size=())
    assert list(zip(shown["dataset"], shown["size"], strict=True)) == [
        ("sim", 1),
        ("sim", 3),
        ("kitti", 1),
        ("mine", 2),
    ]
    assert list(shown.columns) == ["dataset", "size"]


def test_a_mean_is_of_all_cells_or_of_those_with_a_number():
    cells = [Estimate(1.0, reference=3.0), Estimate(math.nan, reference=9.0)]
    assert mean_cell(cells) is None and mean_cell([]) is None
    assert mean_cell(cells, complete=False) == Estimate(1.0, reference=3.0)
    assert mean_cell(cells[1:], complete=False).reference == 9.0
    assert mean_cell([Estimate(1.0, reference=3.0), Estimate(3.0)]) == Estimate(2.0)  # the paper lacks one
    assert mean_cell([1.0, 2.0]) == pytest.approx(1.5) and mean_cell([1.0, "PMP"]) is None


def test_totals_sum_counts_and_weight_means_by_them():
    cells = pd.DataFrame(
        {"name": ["b", "a", "b"], "count": [1, 2, 3], "abstained": [4, 0, 1], "error": [1.0, math.nan, 5]}
    )
    rows = totals(cells, ["name"], "error")
    assert rows["name"].tolist() == ["b", "a"] and rows["count"].tolist() == [4, 2]
    assert rows["abstained"].tolist() == [5, 0] and rows["error"].iloc[0] == 4.0 and math.isnan(rows["error"].iloc[1])
    assert totals(cells.iloc[:0], ["name"], "error").empty
