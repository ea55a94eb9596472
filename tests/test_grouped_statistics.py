"""Statistics of groups of rows: robust summaries, weighted means."""

import math

import numpy as np
import pandas as pd
import pytest

from pipeline.grouped_statistics import robust_by, share_interval, weighted_mean
from pipeline.statistics import robust
from pipeline.streams import stream


def test_each_group_has_the_statistics_of_its_rows_in_order_of_appearance():
    table = pd.DataFrame({"name": list("bbbaaa"), "value": [1.0, 2.0, 3.0, 7.0, 8.0, math.nan]})
    cells = robust_by(table, ["name"], "value", 3, "report", "frames")
    assert cells["name"].tolist() == ["b", "a"] and cells["median"].tolist() == [2.0, 7.5]
    assert cells["count"].tolist() == [3, 2] and cells["abstained"].tolist() == [0, 1]
    alone = robust_by(table[:3], ["name"], "value", 3, "report", "frames")
    assert (cells["low"][0], cells["high"][0]) == (alone["low"][0], alone["high"][0])  # a group depends on no other


def test_rows_without_a_name_form_a_group():
    table = pd.DataFrame(
        {"name": pd.array(["b", None, "b", None, "a"], dtype="string"), "level": [1.0, 1.0, 1.0, 1.0, math.nan],
         "value": [1.0, 5.0, 3.0, 7.0, 9.0]}
    )  # fmt: skip
    cells = robust_by(table, ["name", "level"], "value", 3, "report", "frames")
    assert cells["median"].tolist() == [2.0, 6.0, 9.0] and cells["count"].sum() == len(table)
    assert cells["name"].isna().tolist() == [False, True, False]
    assert cells["level"].isna().tolist() == [False, False, True]
    alone = robust_by(table[table["name"].isna()], ["name", "level"], "value", 3, "report", "frames")
    assert (cells["low"][1], cells["high"][1]) == (alone["low"][0], alone["high"][0])
    assert cells["low"].isna().tolist() == [False, False, True]  # a single row does not show how it scatters


def test_few_frames_have_the_interval_that_holds_the_truth():
    """Plain quantiles over eight frames hold it in some 87 %, expanded by Student's t in 95 % and more."""
    values = stream(0, "robust_by").normal(10.0, 2.0, (200, 8))
    table = pd.DataFrame({"trial": np.repeat(np.arange(200), 8), "value": values.ravel()})
    cells = robust_by(table, ["trial"], "value", 3, "report", "frames")
    held = ((cells["low"] <= 10.0) & (cells["high"] >= 10.0)).mean()
    plain = [robust(row, stream(1, "plain", number)) for number, row in enumerate(values)]
    assert held > 0.93 > np.mean([one.low <= 10.0 <= one.high for one in plain]) + 0.03
    assert (cells["low"] <= cells["median"]).all() and (cells["median"] <= cells["high"]).all()


def test_what_is_never_negative_has_no_interval_below_zero():
    shares = pd.DataFrame({"name": ["a"] * 6, "value": [0.0, 0.0, 0.1, 0.2, 0.4, 0.4]})
    cells = robust_by(shares, ["name"], "value", 3, "report", "frames")
    assert cells["low"][0] == 0.0
    shifted = shares.assign(value=shares["value"] - 0.2)
    assert robust_by(shifted, ["name"], "value", 3, "report", "frames")["low"][0] < -0.2


def test_cells_weigh_by_their_patches_and_cells_without_a_number_not_at_all():
    rows = pd.DataFrame({"error": [1.0, 4.0, math.nan, 9.0], "count": [1, 2, 5, 0]})
    assert weighted_mean(rows, "error") == pytest.approx(3.0)
    assert math.isnan(weighted_mean(rows[rows["error"].isna()], "error"))
    assert math.isnan(weighted_mean(rows[rows["count"] == 0], "error"))


def test_the_interval_of_a_share_is_exact():
    """Ends are where the tail of the binomial distribution holds 2.5 %; of none of n it is 1 - .025^(1/n)."""
    low, high = share_interval(3, 20)
    tail = sum(math.comb(20, k) * low**k * (1 - low) ** (20 - k) for k in range(3, 21))
    assert tail == pytest.approx(0.025, abs=1e-6)
    assert sum(math.comb(20, k) * high**k * (1 - high) ** (20 - k) for k in range(4)) == pytest.approx(0.025, abs=1e-6)
    assert share_interval(0, 22) == (0.0, pytest.approx(1 - 0.025 ** (1 / 22)))
    assert share_interval(22, 22) == (pytest.approx(0.025 ** (1 / 22)), 1.0)
