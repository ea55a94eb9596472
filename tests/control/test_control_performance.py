"""The surface as a controller asks it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from control_makers import (
    CAMERA,
    SIZES,
    darker_performance,
    formula_ap,
    performance,
    performance_of_three_levels,
)

from pipeline.cluster_intervals import small_sample_factor
from pipeline.control.performance import LEVEL_SLACK_STOPS, Performance, monotonic
from pipeline.control.precision.expected_precision import expected_at
from pipeline.control.precision.prediction import predict
from pipeline.control.state import CameraState
from pipeline.curves.surface import Surface
from pipeline.errors import InputError


def test_performance_equals_the_measured_points_and_is_refused_outside():
    known = performance()
    sigma = np.array([1.0, 6.0, 21.0, 41.0])
    result = known.expected(sigma[:, None], SIZES[None])
    np.testing.assert_allclose(result.ap_percent, formula_ap(sigma[:, None], SIZES[None]), atol=1.0)
    assert (result.low <= result.ap_percent + 1e-9).all() and (result.high >= result.ap_percent - 1e-9).all()
    assert np.isnan(known.expected([42.0, 5.0], [3.0, 32.0]).ap_percent).all()
    assert known.expected(0.0, 3.0).ap_percent == known.expected(1.0, 3.0).ap_percent  # less noise than was measured
    assert known.excess(20.0, 10.0) == 0 and known.excess(82.0, 10.0) == pytest.approx(1.0)


def test_performance_is_the_surface_between_its_points():
    known = performance()
    from pipeline.control.motion import motion_mtf

    for sigma, motion in ((8.3, 5.2), (17.0, 13.0), (33.3, 25.0)):
        direct = known.surface.at(sigma, float(motion_mtf(motion, known.reference, 0)))[0]
        assert float(known.expected(sigma, motion).ap_percent) == pytest.approx(direct, abs=1.5)


def test_performance_saved_is_the_same(tmp_path):
    known = performance()
    known.save(tmp_path / "surface.npz")
    again = Performance.load(tmp_path / "surface.npz")
    np.testing.assert_array_equal(
        again.expected([5, 12], [1, 9]).ap_percent, known.expected([5, 12], [1, 9]).ap_percent
    )
    np.savez(tmp_path / "other.npz", reference=np.ones(3))
    with pytest.raises(InputError, match="control_surface"):
        Performance.load(tmp_path / "other.npz")


def test_performance_never_rises_with_noise_or_motion():
    rough = np.array([[90.0, 95.0, 70.0], [93.0, 80.0, np.nan], [60.0, 65.0, 50.0]])
    smooth = monotonic(rough)
    assert np.isnan(smooth[1, 2]) and np.isfinite(smooth).sum() == 8
    for axis in (0, 1):
        steps = np.diff(smooth, axis=axis)
        assert (steps[np.isfinite(steps)] < 0).all()
    falling = 90.0 - 5.0 * np.add.outer(np.arange(4.0), np.arange(3.0))
    np.testing.assert_allclose(monotonic(falling), falling, atol=0.02)


def test_performance_between_brightnesses_is_mixed_and_beyond_them_refused():
    known = darker_performance(-6.0)
    bright, dark = (float(known.expected(5.0, 3.0, level).ap_percent) for level in (0.5, 0.25))
    assert bright - dark == pytest.approx(6.0, abs=0.2)
    between = float(known.expected(5.0, 3.0, 0.5 / np.sqrt(2)).ap_percent)
    assert between == pytest.approx((bright + dark) / 2, abs=0.1)
    assert float(known.expected(5.0, 3.0, 0.55).ap_percent) == bright  # within the slack
    assert np.isnan(known.expected(5.0, 3.0, [0.7, 0.15]).ap_percent).all()
    assert known.expected([[2.0], [5.0]], [1.0, 3.0, 9.0], 0.4).ap_percent.shape == (2, 3)
    assert (
        float(performance().expected(5.0, 3.0, 0.9).ap_percent) == bright
    )  # one brightness: the level is not regarded


def test_performance_with_darker_ones_is_saved_whole(tmp_path):
    known = darker_performance(4.0)
    known.save(tmp_path / "surface.npz")
    again = Performance.load(tmp_path / "surface.npz")
    assert [other.level for other in again.darker] == [0.25] and again.darkest_level == 0.25
    np.testing.assert_array_equal(
        again.expected([5, 12], [1, 9], [0.3, 0.4]).ap_percent, known.expected([5, 12], [1, 9], [0.3, 0.4]).ap_percent
    )
    np.testing.assert_array_equal(again._table, known._table)
    with pytest.raises(InputError, match="table of shape"):
        Performance(known.surface, known.reference, 0, 31.0, table=np.zeros((3, 2, 2)))
    with pytest.raises(InputError, match="darker"):
        Performance(known.surface, known.reference, 0, 31.0, 0.25, [performance()])


def test_performance_without_interval_is_the_same():
    sigma, motion, level = (
        np.array([0.5, 7.0, 39.0, 60.0]),
        np.array([0.0, 8.0, 30.0, 3.0]),
        np.array([0.5, 0.3, 0.4, 0.5]),
    )
    for known in (performance(), darker_performance(4.0)):
        for at in (None, level):
            expected = known.expected(sigma, motion, at).ap_percent
            np.testing.assert_array_equal(known.ap_percent(sigma, motion, at), expected)


def test_performance_of_a_file_is_not_tabulated_again(tmp_path, monkeypatch):
    performance().save(tmp_path / "surface.npz")
    monkeypatch.setattr(Performance, "_tabulated", lambda self: pytest.fail("tabulated again"))
    assert float(Performance.load(tmp_path / "surface.npz").expected(5.0, 3.0).ap_percent) > 50.0


def test_performance_estimates_of_noise_are_calibrated():
    bright = performance()
    known = Performance(bright.surface, bright.reference, 0, 31.0, calibration=[[0.9, 4.3, 9.0], [1.4, 5.0, 10.0]])
    np.testing.assert_allclose(known.true_sigma_dn([0.9, 4.3, 9.0, 2.6]), [1.4, 5.0, 10.0, 3.2])
    np.testing.assert_allclose(known.true_sigma_dn([0.45, 18.0]), [0.7, 20.0])
    np.testing.assert_allclose(bright.true_sigma_dn([0.3, 7.0]), [0.3, 7.0])
    with pytest.raises(InputError, match="calibration"):
        Performance(bright.surface, bright.reference, 0, 31.0, calibration=[[2.0, 1.0], [1.0, 2.0]])


def dead_corner(scenes=None):
    """A surface on which nothing is found in strong noise, and every draw scatters by 10 points."""
    bright = performance()
    cells = bright.surface.cells
    ap = np.clip(cells.ap_percent - 40.0, 0.0, 100.0)
    draws = np.clip(ap + np.linspace(-10, 10, 41)[:, None, None], 0.0, 100.0)
    surface = Surface(replace(cells, ap_percent=ap, draws=draws), scenes=scenes)
    return Performance(surface, bright.reference, 0, 31.0)


def test_performance_lies_in_0_to_100_and_ranks_where_nothing_is_detected():
    known = dead_corner()
    sigma, motion = np.linspace(0, 41, 60)[:, None], np.linspace(0, 31, 60)[None]
    for values in (*known.expected(sigma, motion), known.ap_percent(sigma, motion)):
        assert values.min() >= 0.0 and values.max() <= 100.0 and not np.signbit(values).any()
    assert known.ap_percent(sigma, motion).min() == 0.0
    ranking = known.ranking(sigma, motion)
    assert (np.diff(ranking[5:], axis=0) < 0).all() and (np.diff(ranking, axis=1) < 0).all()
    inside = ranking > 0
    np.testing.assert_array_equal(known.ap_percent(sigma, motion)[inside], ranking[inside])


def test_performance_of_few_viewpoints_is_less_certain(tmp_path):
    widths = {}
    for scenes in (None, 66, 8, 4):
        known = dead_corner(scenes)
        _, low, high = known.expected(6.0, 3.0)
        widths[scenes] = float(high - low)
        known.save(tmp_path / "surface.npz")
        again = Performance.load(tmp_path / "surface.npz")
        assert again.surface.scenes == scenes
        assert Performance(again.surface, again.reference, 0, 31.0).expected(6.0, 3.0) == known.expected(6.0, 3.0)
    for scenes, other in ((4, 8), (8, 66)):
        ratio = small_sample_factor(scenes) / small_sample_factor(other)
        assert widths[scenes] / widths[other] == pytest.approx(ratio, rel=0.02)
    assert widths[66] == pytest.approx(widths[None] * small_sample_factor(66), rel=0.02)


def test_performance_of_an_older_file_is_read_as_it_was_written(tmp_path):
    known, path = darker_performance(2.0), tmp_path / "surface.npz"
    known.save(path)
    arrays = dict(np.load(path))
    assert {name for name in arrays if name.endswith("scenes")} == {"scenes", "darker0_scenes"}
    np.savez(path, **{name: values for name, values in arrays.items() if not name.endswith("scenes")})
    again = Performance.load(path)
    assert again.surface.scenes is None
    np.testing.assert_array_equal(again.expected(5.0, 3.0, 0.3), known.expected(5.0, 3.0, 0.3))
    np.savez(path, **{**arrays, "darker0_scenes": np.float64(2.5)})
    with pytest.raises(InputError, match=r"surface.npz: array 'scenes': expected a count"):
        Performance.load(path)


def test_estimates_of_noise_stand_for_those_of_frames_as_dark():
    """The monitor reads 10 DN as 8 in bright frames and as 12 in frames of a quarter of their level."""
    bright = performance()
    calibrations = {0.5: [[8.0], [10.0]], 0.125: [[12.0], [10.0]]}
    dark, light = (
        Performance(bright.surface, bright.reference, 0, 31.0, level, calibration=calibrations[level])
        for level in (0.125, 0.5)
    )
    known = Performance(bright.surface, bright.reference, 0, 31.0, 0.5, [dark], light.calibration)
    assert float(known.true_sigma_dn(8.0)) == pytest.approx(10.0)
    assert float(known.true_sigma_dn(8.0, 0.5)) == pytest.approx(10.0)
    assert float(known.true_sigma_dn(12.0, 0.125)) == pytest.approx(10.0)
    np.testing.assert_allclose(known.true_sigma_dn([8.0, 12.0], 0.25), [(10 + 20 / 3) / 2, (15 + 10) / 2])
    for level, nearest in ((0.9, 0.5), (0.01, 0.125)):
        assert float(known.true_sigma_dn(6.0, level)) == pytest.approx(float(known.true_sigma_dn(6.0, nearest)))


def test_performance_of_a_frame_brighter_than_the_surface_is_that_of_the_brightest():
    """Of a picture there is; control refuses to go there."""
    known = darker_performance(-6.0)
    assert expected_at(known, 5.0, 3.0, 0.9) == expected_at(known, 5.0, 3.0, 0.5)
    assert expected_at(known, 5.0, 3.0, 0.25).ap_percent == pytest.approx(
        expected_at(known, 5.0, 3.0, 0.5).ap_percent - 6.0, abs=0.2
    )


def test_a_frame_is_predicted_no_brighter_than_white():
    state = CameraState.of(4, 100)
    at = predict(CAMERA.formation, 3.0, 2.0, 0.25, state, [state, CameraState.of(8, 100), CameraState.of(32, 800)])
    assert at.level == pytest.approx(np.array([0.25, 0.5, 1.0]) ** (1 / CAMERA.formation.gamma))
    assert at.motion_px == pytest.approx([2.0, 4.0, 16.0])


def test_performance_a_condition_is_as_far_outside_as_its_brightness_was_measured():
    """Of noise half as much was measured in the dark; brightness beyond the measured one counts in stops."""
    known = performance_of_three_levels()
    bright, dark = known.most_sigma_dn, known.darker[0].most_sigma_dn
    assert (bright, dark) == (41.0, 21.0)
    noise = np.array([20.0, 30.0, 42.0])
    np.testing.assert_allclose(known.excess(noise, 0.0, 0.5), np.maximum(noise / bright - 1, 0))
    np.testing.assert_allclose(known.excess(noise, 0.0, [0.3, 0.2, 0.18]), np.maximum(noise / dark - 1, 0))
    np.testing.assert_allclose(known.excess(noise, 0.0, 0.4), np.maximum(noise / dark - 1, 0))  # the nearer refuses
    slack = 2.0**LEVEL_SLACK_STOPS
    np.testing.assert_allclose(known.excess(20.0, 0.0, np.array([0.18, 0.09, 0.045]) / slack), [0, 1, 2], atol=1e-9)
    np.testing.assert_allclose(known.excess(20.0, 62.0, 0.25), 1.0)
    refused = np.isnan(known.ap_percent(noise, 0.0, [0.5, 0.3, 0.05]))
    np.testing.assert_array_equal(refused, known.excess(noise, 0.0, [0.5, 0.3, 0.05]) > 0)
    np.testing.assert_array_equal(known.excess(noise, 33.0), performance().excess(noise, 33.0))
