"""Course of a drive, read off its steps: settling, rise, reversals, changes of settings, limit cycles, condition."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from pipeline.control.simulation.course import COURSE, course, disturbances, reversals, rise_frames, settling_frames


def steps_of(times_ms, isos, light, policy="shim", fold=0, speed=100.0, **columns):
    """The columns of one drive that its course is read from."""
    count = len(light)
    table = {
        "policy": policy, "fold": fold, "step": range(count), "light": light, "speed_px_s": speed,
        "exposure_ms": times_ms, "iso": isos, "motion_px": np.asarray(times_ms) * 0.1, "sigma_dn": 2.0,
        "saturated_fraction": 0.0, "estimated_sigma_dn": 2.0, "estimated_motion_px": 1.0,
    }  # fmt: skip
    return pd.DataFrame(table | columns)


def one_drive(*arguments, **columns):
    (row,) = course(steps_of(*arguments, **columns)).to_dict("records")
    return row


def test_settling_is_counted_from_the_disturbance():
    stops = np.array([0.0, -4.0, -2.0, -0.1, 0.0, 0.05, 0.0])
    assert settling_frames(stops, 1, 7) == 2
    assert np.isnan(settling_frames(np.array([0.0, 1, 2, 3, 4, 5]), 0, 6))
    assert settling_frames(np.zeros(5), 0, 5) == 0


@pytest.mark.parametrize("way", [4.0, -0.5])
def test_the_rise_ends_at_nine_tenths_of_the_way_and_an_overshoot_ends_it_early(way):
    assert rise_frames(way * np.array([0.0, 0.5, 0.89, 0.91, 1.0, 1.0])) == 3
    assert rise_frames(way * np.array([0.0, 1.5, 0.8, 1.0])) == 1


def test_brightness_that_hardly_moves_has_no_rise():
    assert np.isnan(rise_frames(np.array([0.0, 0.1, 0.25])))


def test_reversals_are_turns_of_the_exposure_time_or_else_of_the_total():
    falling = np.array([16.0, 8.0, 8.0, 4.0])
    assert reversals(falling, np.ones(4)) == 0
    assert reversals(np.array([8.0, 4.0, 8.0, 8.0, 4.0]), np.ones(5)) == 2
    assert reversals(np.full(4, 8.0), np.array([1.0, 2.0, 1.0, 2.0])) == 2


def test_rates_are_per_second_of_thirty_frames():
    hunting = one_drive([8.0, 4.0] * 8, [100.0, 200.0] * 8, [1.0] * 16)
    assert hunting["writes_per_s"] == pytest.approx(30.0)
    assert hunting["reversals_per_s"] == pytest.approx(30.0 * 14 / 15)
    steady = one_drive([8.0] * 16, [100.0] * 16, [1.0] * 16)
    assert steady["writes_per_s"] == steady["reversals_per_s"] == steady["cycle_stops"] == 0.0


def test_a_limit_cycle_is_half_its_swing_and_a_ramp_is_none():
    assert one_drive([8.0, 4.0] * 6, [100.0, 200.0] * 6, [1.0] * 12)["cycle_stops"] == pytest.approx(0.5)
    swinging = one_drive([8.0] * 12, [100.0, 110.0] * 6, [1.0] * 12)
    assert swinging["cycle_stops"] == pytest.approx(np.log2(1.1) / 2)
    ramp = 2.0 ** (np.arange(12) / 10)
    assert one_drive(8.0 * ramp, [100.0] * 12, 1.0 / ramp)["cycle_stops"] == 0.0
    assert np.isnan(one_drive(8.0 * 2.0 ** np.arange(6), [100.0] * 6, [1.0] * 6)["cycle_stops"])


def test_two_settled_frames_show_no_limit_cycle_and_not_that_there_is_none():
    """Brightness that swings by a stop every second frame has a last value for two frames only."""
    assert np.isnan(one_drive([8.0, 8.0, 4.0, 4.0] * 4, [100.0] * 16, [1.0] * 16)["cycle_stops"])


def test_a_swing_before_settling_is_no_limit_cycle():
    times = [8.0, 1.0, 16.0, *[4.0] * 9]
    assert one_drive(times, [100.0] * 12, [1.0] * 12)["cycle_stops"] == 0.0


def test_drives_are_cut_at_steps_of_light_and_speed_not_at_a_ramp():
    light = [1.0, 1.0, 1.0, 0.25, 0.2, 0.15, 0.1, 0.08]
    assert disturbances(steps_of([8.0] * 8, [100.0] * 8, light)) == [0, 3]
    faster = steps_of([8.0] * 8, [100.0] * 8, [1.0] * 8, speed=[100.0] * 5 + [200.0] * 3)
    assert disturbances(faster) == [0, 5]


def test_the_rise_after_each_disturbance_counts():
    """The start is right; light falls to a sixteenth in frame 4 and the gain follows in two frames."""
    gains = [100.0] * 5 + [400.0] + [1600.0] * 6
    assert one_drive([8.0] * 12, gains, [1.0] * 4 + [1 / 16] * 8)["rise_frames"] == 2.0


def test_the_condition_is_a_mean_over_the_frames():
    times = np.array([4.0, 8.0, 8.0, 8.0])
    row = one_drive(
        times, [100.0] * 4, [1.0] * 4, sigma_dn=[1.0, 2.0, 3.0, 4.0], saturated_fraction=[0.0, 0.0, 0.1, 0.3],
        estimated_sigma_dn=[1.0, np.nan, 3.0, 4.0], estimated_motion_px=[np.nan, np.nan, 1.0, 1.0],
    )  # fmt: skip
    assert (row["motion_px"], row["sigma_dn"]) == (pytest.approx(0.7), pytest.approx(2.5))
    assert (row["saturated_percent"], row["unestimated_percent"]) == (pytest.approx(10.0), pytest.approx(50.0))


def test_every_drive_has_a_row_whatever_the_order_of_its_steps():
    tables = [steps_of([8.0, 4.0, 4.0], [100.0] * 3, [1.0] * 3, name, fold) for name in "ab" for fold in (0, 1)]
    steps = pd.concat(tables, ignore_index=True)
    rows, shuffled = course(steps), course(steps.iloc[::-1]).sort_values(["policy", "fold"], ignore_index=True)
    assert list(rows.columns) == ["policy", "fold", *COURSE] and len(rows) == 4
    pd.testing.assert_frame_equal(rows, shuffled)
