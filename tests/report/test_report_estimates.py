"""Cells with intervals: the columns a row is read from, and when a bootstrap says nothing."""

import math

import numpy as np
import pytest

from pipeline.report.estimates import bootstrapped, of_amae, of_row
from pipeline.report.tables import Estimate
from pipeline.statistics import bootstrap_interval
from pipeline.streams import stream

ROW = {"amae_percent": 5.0, "low_percent": 4.0, "high_percent": 6.5, "median_dn": 9.0, "low_dn": 8.0, "high_dn": 9.5,
       "count": 72.0}  # fmt: skip


def test_a_row_gives_its_value_and_the_interval_in_its_unit():
    assert of_row(ROW, "amae_percent") == Estimate(5.0, 4.0, 6.5)
    assert of_row(ROW, "median_dn", "dn", 70, 8.8) == Estimate(9.0, 8.0, 9.5, 70, 8.8)
    assert of_amae(ROW, 5.2) == Estimate(5.0, 4.0, 6.5, 72, 5.2)
    with pytest.raises(KeyError):
        of_row(ROW, "median_dn", "px")


def test_a_bootstrap_narrows_with_the_samples_and_is_the_streams():
    wide, narrow = (
        bootstrapped(0.0, stream(1, "samples").normal(size=count), count, stream(0, "draws", count))
        for count in (20, 2000)
    )
    assert wide.low < 0 < wide.high and narrow.high - narrow.low < (wide.high - wide.low) / 3
    samples = stream(1, "samples").random(9)
    again = bootstrap_interval(samples, stream(0, "draws"), np.mean, 500)
    assert bootstrapped(0.5, samples, 3, stream(0, "draws"), np.mean) == Estimate(0.5, *again, 3)


@pytest.mark.parametrize("samples", [[], [4.0]])
def test_fewer_than_two_samples_give_no_interval(samples):
    found = bootstrapped(4.0, samples, len(samples), stream(0, "draws"))
    assert not found.has_interval and math.isnan(found.low) and (found.value, found.count) == (4.0, len(samples))
