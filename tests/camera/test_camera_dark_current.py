"""Dark-current shot noise against its closed form."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.camera.dark_current import dark_noise
from pipeline.camera.sensor import Sensor, named
from pipeline.errors import InputError
from pipeline.streams import stream

SHAPE = (500, 600)


@pytest.mark.parametrize(("temperature_k", "exposure_s"), [(300.0, 0.002), (293.15, 0.1), (330.0, 0.1), (330.0, 1.0)])
@pytest.mark.parametrize("zero_mean", [True, False])
def test_dark_current_moments(temperature_k, exposure_s, zero_mean):
    sensor = Sensor()
    mean_e = sensor.dark_electrons(temperature_k, exposure_s)
    generator = stream(1, "dark", temperature_k, exposure_s)
    noise = dark_noise(SHAPE, sensor, temperature_k, exposure_s, generator, zero_mean=zero_mean).astype(np.float64)
    count = noise.size
    assert abs(noise.mean() - (0 if zero_mean else mean_e)) < 3 * np.sqrt(mean_e / count)
    assert abs(noise.var() - mean_e) < 3 * mean_e * np.sqrt(2 / count + 1 / (mean_e * count))


def test_dark_current_of_the_papers_setting_is_half_a_dn():
    sensor = Sensor()
    noise = sensor.dn(dark_noise(SHAPE, sensor, 330.0, 0.1, stream(2, "dark")))
    assert float(noise.std()) == pytest.approx(0.482, abs=0.003)


def test_dark_current_grows_with_time_temperature_and_pixel():
    sensor = Sensor()
    base = sensor.dark_electrons(300, 0.1)
    assert sensor.dark_electrons(300, 0.2) == pytest.approx(2 * base)
    assert sensor.dark_electrons(310, 0.1) > 1.8 * base
    assert Sensor(pixel_pitch_um=10).dark_electrons(300, 0.1) == pytest.approx(4 * base)
    assert named("automotive_3um").dark_electrons(333.15, 1.0) == pytest.approx(30, rel=0.02)
    assert not dark_noise((4, 5), sensor, 300, 0.0, stream(5, "dark")).any()


def test_dark_current_refuses_impossible_conditions():
    with pytest.raises(InputError, match="kelvin"):
        dark_noise((4, 5), Sensor(), 0.0, 0.1, stream(6, "dark"))
    with pytest.raises(InputError, match="exposure_s"):
        dark_noise((4, 5), Sensor(), 300.0, float("nan"), stream(6, "dark"))
    with pytest.raises(InputError, match="Poisson means"):
        dark_noise((4, 5), Sensor(), 370.0, 100.0, stream(6, "dark"))
