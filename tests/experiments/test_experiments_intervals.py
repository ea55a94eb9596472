"""Intervals over frames: what is resampled, that they contain the estimate, and the median below them."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from pipeline.cluster_intervals import bias_corrected, small_sample_factor
from pipeline.experiments.intervals import frame_interval, median, median_error_of_range, robust_median
from pipeline.statistics import bootstrap_interval, robust
from pipeline.streams import stream


def test_the_robust_median_is_that_of_the_statistics_module():
    generator = stream(1, "values")
    values = generator.standard_t(2, (40, 2, 3))
    values[generator.random(values.shape) < 0.1] = np.nan
    medians = robust_median(values)
    for index in np.ndindex(2, 3):
        assert medians[index] == robust(values[(slice(None), *index)], stream(1, "b"), 1).median
    assert np.isnan(robust_median(np.full((3, 2), np.nan))).all()


def test_the_median_leaves_out_what_is_no_number():
    assert median(np.array([3.0, np.nan, 1.0])) == 2.0
    assert np.isnan(median(np.empty((0, 2)))).all()


def test_resampling_whole_frames_widens_the_interval_of_correlated_patches():
    frames = np.repeat([f"f{number}" for number in range(6)], 20)
    values = np.repeat(stream(1, "of frames").normal(0, 1, 6), 20) + stream(1, "of patches").normal(0, 0.01, 120)
    low, high = frame_interval(values, frames, median, stream(1, "draws"), 200)
    of_patches = bootstrap_interval(values, stream(1, "draws"))
    assert high - low > 1.5 * (of_patches[1] - of_patches[0])
    assert low <= np.median(values) <= high


def test_the_interval_of_a_difference_reaches_below_zero():
    """Of three frames that all rise the interval, wider than their scatter, is that of the fall turned about zero."""
    rise, frames = np.array([0.02, 0.12, 0.22]), np.array(["a", "b", "c"])
    low, high = frame_interval(rise, frames, median, stream(1, "draws"), 200)
    assert frame_interval(-rise, frames, median, stream(1, "draws"), 200) == pytest.approx((-high, -low))
    assert low < 0 == frame_interval(rise, frames, median, stream(1, "draws"), 200, least=0.0)[0]


def test_one_frame_has_no_interval():
    ends = frame_interval(np.arange(20.0), np.repeat("f", 20), median, stream(1, "draws"), 50)
    assert np.isnan(ends).all()
    assert np.isnan(frame_interval(np.arange(4.0), np.array(list("aabb")), median, stream(1, "draws"), 0)).all()


def test_frames_without_an_estimate_do_not_count():
    """Of eight frames of three patches, one, two or four have estimates."""
    names = np.repeat(np.arange(8), 3)
    values = stream(1, "values").normal(0, 1, 24)
    for answering in (1, 2, 4):
        known = names < answering
        ends = frame_interval(np.where(known, values, np.nan), names, median, stream(1, "draws"), 200)
        alone = frame_interval(values[known], names[known], median, stream(1, "draws"), 200)
        assert ends == pytest.approx(alone, nan_ok=True) and np.isnan(ends).all() == (answering == 1)


def test_frames_of_different_sizes_count_with_all_their_patches_in_any_block(monkeypatch):
    values = stream(1, "values").normal(0, 1, (9, 2))
    frames = np.array(list("aaaabbccc"))

    def statistic(data):
        return np.nanmean(data, axis=(0, 2))

    whole = frame_interval(values, frames, statistic, stream(1, "draws"), 40)
    monkeypatch.setattr("pipeline.experiments.intervals._BLOCK", 1)
    assert frame_interval(values, frames, statistic, stream(1, "draws"), 40) == pytest.approx(whole)
    picks = itertools.product(range(3), repeat=3)  # three frames: all resamples
    parts = [values[frames == name] for name in "abc"]
    means = np.array([np.concatenate([parts[pick] for pick in row]).mean() for row in picks])
    assert whole == pytest.approx(bias_corrected(means, values.mean(), 3))


def test_the_interval_of_an_absolute_error_contains_it():
    """Medians of resampled patches scatter, so that their absolute error exceeds that of the median itself."""
    values, frames = stream(1, "values").normal(0, 1, (60, 40)), np.repeat(np.arange(12), 5)

    def error(data):
        return np.abs(median(data)).mean(axis=-1)

    estimate = float(error(values[:, None])[0])
    picks = stream(1, "draws").integers(12, size=(100, 12))
    resampled = [float(error(values.reshape(12, 5, 40)[row].reshape(60, 1, 40))[0]) for row in picks]
    assert np.quantile(resampled, 0.025) > estimate  # plain percentiles leave it out
    low, high = frame_interval(values, frames, error, stream(1, "draws"), 100)
    assert 0 <= low <= estimate <= high


def test_the_interval_of_what_is_never_negative_does_not_begin_below_zero():
    """Two frames, of which all resamples are few and k is large; of a signed number it may."""
    frames = np.array(["a", "b"])
    errors, differences = (
        frame_interval(np.array(values), frames, lambda data: data.mean(axis=0), stream(1, "draws"), 100, least)
        for values, least in (([0.1, 2.0], 0.0), ([0.1, 2.0], -np.inf))
    )
    assert errors[0] == 0.0 and differences[0] < -2.0 and min(errors[1], differences[1]) > 2.0


@pytest.mark.parametrize("frames", [3, 4, 8])
def test_intervals_of_few_frames_hold_the_true_value_about_as_often_as_they_claim(frames):
    """Of 400 data sets, each of `frames` frames with three patches that share half of their variance."""
    generator, names = stream(frames, "coverage"), np.repeat(np.arange(frames), 3)
    held, plain = 0, 0
    for trial in range(400):
        values = np.repeat(generator.normal(0, 1, frames), 3) + generator.normal(0, 1, 3 * frames)
        low, high = frame_interval(values, names, median, stream(trial, "draws"), 200)
        held += low <= 0 <= high
        factor, middle = small_sample_factor(frames), np.median(values)
        plain += middle + (low - middle) / factor <= 0 <= middle + (high - middle) / factor
    assert held >= 0.9 * 400 and plain < held


def test_the_error_of_a_median_follows_from_the_range():
    count, values = 150, stream(1, "normal").normal(0, 2.0, (150, 4000))
    width = (values.max(axis=0) - values.min(axis=0)).mean()
    spread = 1.96 * np.median(values, axis=0).std()
    error = median_error_of_range(np.array([width, 1.0]), np.array([count, 1]))
    assert error[0] == pytest.approx(spread, rel=0.05) and np.isnan(error[1])
