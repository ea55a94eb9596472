"""Average precision by direction, length and noise: the paper's table, and small ones by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.curves.direction import by_direction
from pipeline.curves.monotonic import rise_z, rises
from pipeline.errors import InputError
from pipeline.streams import stream

PAPER = Path(__file__).resolve().parents[2] / "data" / "paper" / "yolov7_direction_ap.csv"


def test_the_papers_table() -> None:
    rows = pd.read_csv(PAPER)
    table = by_direction(rows.sigma_dn, rows.angle_deg, rows.size_px, rows.ap_percent)
    assert table.ap_percent.shape == (6, 4, 5) and np.isfinite(table.ap_percent).all()
    assert table.ap_percent[1, 2, 3] == 39.38  # sigma 5, 90 degrees, 15 px
    # Counted in the printed table: horizontal 15 px is better than 11 px at every noise, vertical 21 px than 15 px.
    assert table.rises_with_size[:, 0, 3].all() and table.rises_with_size[:, 2, 4].all()
    by_hand = 0
    for _, group in rows.groupby(["sigma_dn", "angle_deg"]):
        by_hand += int((np.diff(group.sort_values("size_px").ap_percent) > 0).sum())
    assert table.rises_with_size.sum() == by_hand
    # Long horizontal motion is the worst direction at every noise, by 14 points and more without noise.
    assert (table.worst_angle_deg[:, 4] == 0).all()
    assert table.spread_percent[0, 4] == pytest.approx(43.57 - 27.17)
    np.testing.assert_allclose(table.mean_percent[0, 0], (50.31 + 50.83 + 50.8 + 50.89) / 4)


@given(st.permutations(range(24)))
def test_the_order_of_measurements_does_not_matter(order: list[int]) -> None:
    sigma, angle, size = (grid.ravel() for grid in np.meshgrid([0, 5], [0, 45, 90], [3, 7, 11, 15], indexing="ij"))
    precision = stream(1, "direction").uniform(0, 100, 24)
    one = by_direction(sigma, angle, size, precision)
    other = by_direction(sigma[order], angle[order], size[order], precision[order])
    np.testing.assert_array_equal(one.ap_percent, other.ap_percent)
    np.testing.assert_array_equal(one.non_monotonic, other.non_monotonic)


def test_missing_cells_are_skipped_over_and_counted_nowhere() -> None:
    table = by_direction([0, 0, 0, 0, 0], [0, 0, 0, 90, 90], [3, 7, 11, 3, 11], [50, np.nan, 51, 40, 30])
    assert table.rises_with_size[0].tolist() == [[False, False, True], [False, False, False]]
    assert np.isnan(table.spread_percent[0, 1]) and np.isnan(table.worst_angle_deg[0, 1])
    assert table.worst_angle_deg[0, 0] == 90 and table.spread_percent[0, 2] == 21


def test_a_tolerance_forgives_small_rises() -> None:
    arguments = ([0, 0, 5, 5], [0, 0, 0, 0], [3, 7, 3, 7], [50.0, 50.4, 50.2, 40.0])
    assert by_direction(*arguments).non_monotonic.sum() == 2
    assert by_direction(*arguments, tolerance=0.3).non_monotonic.sum() == 1
    assert by_direction(*arguments, tolerance=0.5).non_monotonic.sum() == 0


@given(st.lists(st.floats(0, 100), min_size=2, max_size=8))
def test_a_falling_sequence_has_no_rise_and_a_rising_one_has_all(values: list[float]) -> None:
    falling = np.sort(np.array(values))[::-1]
    assert not rises(falling, 0).any()
    rising = np.unique(np.round(values, 6))
    assert rises(rising, 0)[1:].all() and not rises(rising, 0)[0]


def test_a_rise_in_standard_errors_of_its_draws() -> None:
    precision = np.array([10.0, 13.0, np.nan, 11.0])
    draws = np.array([[10.0, 12.0, np.nan, 11.0], [10.0, 14.0, np.nan, 13.0]])
    np.testing.assert_allclose(rise_z(precision, draws, 0), [np.nan, 3.0, np.nan, -np.inf])
    np.testing.assert_allclose(rise_z(precision, draws, 0, tolerance=1.0), [np.nan, 2.0, np.nan, -np.inf])


def test_rounding_is_no_rise() -> None:
    """Means of three equal numbers may exceed them in the last digit, in resamples as well."""
    precision = np.array([50.0, 50.0, 70.0]) + np.array([0.0, 1e-14, 2e-14])
    draws = precision + np.array([[0.0, 2e-14, 0.0], [0.0, 0.0, 2e-14]])
    assert rises(precision, 0).tolist() == [False, False, True]
    np.testing.assert_array_equal(rise_z(precision, draws, 0), [np.nan, np.nan, np.inf])


def test_bad_input_is_named() -> None:
    for arguments, words in (
        (([0], [0], [3], [50, 40]), "lists of one length"),
        (([], [], [], []), "lists of one length"),
        (([0, 0], [0, 0], [3, 3], [50, 40]), "sigma 0 DN, angle 0 deg, size 3 px occurs more than once"),
        (([0], [np.nan], [3], [50]), "finite"),
        (([0], [0], [3], [101]), "0..100"),
    ):
        with pytest.raises(InputError, match=words):
            by_direction(*arguments)
