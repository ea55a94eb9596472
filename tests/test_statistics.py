"""Robust statistics: the paper's outlier rule, intervals that cover, abstentions that are counted."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.statistics import bootstrap_interval, inliers, robust
from pipeline.streams import stream

numbers = st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=40)


def test_outliers_are_rejected_and_counted():
    result = robust([1.0, 1.1, 0.9, 1.05, 0.95, 50.0, np.nan], stream(0, "test"))
    assert (result.count, result.rejected, result.abstained) == (6, 1, 1)
    assert result.maximum == 1.1


def test_zero_mad_falls_back_to_one():
    assert inliers([2.0, 2.0, 2.0, 2.5, 9.0]).tolist() == [True, True, True, True, False]


def test_about_five_percent_or_fewer_of_normal_values_go():
    values = stream(0, "test").standard_normal(20_000)
    assert 0.01 < 1 - inliers(values).mean() < 0.05


def test_all_abstained_is_nan_not_zero():
    result = robust([np.nan, np.nan], stream(0, "test"))
    assert np.isnan(result.median)
    assert (result.count, result.abstained) == (0, 2)


@given(numbers, st.floats(0.1, 10), st.floats(-100, 100))
def test_statistics_move_with_the_values(values, factor, shift):
    one = robust(values, stream(0, "test"), draws=20)
    assert one.minimum <= one.low <= one.high <= one.maximum or np.isnan([one.low, one.high]).all()
    assert one.minimum <= one.median <= one.maximum
    permuted = robust(values[::-1], stream(0, "test"), draws=20)
    assert permuted.median == one.median


def test_interval_covers_the_truth_about_95_times_in_100():
    hits = 0
    for trial in range(200):
        low, high = bootstrap_interval(stream(trial, "test").normal(3.0, 1.0, 80), stream(trial, "boot"), draws=300)
        hits += low <= 3.0 <= high
    assert 180 <= hits <= 200


@pytest.mark.parametrize(("level", "normals"), [(0.95, 1.96), (0.5, 0.674)])
def test_an_interval_is_as_wide_as_its_level_says(level, normals):
    values = stream(0, "level").normal(3.0, 1.0, 400)
    low, high = bootstrap_interval(values, stream(0, "boot"), np.mean, 4000, level)
    assert (high - low) / 2 == pytest.approx(normals * values.std() / 20, rel=0.06)


@pytest.mark.parametrize(
    ("values", "expected"), [([], np.nan), ([2.0], np.nan), ([np.nan, 2.0], np.nan), ([2.0, 2.0], 2.0)]
)
def test_fewer_than_two_values_do_not_show_how_they_scatter(values, expected):
    assert np.array_equal(bootstrap_interval(values, stream(0, "test")), (expected, expected), equal_nan=True)
