"""Intervals over few clusters: quantiles of Student's t, bias, bounds, and how often they hold an average precision."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binom

from pipeline.cluster_intervals import (
    ENUMERATED,
    bias_corrected,
    cluster_mean,
    critical_value,
    resamples,
    small_sample_factor,
)
from pipeline.detection.average_precision import area, evaluate
from pipeline.detection.base import Detections
from pipeline.detection.matching import GroundTruth
from pipeline.experiments.intervals import frame_interval, median
from pipeline.streams import stream


@pytest.mark.parametrize(("clusters", "t_quantile"), [(2, 12.706), (4, 3.182), (8, 2.365), (15, 2.145)])
def test_few_clusters_widen_the_interval_by_the_quantile_of_t(clusters, t_quantile):
    """Quantiles of Student's t for clusters - 1 degrees of freedom, from a printed table."""
    factor = np.sqrt(clusters / (clusters - 1)) * t_quantile / 1.95996
    assert small_sample_factor(clusters) == pytest.approx(factor, rel=1e-3)
    low, high = bias_corrected(np.arange(-50.0, 51.0), 7.0, clusters)
    assert (7.0 - low, high - 7.0) == pytest.approx((47.5 * factor, 47.5 * factor), rel=1e-3)


def test_many_clusters_are_those_of_the_normal_distribution_and_one_shows_no_scatter():
    assert critical_value(0.025, None) == pytest.approx(1.959964)
    assert critical_value(0.025, 10**7) == pytest.approx(1.959964, abs=1e-5) and small_sample_factor(None) == 1
    assert critical_value(0.025, 1) == math.inf
    assert np.isnan(bias_corrected(np.full(9, 3.0), 3.0, 1)).all()


def test_bias_is_the_median_of_the_draws_less_the_estimate():
    results = np.arange(101.0)
    assert bias_corrected(results, 40.0, None) == pytest.approx((-7.5, 87.5))
    assert bias_corrected(results, 40.0, None, bounds=(0.0, 80.0)) == (0.0, 80.0)
    assert np.isnan(bias_corrected(np.full(3, np.nan), 1.0, None)).all()


def test_a_difference_may_be_negative_although_no_resample_is():
    """Three clusters, all resampled differences above 0: that is no proof of a difference above 0."""
    low, high = bias_corrected(np.linspace(0.2, 4.0, 200), 2.1, 3)
    assert low < 0 < high


@pytest.mark.parametrize("clusters", range(1, ENUMERATED + 1))
def test_all_resamples_of_few_clusters_are_what_random_ones_tend_to(clusters):
    """Each choice once; shares of resamples by how often they hold the first cluster are those of the binomial law."""
    every = resamples(clusters, 500, stream(0, "unused"))
    assert len(np.unique(every, axis=0)) == len(every) == clusters**clusters
    share = np.bincount((every == 0).sum(axis=1), minlength=clusters + 1) / len(every)
    assert share == pytest.approx(binom.pmf(np.arange(clusters + 1), clusters, 1 / clusters))


def test_resamples_of_more_clusters_are_drawn():
    drawn = resamples(ENUMERATED + 1, 500, stream(0, "drawn"))
    assert drawn.shape == (500, ENUMERATED + 1) and set(np.unique(drawn)) == set(range(ENUMERATED + 1))
    assert not np.array_equal(drawn, resamples(ENUMERATED + 1, 500, stream(1, "drawn")))


def test_intervals_over_few_frames_do_not_depend_on_the_seed():
    """Medians of resampled frames take few values: between seeds, quantiles jumped from one to the next."""
    values = pd.Series(stream(3, "errors").gamma(2.0, 2.0, 12))
    frames = pd.Series(np.repeat(list("abcd"), 3))
    ends = {frame_interval(values.to_numpy(), frames.to_numpy(), median, stream(s, "seeds"), 500) for s in range(5)}
    assert len(ends) == 1 and len({cluster_mean(values, frames, stream(s, "seeds")) for s in range(5)}) == 1


def test_a_mean_over_clusters_has_the_interval_of_the_clusters():
    frames = pd.Series(np.repeat(np.arange(8), 50))
    values = frames.astype(float)  # patches of a frame err alike
    mean, low, high, count = cluster_mean(values, frames, stream(0, "clusters"))
    assert (mean, count) == (3.5, 400) and low < 2.1 and high > 4.9
    apart = cluster_mean(values, pd.Series(np.arange(400)), stream(0, "patches"))
    assert apart[2] - apart[1] < 0.5 * (high - low)


def test_one_cluster_gives_no_interval_and_no_value_no_mean():
    mean, low, high, count = cluster_mean(pd.Series([1.0, 3.0, math.nan]), pd.Series(list("aaa")), stream(0, "one"))
    assert (mean, count) == (2.0, 2) and math.isnan(low) and math.isnan(high)
    assert cluster_mean(pd.Series([math.nan]), pd.Series(["a"]), stream(0, "none"))[3] == 0


def test_the_interval_of_a_mean_over_clusters_keeps_within_its_bounds():
    values, frames = pd.Series([100.0, 100.0, 100.0, 90.0, 60.0]), pd.Series(list("aabbc"))
    mean, low, high, _ = cluster_mean(values, frames, stream(0, "bounds"), bounds=(0.0, 100.0))
    assert (mean, high) == (90.0, 100.0) and 0.0 <= low < 60.0
    assert cluster_mean(values, frames, stream(0, "bounds"))[2] > 100.0


def _scene(generator, present):
    """Detections of one scene, whose objects are alike hard to find; true ones score higher, scenes may be empty."""
    count = int(generator.poisson(4)) + 1 if generator.random() < present else 0
    skill = 1 / (1 + np.exp(-generator.normal(0.8, 1.0)))
    hit = generator.random(count) < skill
    wrong = int(generator.poisson(1))
    left = 20.0 * np.arange(count + wrong)[:, None]
    boxes = np.concatenate([left, 0 * left, left + 10, 0 * left + 10], axis=1)
    truth = GroundTruth(boxes[:count], np.full(count, "car"), np.zeros(count, bool))
    score = generator.normal(np.where(np.arange(count + wrong) < count, 1.5, 0.0), 1.0)
    shown = np.concatenate([hit, np.ones(wrong, bool)])
    return Detections.of(boxes[shown], score[shown], ["car"] * int(shown.sum())), truth, (hit, score, count)


def _true_precision(present):
    """Average precision over 20,000 scenes."""
    generator = stream(1, "population", present)
    parts = [_scene(generator, present)[2] for _ in range(20_000)]
    score = np.concatenate([np.concatenate([score[:count][hit], score[count:]]) for hit, score, count in parts])
    right = np.concatenate([np.arange(hit.sum() + len(score) - count) < hit.sum() for hit, score, count in parts])
    order = np.argsort(-score)
    objects = sum(count for _, _, count in parts)
    return area(right[order][None].astype(float), np.ones((1, len(order))), np.array([objects]), "paper")[0]


@pytest.mark.parametrize(("scenes", "present"), [(4, 1.0), (8, 1.0), (8, 0.5)])
def test_intervals_of_average_precision_over_few_scenes_hold_it_about_as_often_as_they_claim(scenes, present):
    """Of 200 data sets; in the last, half of the scenes hold no object."""
    true, generator, held, plain, number = _true_precision(present), stream(1, "sets", scenes, present), 0, 0, 0
    for trial in range(200):
        detections, truths, _ = zip(*(_scene(generator, present) for _ in range(scenes)), strict=True)
        result = evaluate(detections, truths, ["car"], generator=stream(trial, "draws"), draws=200)["car"]
        assert result.clusters == sum(len(truth.boxes) > 0 for truth in truths)
        if result.clusters < 2:
            assert math.isnan(result.low) and math.isnan(result.high)
            continue
        low, high = np.nanquantile(result.draws, [0.025, 0.975])
        assert 0 <= result.low <= result.average_precision <= result.high <= 1
        held, plain, number = held + (result.low <= true <= result.high), plain + (low <= true <= high), number + 1
    assert number >= 180 and held >= 0.89 * number and plain < held


def _alike_scene(generator, skill):
    """Detections of a scene with six objects, each found by this probability, and one false positive on average."""
    hit, wrong = generator.random(6) < skill, int(generator.poisson(1))
    left = 100.0 * np.arange(6 + wrong)[:, None]
    boxes = np.concatenate([left, 0 * left, left + 50, 0 * left + 50], axis=1)
    score = np.concatenate([generator.uniform(0.4, 1.0, 6), generator.uniform(0.0, 0.7, wrong)])
    shown = np.concatenate([hit, np.ones(wrong, bool)])
    truth = GroundTruth(boxes[:6], np.full(6, "car"), np.zeros(6, bool))
    return Detections.of(boxes[shown], score[shown], ["car"] * int(shown.sum())), truth


@pytest.mark.parametrize(("skill", "scenes", "share"), [(0.97, 4, 0.75), (0.5, 8, 0.93), (0.05, 4, 0.74)])
def test_intervals_of_average_precision_hold_it_less_often_near_0_and_100_percent(skill, scenes, share):
    """The shares that the module states of an average precision of 95, 48 and 4 %."""
    generator = stream(2, "sets", skill, scenes)
    results = []
    for trial in range(200):
        detections, truths = zip(*(_alike_scene(generator, skill) for _ in range(scenes)), strict=True)
        results.append(evaluate(detections, truths, ["car"], generator=stream(trial, "draws"), draws=200)["car"])
    detections, truths = zip(*(_alike_scene(generator, skill) for _ in range(3000)), strict=True)
    true = evaluate(detections, truths, ["car"])["car"].average_precision
    held = np.mean([result.low <= true <= result.high for result in results])
    assert held == pytest.approx(share, abs=0.07)


@pytest.mark.parametrize("detected", [True, False])
def test_an_interval_of_scenes_that_are_all_alike_has_no_width(detected):
    """Nothing or everything is found in each: the docstring warns that this is no certainty."""
    boxes, words = np.array([[0.0, 0.0, 10.0, 10.0]]), np.array(["car"])
    seen = Detections.of(boxes, np.ones(1), ["car"]) if detected else Detections.none()
    truth = GroundTruth(boxes, words, np.zeros(1, bool))
    result = evaluate([seen] * 8, [truth] * 8, ["car"], generator=stream(0, "draws"))["car"]
    assert (result.low, result.average_precision, result.high) == (float(detected),) * 3
