"""Long-run variance: autoregressive series with and without white noise, short ones, constant ones."""

import numpy as np
import pytest

from benchmarks.trend_alarms import autoregressive
from pipeline.condition.long_run_variance import first_order, lag_1, long_run_variance, scenery_and_scatter
from pipeline.streams import stream


@pytest.mark.parametrize("phi", [0.5, 0.8])
def test_the_autocorrelation_of_a_short_series_is_not_taken_for_less(phi):
    """One standard error is added to an estimate without bias: more than three of four series lie above."""
    series = autoregressive(stream(0, "short series", phi), phi, 100, 4000)
    assert (first_order(series) >= (1 + phi) / (1 - phi)).mean() > 0.75


@pytest.mark.parametrize(("phi", "share"), [(0.95, 0.5), (0.98, 0.2), (0.98, 0.735)])
def test_slow_scenery_below_white_scatter_is_seen(phi, share):
    """Its tau^2 is known; that of lag 1 alone is a small part of it."""
    generator = stream(0, "scenery and scatter", phi, share)
    slow = np.sqrt(share) * autoregressive(generator, phi, 300, 400)
    series = slow + np.sqrt(1 - share) * generator.standard_normal((300, 400))
    true = 1 + 2 * share * phi / (1 - phi)
    assert np.median(first_order(series)) < 0.35 * true
    assert 0.9 * true < np.median(scenery_and_scatter(series)) < 2 * true
    assert (long_run_variance(series) >= scenery_and_scatter(series)).all()


def test_white_noise_is_mostly_taken_for_white_and_level_and_scale_do_not_matter():
    series = stream(0, "white").standard_normal((300, 1000))
    tau2 = long_run_variance(series)
    assert np.median(tau2) < 1.5 and tau2.min() >= 1 and tau2.max() <= 99
    assert np.median(long_run_variance(series[:100])) < 3  # no scenery slower than so short a series shows
    np.testing.assert_allclose(long_run_variance(7 - 0.01 * series), tau2)
    for n in (100, 101):
        assert long_run_variance(series[:n, 0]).shape == () and long_run_variance(np.full(n, 0.1)) == 1


def test_the_lag_1_autocorrelation_is_that_of_numpy():
    values = stream(0, "lag").standard_normal(200)
    centred = values - values.mean()
    assert lag_1(centred) == pytest.approx(np.correlate(centred, centred, "full")[200] / (centred**2).sum())
