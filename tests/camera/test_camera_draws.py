"""The fast draws: normals, exact and hybrid Poisson counts, forked streams."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import special, stats

from pipeline.camera import draws
from pipeline.errors import InputError
from pipeline.streams import stream


def chi_square_p(counts: np.ndarray, mean: float) -> float:
    """Probability of a Poisson sample at least as unlike the distribution as this one."""
    low, high = stats.poisson.ppf([2e-4, 1 - 2e-4], mean)
    inner = np.arange(low, high + 1)
    expected = np.concatenate(
        [[stats.poisson.cdf(low - 1, mean)], stats.poisson.pmf(inner, mean), [stats.poisson.sf(high, mean)]]
    )
    seen = np.bincount((np.clip(counts, low - 1, high + 1) - low + 1).astype(int), minlength=inner.size + 2)
    expected, seen = expected * counts.size, seen.astype(float)
    some = expected > 8
    rest = expected[~some].sum()
    statistic = ((seen - expected)[some] ** 2 / expected[some]).sum()
    statistic += (seen[~some].sum() - rest) ** 2 / rest if rest > 0 else 0.0
    return float(stats.chi2.sf(statistic, some.sum() - 1 + (rest > 0)))


def test_normals_are_standard_normal():
    sample = draws.normals((1000, 1001), stream(1, "test", "normals")).astype(np.float64)
    count = sample.size
    assert sample.shape == (1000, 1001)
    assert abs(sample.mean()) < 3 / np.sqrt(count)
    assert abs(sample.var() - 1) < 3 * np.sqrt(2 / count)
    assert abs(stats.skew(sample.ravel())) < 3 * np.sqrt(6 / count)
    assert abs(stats.kurtosis(sample.ravel())) < 3 * np.sqrt(24 / count)
    assert stats.kstest(sample.ravel()[:200_000], "norm").pvalue > 0.01
    assert np.abs(sample).max() > 4.5


def test_normals_neighbours_do_not_correlate():
    sample = draws.normals((600, 700), stream(2, "test", "normals")).astype(np.float64)
    for shift in ((0, 1), (1, 0), (1, 1)):
        other = np.roll(sample, shift, (0, 1))
        assert abs((sample * other).mean()) < 4 / np.sqrt(sample.size)
    halves = sample.ravel()[: sample.size // 2], sample.ravel()[sample.size // 2 :]
    assert abs((halves[0] * halves[1]).mean()) < 4 / np.sqrt(halves[0].size)
    assert abs((halves[0] ** 2 * halves[1] ** 2).mean() - 1) < 4 * np.sqrt(8 / halves[0].size)


@given(count=st.integers(0, 300), sigma=st.sampled_from([0.0, 1.0, 2.5]))
def test_normals_any_length_and_scale(count, sigma):
    sample = draws.normals(count, stream(3, "test"), sigma)
    unit = draws.normals(count, stream(3, "test"))
    assert sample.shape == (count,) and sample.dtype == np.float32
    np.testing.assert_array_equal(sample, unit * np.float32(sigma))


@pytest.mark.parametrize(("low", "high"), [(64, 70), (64, 300), (1000, 20_000), (20_000, 1e6)])
def test_poisson_exact_equals_the_quantile_of_its_normals(low, high):
    rate = stream(4, "test", "rate").uniform(low, high, 200_000).astype(np.float32)
    counts = draws.poisson(rate, stream(5, "test")).astype(np.float64)
    # the same words made into normals, block by block as the sampler does
    w = draws.normals(rate.shape, stream(5, "test")).astype(np.float64)
    mean = rate.astype(np.float64)
    below = np.maximum(counts - 1, 0)
    left, right = w < 0, w >= 0
    assert np.all(special.pdtr(counts, mean)[left] >= special.ndtr(w)[left])
    assert np.all(special.pdtr(below, mean)[left] < special.ndtr(w)[left])
    assert np.all(special.pdtrc(counts, mean)[right] <= special.ndtr(-w)[right])
    assert np.all(special.pdtrc(below, mean)[right] > special.ndtr(-w)[right])


@pytest.mark.parametrize("mean", [0.3, 12.0, 63.9, 64.0, 100.0, 20_000.0])
def test_poisson_exact_is_poisson(mean):
    counts = draws.poisson(np.full(400_000, mean, np.float32), stream(6, "test", mean))
    assert np.all(counts == np.rint(counts)) and counts.min() >= 0
    assert chi_square_p(counts, float(np.float32(mean))) > 1e-3


@pytest.mark.parametrize("mean", [0.3, 3.03, 50.0, 1427.9, 14_279.0])
def test_poisson_even_is_poisson(mean):
    counts = draws.poisson_even(mean, (500, 800), stream(7, "test", mean)).ravel()
    assert np.all(counts == np.rint(counts)) and counts.min() >= 0
    assert chi_square_p(counts, mean) > 1e-3
    assert abs(counts.astype(float).mean() - mean) < 3 * np.sqrt(mean / counts.size)


def test_poisson_even_of_nothing_is_nothing():
    assert not draws.poisson_even(0.0, (4, 5), stream(7, "test")).any()
    assert draws.poisson_even(5.0, (0, 5), stream(7, "test")).shape == (0, 5)


@pytest.mark.parametrize("mean", [40.0, 64.0, 90.0, 500.0, 20_000.0])
def test_poisson_hybrid_has_the_moments_of_poisson(mean):
    counts = draws.poisson(np.full(400_000, mean, np.float32), stream(8, "test", mean), "hybrid").astype(np.float64)
    count = counts.size
    assert np.all(counts == np.rint(counts)) and counts.min() >= 0
    assert abs(counts.mean() - mean) < 3 * np.sqrt(mean / count)
    assert abs(counts.var() - mean) < 3 * mean * np.sqrt(2 / count + 1 / (mean * count))


@pytest.mark.parametrize("mean", [64.0, 100.0])
def test_poisson_hybrid_makes_room_for_the_variance_of_rounding(mean):
    """The variance is the mean to 0.03: explained by the normals, plus the 1/12 of rounding.

    Splitting it by a regression on the normals takes their own sampling error out, which would hide 1/12.
    """
    counts = draws.poisson(np.full(400_000, mean, np.float32), stream(8, "test"), "hybrid").astype(np.float64)
    w = draws.normals(counts.shape, stream(8, "test")).astype(np.float64)
    slope, offset = np.polyfit(w, counts, 1)
    residual = counts - offset - slope * w
    assert residual.var() == pytest.approx(1 / 12, rel=0.01)
    assert slope**2 + residual.var() == pytest.approx(mean, abs=0.03)


@pytest.mark.parametrize(("mean", "distance"), [(64.0, 0.0105), (1000.0, 0.003), (20_000.0, 0.0025)])
def test_poisson_hybrid_is_near_poisson_as_its_skewness_allows(mean, distance):
    # Kolmogorov distance of a normal to a Poisson distribution: about 1 / (6 sqrt(2 pi mean)), plus sampling
    counts = draws.poisson(np.full(400_000, mean, np.float32), stream(9, "test", mean), "hybrid")
    values = np.arange(counts.min(), counts.max() + 1)
    empirical = np.searchsorted(np.sort(counts), values, side="right") / counts.size
    assert np.abs(empirical - stats.poisson.cdf(values, mean)).max() < distance


def test_poisson_hybrid_is_continuous_where_it_changes_method():
    rate = np.repeat(np.float32([63.99, 64.0]), 300_000)
    counts = draws.poisson(rate, stream(10, "test"), "hybrid").astype(np.float64).reshape(2, -1)
    error = np.sqrt(2 * 64 / 300_000)
    assert abs(np.diff(counts.mean(1))[0]) < 3 * error
    assert abs(np.diff(counts.var(1))[0]) < 3 * 64 * np.sqrt(4 / 300_000)


def test_poisson_noise_is_common_to_light_levels():
    scene = stream(11, "test").uniform(500, 9000, (60, 70)).astype(np.float32)
    dim = draws.poisson(scene, stream(12, "test"))
    bright = draws.poisson(scene * np.float32(1.2), stream(12, "test"))
    assert np.all(bright >= dim)
    residues = [(k - m) / np.sqrt(m) for k, m in ((dim, scene), (bright, scene * 1.2))]
    assert np.corrcoef(residues[0].ravel(), residues[1].ravel())[0, 1] > 0.999


def test_poisson_noise_of_faint_pixels_is_not_common_to_light_levels():
    # as documented: an estimate of a difference between exposures has the noise of both in faint pixels
    shape = (100, 100)
    for dim, bright in ((20.0, 21.0), (63.0, 64.5)):
        pair = [draws.poisson(np.full(shape, mean, np.float32), stream(12, "test")) for mean in (dim, bright)]
        assert abs(np.corrcoef(pair[0].ravel(), pair[1].ravel())[0, 1]) < 0.04  # four standard errors
    pair = [draws.poisson(np.full(shape, mean, np.float32), stream(12, "test")) for mean in (64.5, 66.0)]
    assert np.corrcoef(pair[0].ravel(), pair[1].ravel())[0, 1] > 0.998


def test_poisson_mixes_faint_and_bright_pixels():
    rate = np.zeros((50, 60), np.float32)
    rate[:, 20:40], rate[:, 40:] = 5.0, 5000.0
    counts = draws.poisson(rate, stream(13, "test"))
    assert not counts[:, :20].any()
    assert abs(counts[:, 20:40].mean() - 5) < 4 * np.sqrt(5 / 1000)
    assert abs(counts[:, 40:].mean() - 5000) < 4 * np.sqrt(5000 / 1000)


def test_fork_gives_independent_repeatable_children():
    first, second = (draws.fork(stream(14, "test"), 3) for _ in range(2))
    samples = [child.random(1000) for child in first]
    np.testing.assert_array_equal(samples[1], second[1].random(1000))
    assert max(abs(np.corrcoef(samples)[np.triu_indices(3, 1)])) < 0.12
    # a child does not depend on how many siblings follow
    np.testing.assert_array_equal(samples[0], draws.fork(stream(14, "test"), 1)[0].random(1000))


@pytest.mark.parametrize("rate", [-1.0, float("nan"), 2e6])
def test_poisson_refuses_impossible_means(rate):
    with pytest.raises(InputError, match="Poisson means"):
        draws.poisson(np.full((3, 3), rate, np.float32), stream(15, "test"))
    with pytest.raises(InputError, match="Poisson means"):
        draws.poisson_even(rate, (3, 3), stream(15, "test"))


def test_poisson_refuses_unknown_methods():
    with pytest.raises(InputError, match="did you mean 'hybrid'"):
        draws.poisson(np.ones((2, 2)), stream(16, "test"), "hybrd")  # type: ignore[arg-type]
