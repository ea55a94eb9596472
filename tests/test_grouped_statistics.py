"""Statistics of groups of rows: robust summaries, means over clusters, weighted means."""

import math

import numpy as np
import pandas as pd
import pytest

from pipeline.grouped_statistics import cluster_mean, robust_by, weighted_mean
from pipeline.statistics import robust
from pipeline.streams import stream


def test_each_group_has_the_statistics_of_its_rows_in_order_of_appearance():
    table = pd.DataFrame({"name": list("bbbaaa"), "value": [1.0, 2.0, 3.0, 7.0, 8.0, math.nan]})
    cells = robust_by(table, ["name"], "value", 3, "report", "frames")
    assert cells["name"].tolist() == ["b", "a"] and cells["median"].tolist() == [2.0, 7.5]
    assert cells["count"].tolist() == [3, 2] and cells["abstained"].tolist() == [0, 1]
    alone = robust([1.0, 2.0, 3.0], stream(3, "report", "frames", "b"))
    assert (cells["low"][0], cells["high"][0]) == (alone.low, alone.high)  # a group does not depend on the others


def test_a_mean_over_clusters_has_the_interval_of_the_clusters():
    frames = pd.Series(np.repeat(np.arange(8), 50))
    values = frames.astype(float)  # patches of a frame err alike
    mean, low, high, count = cluster_mean(values, frames, stream(0, "clusters"))
    assert (mean, count) == (3.5, 400) and low < 2.6 and high > 4.4
    apart = cluster_mean(values, pd.Series(np.arange(400)), stream(0, "patches"))
    assert apart[2] - apart[1] < 0.5 * (high - low)


def test_one_cluster_gives_no_interval_and_no_value_no_mean():
    mean, low, high, count = cluster_mean(pd.Series([1.0, 3.0, math.nan]), pd.Series(list("aaa")), stream(0, "one"))
    assert (mean, count) == (2.0, 2) and math.isnan(low) and math.isnan(high)
    assert cluster_mean(pd.Series([math.nan]), pd.Series(["a"]), stream(0, "none"))[3] == 0


def test_cells_weigh_by_their_patches_and_cells_without_a_number_not_at_all():
    rows = pd.DataFrame({"error": [1.0, 4.0, math.nan, 9.0], "count": [1, 2, 5, 0]})
    assert weighted_mean(rows, "error") == pytest.approx(3.0)
    assert math.isnan(weighted_mean(rows[rows["error"].isna()], "error"))
