"""Photon shot noise: Poisson on the full well, and the photon-transfer slope."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.camera.photon import photon_shot
from pipeline.camera.sensor import Sensor
from pipeline.errors import InputError
from pipeline.streams import stream


@pytest.mark.parametrize("share", [0.002, 0.02, 0.5, 1.0])
@pytest.mark.parametrize("method", ["exact", "hybrid"])
def test_photon_noise_has_the_moments_of_poisson(share, method):
    mean_e = np.float32(20_000 * share)
    counts = photon_shot(np.full((500, 600), mean_e), stream(1, "photon", share), method).astype(np.float64)
    count, mean = counts.size, float(mean_e)
    assert abs(counts.mean() - mean) < 3 * np.sqrt(mean / count)
    assert abs(counts.var() - mean) < 3 * mean * np.sqrt(2 / count + 1 / (mean * count))


def test_photon_noise_at_full_well_is_poisson_and_not_merely_normal():
    counts = photon_shot(np.full((1000, 1000), 20_000, np.float32), stream(2, "photon")).astype(np.float64)
    values = np.arange(counts.min(), counts.max() + 1)
    empirical = np.searchsorted(np.sort(counts.ravel()), values, side="right") / counts.size
    # 1.63 / sqrt(n) is the 1 % bound of a continuous variable, conservative for a discrete one
    assert np.abs(empirical - stats.poisson.cdf(values, 20_000)).max() < 1.63 / np.sqrt(counts.size)


def test_photon_transfer_slope_is_the_gain():
    sensor = Sensor()
    levels = np.linspace(0.05, 0.9, 18)
    means, variances = [], []
    for level in levels:
        signal = np.full((500, 600), level * sensor.full_well_e, np.float32)
        pair = [sensor.dn(photon_shot(signal, stream(3, "photon", float(level), i))).astype(float) for i in range(2)]
        means.append(np.mean(pair))
        variances.append(np.var(pair[0] - pair[1]) / 2)
    slope, offset = np.polyfit(means, variances, 1)
    assert slope == pytest.approx(sensor.dn_per_electron, rel=0.01)
    assert abs(offset) < 0.01 * max(variances)
    assert slope == pytest.approx(FULL_SCALE_DN / 20_000, rel=0.01)


def test_photon_noise_repeats_with_its_stream_and_not_without():
    signal = np.full((20, 30), 500, np.float32)
    first, again, other = (photon_shot(signal, stream(4, "photon", name)) for name in ("a", "a", "b"))
    np.testing.assert_array_equal(first, again)
    assert (first != other).mean() > 0.8


def test_photon_noise_of_darkness_is_none_and_of_less_is_refused():
    assert not photon_shot(np.zeros((5, 6), np.float32), stream(5, "photon")).any()
    with pytest.raises(InputError, match="Poisson means"):
        photon_shot(np.full((5, 6), -1, np.float32), stream(5, "photon"))
