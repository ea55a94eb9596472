"""Readout noise against its closed form."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from pipeline.camera.readout import read_noise
from pipeline.camera.sensor import Sensor, named
from pipeline.streams import stream

SHAPE = (500, 600)


@pytest.mark.parametrize(
    ("switches", "sigma_e"),
    [
        ({}, np.hypot(75.415, 6.0867)),
        ({"source_follower": False}, 75.415),
        ({"reset": False}, 6.0867),
    ],
)
def test_readout_moments_of_each_source(switches, sigma_e):
    noise = read_noise(SHAPE, Sensor(), 330.0, stream(1, "readout", len(switches)), **switches).astype(np.float64)
    assert abs(noise.mean()) < 3 * sigma_e / np.sqrt(noise.size)
    assert abs(noise.var() - sigma_e**2) < 3 * sigma_e**2 * np.sqrt(2 / noise.size) + 1e-3 * sigma_e**2
    assert stats.kstest(noise.ravel()[:100_000] / sigma_e, "norm").pvalue > 0.01


def test_readout_of_a_ccd_is_source_follower_noise_only():
    noise = read_noise(SHAPE, Sensor(kind="ccd"), 330.0, stream(2, "readout"))
    assert float(noise.std()) == pytest.approx(6.09, rel=0.01)


def test_readout_with_a_measured_value():
    noise = read_noise(SHAPE, named("prosilica_gc1380h"), 330.0, stream(3, "readout"))
    assert float(noise.std()) == pytest.approx(12.5, rel=0.01)


def test_readout_with_everything_off_is_none():
    assert not read_noise((4, 5), Sensor(), 330.0, stream(4, "readout"), reset=False, source_follower=False).any()
