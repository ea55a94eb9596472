"""From detections to curves: known averages, draws that belong together, tuples, surfaces and metrics."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from sweep_makers import FRAMES, LEVELS, SIZES, sweep_tables

from pipeline.cluster_intervals import small_sample_factor
from pipeline.curves import Surface, directions, precision
from pipeline.curves.cells import precision_interval
from pipeline.errors import InputError
from pipeline.streams import stream

JUDGE = SimpleNamespace(
    rule="paper", iou_threshold=0.5, min_height_px=25, min_visible_fraction=0.3, bootstrap_draws=200
)
SECTION = SimpleNamespace(
    average_directions=True,
    sigma_bins_dn=[0, 5, 10, 15, 20, 25],
    mtf_bins=[0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0],
    tolerance_percent=0.0,
)


@pytest.fixture(scope="module")
def judged() -> tuple[pd.DataFrame, dict[str, np.ndarray]]:
    return precision.average_precision(*sweep_tables(), ["car", "person"], JUDGE, 1)


def test_percent_are_the_share_of_cars_found(judged: tuple[pd.DataFrame, dict[str, np.ndarray]]) -> None:
    table, draws = judged
    cars = table[table["label"] == "car"]
    assert len(cars) == 9 * 3 and list(draws) == ["car", "person"] and draws["car"].shape == (27, 200)
    np.testing.assert_allclose(cars["ap_percent"], 100.0 * cars["true_positives"] / FRAMES)  # none is wrong
    assert (cars["objects"] == FRAMES).all() and (cars["objects_ignored"] == FRAMES).all()
    sharp = cars[(cars["kernel_size_px"] == 0) & (cars["target_sigma_dn"] == 0)].iloc[0]
    assert sharp[["ap_percent", "low_percent", "high_percent"]].tolist() == pytest.approx([100.0] * 3)
    assert (cars["low_percent"] <= cars["ap_percent"]).all() and (cars["ap_percent"] <= cars["high_percent"]).all()
    nobody = table[table["label"] == "person"]
    assert nobody["ap_percent"].isna().all() and np.isnan(draws["person"]).all()


def test_draws_of_all_conditions_resample_the_same_frames(judged: tuple[pd.DataFrame, dict[str, np.ndarray]]) -> None:
    """A car found under a stronger condition is found under every milder one: so it is in each single draw."""
    table, draws = judged
    cars = table[table["label"] == "car"].reset_index(drop=True)
    order = cars["ap_percent"].to_numpy().argsort()
    assert (np.diff(draws["car"][order], axis=0) >= -1e-9).all()
    assert draws["car"][order[13]].std() > 3  # and there is something to resample


def test_scenes_are_resampled_together() -> None:
    """Twelve frames of three scenes are three samples: the interval widens."""
    few, _ = precision.average_precision(*sweep_tables(scenes=3), ["car"], JUDGE, 1)
    many, _ = precision.average_precision(*sweep_tables(), ["car"], JUDGE, 1)
    width = [(table["high_percent"] - table["low_percent"]).mean() for table in (few, many)]
    assert width[0] > 1.7 * width[1]  # 1.3 as quantiles, more by Student's t, although cut at 0 and 100
    assert (few["scenes"] == 3).all() and (many["scenes"] == FRAMES).all()
    assert few["ap_percent"].equals(many["ap_percent"])


def test_a_frame_that_was_not_looked_at_is_no_empty_frame() -> None:
    detections, looked, objects, medians = sweep_tables()
    with pytest.raises(InputError, match="frames are missing"):
        precision.average_precision(detections, looked.iloc[:-1], objects, medians, ["car"], JUDGE, 1)


def test_tuples_are_means_over_directions(judged: tuple[pd.DataFrame, dict[str, np.ndarray]]) -> None:
    table, draws = judged
    cars = table[table["label"] == "car"]
    points, drawn = precision.tuples(cars, draws["car"], True)
    assert len(points) == len(drawn) == len(SIZES) * len(LEVELS)
    cell = (cars["kernel_size_px"] == 21) & (cars["target_sigma_dn"] == 10)
    point = points[(points["kernel_size_px"] == 21) & (points["target_sigma_dn"] == 10)]
    assert point["ap_percent"].item() == pytest.approx(cars.loc[cell, "ap_percent"].mean())
    assert point["mtf"].item() == pytest.approx(0.3)
    np.testing.assert_allclose(drawn[point.index[0]], draws["car"][cell.to_numpy()].mean(axis=0))
    apart, same = precision.tuples(cars, draws["car"], False)
    assert len(apart) == len(cars) and same is draws["car"]


def test_the_surface_answers_where_it_was_measured_and_comes_back_from_its_file(
    judged: tuple[pd.DataFrame, dict[str, np.ndarray]], tmp_path
) -> None:
    table, draws = judged
    cars = table[table["label"] == "car"]
    surface = precision.surface(cars, draws["car"], SECTION, 1)
    points, _ = precision.tuples(cars, draws["car"], True)
    for point in points.to_dict("records"):
        assert surface.at(point["sigma_dn"], point["mtf"])[0] == pytest.approx(point["ap_percent"], abs=1e-9)
    between, low, high = surface.at(5.0, 0.9)
    assert low <= between <= high and 60 < between < 100
    with pytest.raises(InputError, match="not extrapolated"):
        surface.at(35.0, 0.9)
    surface.save(tmp_path / "s.npz")
    again = Surface.load(tmp_path / "s.npz")
    assert again.at(5.0, 0.9) == (between, low, high) and again.scenes == surface.scenes == FRAMES
    cells = precision.heat("car", surface, 0.0, objects=8)
    assert (cells["count"] > 0).sum() == 15 and not cells["non_monotonic"].any()
    with pytest.raises(InputError, match="no object"):
        precision.surface(table[table["label"] == "person"], draws["person"], SECTION, 1)


def test_every_class_has_its_curves_and_the_reason_why_it_has_no_surface(
    judged: tuple[pd.DataFrame, dict[str, np.ndarray]], tmp_path
) -> None:
    table, draws = judged
    renamed = table.assign(label=table["label"].replace("car", "traffic light"))
    curves = precision.label_curves(renamed, {"traffic light": draws["car"], "person": draws["person"]}, SECTION, 1)
    alone = precision.surface(table[table["label"] == "car"], draws["car"], SECTION, 1)
    assert list(curves.surfaces) == ["traffic light"] and "no object" in curves.refused["person"]
    assert curves.surfaces["traffic light"].at(5.0, 0.9) == alone.at(5.0, 0.9)
    assert set(curves.heat["label"]) == {"traffic light"} == set(curves.isolated["label"])
    curves.save_surfaces(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["surface-traffic_light.npz"]
    nothing = precision.label_curves(table, {"person": draws["person"]}, SECTION, 1)
    assert nothing.heat.empty and list(nothing.heat.columns) == list(precision.HEAT.columns)


def test_isolated_curves_hold_one_effect(judged: tuple[pd.DataFrame, dict[str, np.ndarray]]) -> None:
    table, draws = judged
    lines = precision.curves("car", table[table["label"] == "car"], draws["car"], SECTION, 1)
    noise, blur = (lines[lines["quantity"] == name] for name in ("sigma_dn", "mtf"))
    assert noise["quantity_value"].tolist() == list(LEVELS) and noise["ap_percent"].is_monotonic_decreasing
    assert (
        blur["quantity_value"].tolist() == pytest.approx([0.3, 1 - 14 / 30, 1 - 7 / 30, 0.9, 1.0])
        and blur["ap_percent"].is_monotonic_increasing
    )
    assert noise["ap_percent"].iloc[0] == blur["ap_percent"].iloc[-1] == 100.0


def test_surface_curves_and_directions_are_wider_for_few_scenes(
    judged: tuple[pd.DataFrame, dict[str, np.ndarray]],
) -> None:
    """The same draws, said to be of 12 scenes and of 3: k is 1.17 and 2.69."""
    table, draws = judged
    cars = table[table["label"] == "car"].reset_index(drop=True)
    widths = []
    for scenes in (12, 3):
        rows = cars.assign(scenes=scenes)
        _, low, high = precision.surface(rows, draws["car"], SECTION, 1).at(5.0, 0.9)
        point = precision.curves("car", rows, draws["car"], SECTION, 1).iloc[1]
        heat = precision.heat("car", precision.surface(rows, draws["car"], SECTION, 1), 0.0, objects=8)
        (cell,) = heat[(heat["sigma_bin_dn"] == 10) & (heat["mtf_bin"] == 0.5)].to_dict("records")
        spread = directions.tables(rows, draws["car"], 0.0)[1].iloc[-1]
        parts = [point, cell, spread]
        widths.append([high - low, *(part["high_percent"] - part["low_percent"] for part in parts)])
    assert (np.array(widths[1]) > 1.4 * np.array(widths[0])).all()  # the bounds 0 and 100 cut some of it


@pytest.mark.filterwarnings("error")
def test_one_scene_has_averages_but_no_interval_and_no_certain_rise() -> None:
    table, draws = precision.average_precision(*sweep_tables(scenes=1), ["car"], JUDGE, 1)
    assert (table["scenes"] == 1).all() and table["ap_percent"].notna().all()
    assert table[["low_percent", "high_percent"]].isna().all(axis=None)
    surface = precision.surface(table, draws["car"], SECTION, 1)
    value, low, high = surface.at(5.0, 0.9)
    assert 0 < value < 100 and np.isnan([low, high]).all() and not surface.certainly_non_monotonic().any()


def test_unknown_draws_are_left_out_of_the_interval_of_scenes_only() -> None:
    draws = np.append(np.linspace(40.0, 60.0, 99), np.nan)
    assert np.isfinite(precision_interval(draws, 50.0, 20)).all()
    assert np.isnan(precision_interval(draws, 50.0)).all()
    assert np.isnan(precision_interval(draws[-1:], 50.0, 20)).all() and np.isnan(precision_interval(draws, 50, 1)).all()


def test_direction_is_told_apart_and_rises_are_marked(judged: tuple[pd.DataFrame, dict[str, np.ndarray]]) -> None:
    table, draws = judged
    cars = table[table["label"] == "car"].reset_index(drop=True)
    rows, spread = directions.tables(cars, draws["car"], 0.0)
    assert len(rows) == 4 * 2 * 3 and not (rows["rises_with_size"] | rows["rises_with_sigma"]).any()
    wide = spread[spread["kernel_size_px"] >= 14]
    assert (wide["worst_angle_deg"] == 90).all() and (wide["spread_percent"] > 0).all()
    numbers = {(row.target_sigma_dn, row.kernel_size_px): row for row in spread.itertuples()}
    for (level, size), row in numbers.items():
        chosen = (cars["target_sigma_dn"] == level) & (cars["kernel_size_px"] == size)
        is_chance = row.spread_percent <= directions.chance(draws["car"][chosen.to_numpy()], FRAMES)
        assert not is_chance or row.low_percent == 0
    assert (spread["low_percent"] <= spread["high_percent"]).all()
    assert (spread["mean_low_percent"] <= spread["mean_percent"]).all()
    assert (spread["mean_percent"] <= spread["mean_high_percent"]).all()
    better = cars.copy()
    here = (better["kernel_size_px"] == 21) & (better["angle_deg"] == 0) & (better["target_sigma_dn"] == 10)
    better.loc[here, "ap_percent"] = 99.0
    rows, _ = directions.tables(better, draws["car"], 0.0)
    marked = rows[rows["rises_with_size"]]
    assert marked[["target_sigma_dn", "angle_deg", "kernel_size_px"]].to_numpy().tolist() == [[10.0, 0.0, 21.0]]
    unblurred = cars[cars["kernel_size_px"] == 0]  # of a sweep of noise alone
    nothing = directions.of_labels(unblurred, {"car": draws["car"][:3]}, 0.0)
    assert [len(part) for part in nothing] == [0, 0] and list(nothing[1].columns) == list(spread.columns)


def test_directions_without_an_effect_are_rarely_told_apart() -> None:
    """Of 300 sets of 16 scenes that four directions lose by chance: 2.5 % would exceed what chance makes of them."""
    generator, exceeding = stream(3, "directions"), 0
    for _ in range(300):
        scenes = 60 + 10 * generator.normal(size=(4, 16))
        resampled = scenes[:, generator.integers(0, 16, (400, 16))].mean(axis=2)
        spread = np.ptp(scenes.mean(axis=1))
        assert spread > 0
        exceeding += spread > directions.chance(resampled, 16)
    assert exceeding <= 0.05 * 300
    assert directions.chance(np.full((4, 9), 50.0), 8) == 0
    apart = np.linspace(-1.0, 1.0, 2001)  # two directions that err oppositely: their range is evenly spread over 0..2
    assert directions.chance(50.0 + np.stack([apart, -apart]), 8) == pytest.approx(1.95 * small_sample_factor(8))
    assert np.isinf(directions.chance(np.full((4, 9), 50.0), 1))


def test_a_spread_that_chance_may_make_begins_at_nothing() -> None:
    """Two directions of 52 and 48 %, the better of which changes from draw to draw: the spread is 4 in each of them."""
    rows = pd.DataFrame(
        {"label": "car", "target_sigma_dn": 0.0, "angle_deg": [0.0, 90.0], "kernel_size_px": 7.0, "scenes": 8,
         "ap_percent": [52.0, 48.0], "low_percent": 40.0, "high_percent": 60.0}
    )  # fmt: skip
    turns = np.where(stream(1, "spread").random(200) < 0.5, 2.0, -2.0)
    _, spread = directions.tables(rows, 50 + np.stack([turns, -turns]), 0.0)
    assert spread["spread_percent"].item() == pytest.approx(4.0)
    assert (spread["low_percent"].item(), spread["high_percent"].item()) == pytest.approx((0.0, 4.0))
    _, certain = directions.tables(rows, np.array([[52.0], [48.0]]) + turns / 2, 0.0)  # both change alike
    assert certain["low_percent"].item() == pytest.approx(4.0)


def test_a_rise_needs_objects_by_the_square_of_what_it_lacks(
    judged: tuple[pd.DataFrame, dict[str, np.ndarray]],
) -> None:
    """Standard errors fall with the root of the number of objects."""
    table, draws = judged
    cars = table[table["label"] == "car"].reset_index(drop=True)
    better = cars.copy()
    here = (better["kernel_size_px"] == 7) & (better["target_sigma_dn"] == 20)
    better.loc[here, "ap_percent"] = 80.0
    surface = precision.surface(better, draws["car"], SECTION, 1)
    cells = precision.heat("car", surface, 0.0, objects=8)
    rising = cells["non_monotonic"].to_numpy()
    certainty = surface.certainty(0.0).ravel()
    assert rising.any() and (certainty[rising] > 0).all()
    assert cells["objects_needed"][rising].to_numpy() == pytest.approx(8 / certainty[rising] ** 2)
    assert cells["objects_needed"][~rising].isna().all()


def test_objects_too_low_or_too_hidden_are_ignored() -> None:
    box = {"frame": "f", "label": "car", "x1": 0.0, "y1": 0.0, "x2": 50.0, "ignore": False}
    objects = pd.DataFrame(
        [{**box, "y2": y2, "visible_fraction": share} for y2, share in ((40, 1.0), (20, 1.0), (40, 0.2), (40, np.nan))]
    )
    (truth, nothing) = precision.truths(objects, ["f", "g"], 25.0, 0.3)
    assert truth.ignore.tolist() == [False, True, True, False] and len(nothing.label) == 0


def test_metrics_name_the_clean_value_and_the_surface(judged: tuple[pd.DataFrame, dict[str, np.ndarray]]) -> None:
    table, draws = judged
    cars = table[table["label"] == "car"]
    result = precision.metrics(table, {"car": precision.surface(cars, draws["car"], SECTION, 1)})
    assert result["car"]["clean_ap_percent"] == 100.0 and result["car"]["bins"] == 15
    assert "person" not in result  # a class without an object has nothing to watch
    assert precision.metrics(table, {})["car"]["bins"] == 0


@pytest.mark.parametrize("swept", ["kernel_size_px", "target_sigma_dn"])
def test_metrics_have_no_clean_value_where_no_clean_condition_was_swept(
    judged: tuple[pd.DataFrame, dict[str, np.ndarray]], swept: str
) -> None:
    table, _ = judged
    corrupted = table[table[swept] > 0]
    result = precision.metrics(corrupted, {})["car"]
    assert "clean_ap_percent" not in result
    assert result["mean_ap_percent"] == corrupted.loc[corrupted["label"] == "car", "ap_percent"].mean()


def test_an_effect_outside_the_bins_has_no_curve_and_the_other_keeps_its_own(
    judged: tuple[pd.DataFrame, dict[str, np.ndarray]],
) -> None:
    table, draws = judged
    bins = {**vars(SECTION), "sigma_bins_dn": [40, 45, 50]}
    lines = precision.curves("car", table[table["label"] == "car"], draws["car"], SimpleNamespace(**bins), 1)
    assert set(lines["quantity"]) == {"mtf"} and len(lines) == 5
