"""From patches to a frame: robust medians, intervals that do not shrink with the number of patches, MTF50."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.camera import mtf
from pipeline.condition.summary import (
    at_most_dn,
    half_contrast,
    most_noise_dn,
    noise_parts,
    summarise,
    summarise_noise,
    with_upper_end,
)
from pipeline.noise.base import ALTERNATING, BEYOND, COMPRESSED, STREAKED, UNCERTAIN, NoiseEstimate
from pipeline.streams import stream


def test_outliers_are_left_out_and_abstentions_counted():
    values = np.concatenate([stream(0, "summary").normal(10.0, 0.5, 95), np.full(5, 200.0), np.full(7, np.nan)])
    summary = summarise(values)
    assert abs(float(summary.value) - 10.0) < 0.2
    assert summary.greatest < 15
    assert (int(summary.count), int(summary.abstained)) == (100, 7)
    assert int(summary.rejected) >= 5
    assert summary.low <= summary.value <= summary.high


def test_predictive_intervals_stay_as_wide_however_many_patches():
    widths = []
    for count in (10, 1000):
        values = stream(0, "summary width").normal(5.0, 0.1, count)
        summary = summarise(values, values - 1.0, values + 1.0)
        widths.append(float(summary.high - summary.low))
        bootstrap = summarise(values)
        assert bootstrap.high - bootstrap.low < 0.2
    assert widths == pytest.approx([2.0, 2.0], abs=0.1)


def test_each_frequency_is_summarised_on_its_own():
    values = np.tile(np.linspace(1, 0.1, 8), (20, 2, 1))
    values[:, 1] *= 0.5
    values[:3] = np.nan
    summary = summarise(values)
    assert summary.value.shape == (2, 8)
    assert np.allclose(summary.value, values[-1])
    assert (summary.abstained == 3).all()


def test_nothing_known_is_nan_not_zero():
    for values in (np.empty((0, 2, 8)), np.full((4, 2, 8), np.nan)):
        summary = summarise(values)
        assert np.isnan(summary.value).all()
        assert np.isnan(summary.low).all()
        assert (summary.count == 0).all()


def test_one_value_does_not_show_how_it_scatters():
    summary = summarise(np.array([5.0, np.nan]))
    assert summary.value == 5 and np.isnan([summary.low, summary.high]).all()
    assert summarise(np.array([5.0]), np.array([4.0]), np.array([7.0])).high == 7  # of its own interval


def tiles_of_noise(answered: int, reason: str, without: int) -> NoiseEstimate:
    """Tiles that answer 5 DN, 4 to 6, and tiles without an answer."""
    words = np.array([""] * answered + [reason] * without, dtype=object)
    five = np.where(words == "", 5.0, np.nan)
    bound = np.where(np.isin(words, ["", COMPRESSED]), np.arange(1.0, len(words) + 1), np.nan)
    return NoiseEstimate(five, five - 1, five + 1, words != "", words, at_most_dn=bound)


@pytest.mark.parametrize(
    ("answered", "reason", "without", "known"),
    [(6, COMPRESSED, 6, True), (5, COMPRESSED, 6, False), (1, COMPRESSED, 29, False), (7, UNCERTAIN, 21, True),
     (6, UNCERTAIN, 21, False), (2, "flat", 20, True), (2, "covered", 20, True),
     (2, "saturated", 20, True), (0, COMPRESSED, 4, False), (3, ALTERNATING, 4, False), (4, ALTERNATING, 4, True),
     (3, STREAKED, 4, False)],
)  # fmt: skip
def test_a_frame_that_mostly_abstains_because_of_a_codec_has_no_noise_level(answered, reason, without, known):
    summary = summarise_noise(tiles_of_noise(answered, reason, without))
    expected = [5.0, 4.0, 6.0, 5.0, 5.0] if known else [np.nan] * 5
    found = [summary.value, summary.low, summary.high, summary.least, summary.greatest]
    np.testing.assert_array_equal(np.array(found), expected)
    assert (int(summary.count), int(summary.abstained)) == (answered, without)


def test_a_frame_of_which_hardly_any_tile_answers_has_no_noise_level():
    tiles = tiles_of_noise(1, UNCERTAIN, 7)
    tiles.reason[-1] = COMPRESSED
    assert np.isnan(summarise_noise(tiles).value)
    tiles.reason[-4:] = "flat", "flat", "saturated", "saturated"
    assert summarise_noise(tiles).value == 5
    plugged_in = tiles_of_noise(1, "out of its range", 40)
    assert np.isnan(summarise_noise(plugged_in).value)


def test_reasons_that_concern_the_frame_count_together():
    both = tiles_of_noise(6, COMPRESSED, 7)
    both.reason[-3:] = STREAKED
    assert np.isnan(summarise_noise(both).value)
    both.reason[-3:] = UNCERTAIN
    assert summarise_noise(both).value == 5


@pytest.mark.parametrize("sigma_px", [0.8, 1.2, 2.0, 4.0])
def test_half_contrast_of_a_gaussian(sigma_px):
    exact = 2 * np.sqrt(np.log(2) / 2) / (np.pi * sigma_px)  # exp(-2 pi^2 s^2 (f / 2)^2) = 1 / 2
    assert half_contrast(mtf.gaussian(sigma_px, mtf.FREQUENCIES)) == pytest.approx(exact, rel=0.06)


def test_half_contrast_beyond_the_frequencies_and_where_nothing_is_known():
    curves = np.stack([np.full(8, 0.9), np.full(8, np.nan), np.full(8, 0.5)])
    result = half_contrast(curves)
    assert np.isinf(result[0])
    assert np.isnan(result[1])
    assert result[2] == pytest.approx(mtf.FREQUENCIES[0])


@pytest.mark.parametrize(
    ("answered", "reason", "without", "bound_dn"),
    [(2, COMPRESSED, 9, 5.0), (0, COMPRESSED, 6, 3.0), (1, UNCERTAIN, 8, np.nan), (2, STREAKED, 7, np.nan),
     (3, "flat", 8, np.nan)],
)  # fmt: skip
def test_a_coded_frame_holds_at_most_what_two_fifths_of_its_tiles_allow(answered, reason, without, bound_dn):
    tiles = tiles_of_noise(answered, reason, without)
    assert most_noise_dn(tiles) == pytest.approx(bound_dn, nan_ok=True)
    assert np.isnan(most_noise_dn(replace(tiles, at_most_dn=None)))


@pytest.mark.parametrize("reason", [UNCERTAIN, BEYOND, ALTERNATING, STREAKED])
def test_a_frame_has_no_bound_where_no_more_tiles_abstain_because_of_a_codec_than_for_other_reasons(reason):
    tiles = tiles_of_noise(0, COMPRESSED, 11)
    tiles.reason[6:] = reason
    assert np.isfinite(most_noise_dn(tiles))
    tiles.reason[5:] = reason
    assert np.isnan(most_noise_dn(tiles))


def test_noise_is_at_most_the_upper_end_of_an_answer_and_the_bound_without_one():
    answered, coded = tiles_of_noise(9, COMPRESSED, 2), tiles_of_noise(2, COMPRESSED, 9)
    assert at_most_dn(answered, summarise_noise(answered)) == summarise_noise(answered).high == 6
    assert at_most_dn(coded, summarise_noise(coded)) == most_noise_dn(coded) == 5


def test_the_spread_of_tiles_without_intervals_is_no_interval_and_no_bound_of_noise():
    sigma_dn = stream(0, "no intervals").normal(3.0, 0.3, 30)
    unknown, words = np.full(30, np.nan), np.full(30, "", dtype=object)
    tiles = NoiseEstimate(sigma_dn, unknown, unknown.copy(), words != "", words)
    summary = with_upper_end(summarise_noise(tiles), 9.0)
    assert abs(float(summary.value) - 3.0) < 0.2
    assert np.isnan([summary.low, summary.high, at_most_dn(tiles, summary, 9.0)]).all()


def test_the_parts_of_noise_are_of_the_tiles_that_the_noise_is_the_median_of():
    """A tile with far more noise than the others is an outlier, and its white part and correlation are left out too."""
    tiles = tiles_of_noise(4, UNCERTAIN, 2)
    tiles.sigma_dn[:4] = 5.0, 5.0, 5.0, 40.0
    white_dn = np.array([1.0, 2.0, 3.0, 39.0, np.nan, np.nan])
    split = replace(tiles, white_sigma_dn=white_dn, correlation=np.array([0.4, 0.5, 0.6, -0.9, np.nan, np.nan]))
    assert noise_parts(split, summarise_noise(split)) == (2.0, 0.5)
    white_dn, correlation = noise_parts(replace(split, correlation=None), summarise_noise(split))
    assert white_dn == 2.0 and np.isnan(correlation)
    assert np.isnan(noise_parts(tiles, summarise_noise(tiles))).all()


def test_a_frame_without_a_noise_level_has_no_parts_of_it_and_zero_noise_no_correlation():
    coded, half = tiles_of_noise(2, COMPRESSED, 9), np.full(11, 0.5)
    coded = replace(coded, white_sigma_dn=half, correlation=half)
    assert np.isnan(noise_parts(coded, summarise_noise(coded))).all()
    clean = tiles_of_noise(9, COMPRESSED, 2)
    zero = np.where(clean.abstained, np.nan, 0.0)
    clean = replace(clean, sigma_dn=zero, low_dn=zero, high_dn=zero + 1, white_sigma_dn=zero, correlation=zero + 0.4)
    white_dn, correlation = noise_parts(clean, summarise_noise(clean))
    assert white_dn == 0.0 and np.isnan(correlation)


def test_an_interval_reaches_at_least_as_far_as_coarse_noise_may():
    answered, coded = tiles_of_noise(9, COMPRESSED, 2), tiles_of_noise(2, COMPRESSED, 9)
    known, unknown = summarise_noise(answered), summarise_noise(coded)
    assert [with_upper_end(known, end).high for end in (9.0, 2.0, np.nan)] == [9, 6, 6]
    assert with_upper_end(known, 9.0).value == known.value and np.isnan(with_upper_end(unknown, 9.0).high)
    assert [at_most_dn(coded, unknown, end) for end in (9.0, 2.0, np.nan)] == [9, 5, 5]
    assert at_most_dn(answered, with_upper_end(known, 9.0), 9.0) == 9
    assert np.isnan(at_most_dn(tiles_of_noise(1, UNCERTAIN, 8), unknown, 9.0))
