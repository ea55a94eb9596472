"""The sensor's derived quantities against the numbers of the paper's program and of published sensors."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

from pipeline.camera import constants
from pipeline.camera.sensor import SENSORS, Sensor, named
from pipeline.errors import InputError


def test_sensor_derived_quantities_equal_the_papers_program():
    sensor = Sensor()
    assert sensor.sense_node_capacitance_f == pytest.approx(3.204e-14, rel=1e-3)
    assert sensor.voltage_at_full_well_v == pytest.approx(0.1)
    assert sensor.dn_per_electron == pytest.approx(255 / 20_000)
    assert sensor.electrons_per_dn == pytest.approx(20_000 / 255)


@pytest.mark.parametrize(
    ("temperature_k", "exposure_s", "electrons"),
    [(293.15, 0.1, 85.6), (300, 0.002, 3.03), (300, 0.1, 151.7), (300, 1, 1517), (330, 0.1, 1427.9), (330, 1, 14279)],
)
def test_sensor_dark_signal(temperature_k, exposure_s, electrons):
    assert Sensor().dark_electrons(temperature_k, exposure_s) == pytest.approx(electrons, rel=2e-3)


def test_sensor_dark_signal_doubles_every_six_to_eleven_kelvin():
    # generation current in silicon near room temperature; the depletion term here is the slower of the two known
    sensor = Sensor()
    ratio = sensor.dark_electrons(303.15, 1.0) / sensor.dark_electrons(293.15, 1.0)
    assert 6.0 < 10.0 / np.log2(ratio) < 11.0


@pytest.mark.parametrize(("temperature_k", "sigma_e"), [(293.15, 71.1), (300, 71.9), (330, 75.4)])
def test_sensor_reset_noise(temperature_k, sigma_e):
    assert Sensor().reset_sigma_e(temperature_k) == pytest.approx(sigma_e, abs=0.05)
    assert Sensor(kind="ccd").reset_sigma_e(temperature_k) == 0.0
    assert Sensor(reset_factor=0.5).reset_sigma_e(temperature_k) == pytest.approx(sigma_e / 2, abs=0.05)


def test_sensor_source_follower_noise_with_and_without_the_step_of_its_integral():
    sensor = Sensor()
    assert sensor.source_follower_sigma_e("authors") == pytest.approx(0.0272, abs=5e-5)
    assert sensor.source_follower_sigma_e() == pytest.approx(0.0272204 * np.sqrt(5e4), rel=1e-4)


def test_sensor_source_follower_sum_equals_the_integral():
    from scipy import integrate

    s = Sensor()
    tau = s.cds_time_factor * s.cds_interval_s

    def density(f: float) -> float:
        turn = 2 * np.pi * f
        noise = s.thermal_noise_v_per_sqrt_hz**2 * (1 + s.flicker_corner_hz / f)
        noise += 2 * s.current_modulation_a**2 * s.telegraph_time_s / (4 + (turn * s.telegraph_time_s) ** 2)
        return noise * (2 - 2 * np.cos(turn * s.cds_interval_s)) / (1 + (turn * tau) ** 2)

    edges = np.linspace(1, s.clock_hz, 81)  # one piece per quarter period of the transfer function
    power = sum(integrate.quad(density, a, b, limit=200)[0] for a, b in itertools.pairwise(edges))
    sigma = np.sqrt(power) / (s.sense_node_gain_v_per_e * (1 - np.exp(-s.cds_interval_s / tau)))
    assert s.source_follower_sigma_e() == pytest.approx(sigma, rel=3e-3)


def test_sensor_telegraph_noise_has_the_variance_of_two_levels():
    """A current that is I for half of the time has a variance of I^2 / 4; samples far apart differ by twice that."""
    sensor = Sensor(
        thermal_noise_v_per_sqrt_hz=0.0, current_modulation_a=3e-8, telegraph_time_s=5e-8, clock_hz=4e9,
        cds_time_factor=1e-6,
    )  # fmt: skip
    volts = 3e-8 * np.sqrt(2 / 4)
    assert sensor.source_follower_sigma_e() == pytest.approx(volts / sensor.sense_node_gain_v_per_e, rel=5e-3)


def test_sensor_readout_noise_adds_in_squares():
    sensor = Sensor()
    reset, follower = sensor.reset_sigma_e(330), sensor.source_follower_sigma_e()
    assert sensor.readout_sigma_e(330) == pytest.approx(np.hypot(reset, follower))
    assert sensor.readout_sigma_e(330, reset=False) == pytest.approx(follower)
    assert sensor.readout_sigma_e(330, source_follower=False) == pytest.approx(reset)
    assert sensor.readout_sigma_e(330, reset=False, source_follower=False) == 0.0


def test_sensor_measured_read_noise_falls_with_gain():
    sensor = named("automotive_3um")
    assert sensor.readout_sigma_e(300) == pytest.approx(2.5, abs=0.01)
    assert sensor.at_gain(16).readout_sigma_e(300) == pytest.approx(1.8, abs=0.01)


def test_sensor_prosilica_matches_its_published_dark_signal_and_noise():
    sensor = named("prosilica_gc1380h")
    per_second = [sensor.dark_electrons(273.15 + celsius, 1.0) for celsius in (20, 40, 60, 80)]
    np.testing.assert_allclose(per_second, [13, 64, 267, 950], rtol=0.01)
    for gain, shot_dn, read_dn in ((1, 1.52, 0.23), (2.24, 2.28, 0.51), (4, 3.05, 0.91), (16, 6.10, 3.65)):
        at = sensor.at_gain(gain)
        half_full_e = at.electrons_at_full_scale / 2
        assert np.sqrt(half_full_e) * at.dn_per_electron == pytest.approx(shot_dn, abs=0.01)
        assert at.readout_sigma_e(300) * at.dn_per_electron == pytest.approx(read_dn, abs=0.01)


def test_sensor_electrons_and_dn_are_inverse():
    image = np.linspace(0, 1, 256, dtype=np.float32).reshape(16, 16)
    for gain in (1.0, 4.0):
        sensor = Sensor(gain=gain)
        np.testing.assert_allclose(sensor.dn(sensor.electrons(image)), image * 255, atol=3e-5)
    assert Sensor(over_exposure=2.0).electrons(image).max() == 20_000
    assert Sensor(over_exposure=2.0).electrons(image)[0, 1] == pytest.approx(2 * 20_000 / 255)


@pytest.mark.parametrize(
    ("field", "value"),
    [("full_well_e", 0), ("gain", -1), ("pixel_pitch_um", float("nan")), ("read_noise_e", -0.1), ("kind", "film")],
)
def test_sensor_refuses_impossible_parameters(field, value):
    with pytest.raises(InputError, match=field):
        Sensor(**{field: value})


def test_sensor_a_full_well_gives_full_scale_at_every_gain():
    """Below base ISO it would not: pixels of a full well, cut off, would count as unclipped."""
    for gain in (1.0, 2.0, 30.0):
        assert Sensor(gain=gain).dn(Sensor().full_well_e) >= 255
    with pytest.raises(InputError, match="sensor.gain is a factor of at least 1"):
        Sensor().at_gain(0.99)


def test_sensor_refuses_impossible_conditions_and_names():
    with pytest.raises(InputError, match="kelvin"):
        Sensor().dark_electrons(-1, 0.1)
    with pytest.raises(InputError, match="exposure_s"):
        Sensor().dark_electrons(300, -0.1)
    with pytest.raises(InputError, match="read_noise_e"):
        Sensor(read_noise_after_gain_e=1.0)
    with pytest.raises(InputError, match="did you mean 'paper'"):
        named("papper")
    with pytest.raises(InputError, match="did you mean 'full_well_e'"):
        named("paper", full_well=3)


def test_sensor_every_named_sensor_is_valid_and_frozen():
    for name in SENSORS:
        sensor = named(name, gain=2.0)
        assert sensor.gain == 2.0
        with pytest.raises(dataclasses.FrozenInstanceError):
            sensor.gain = 1.0  # type: ignore[misc]


def test_constants_of_training_samples_are_those_of_the_sensor():
    sensor = Sensor()
    assert sensor.full_well_e == constants.PAPER_FULL_WELL_E
    hot, exposure = constants.PAPER_HOT_K, constants.PAPER_HOT_EXPOSURE_S
    assert sensor.dark_electrons(hot, exposure) == pytest.approx(constants.PAPER_HOT_DARK_E, rel=0.003)
    assert sensor.readout_sigma_e(hot) == pytest.approx(constants.PAPER_HOT_READOUT_E, rel=0.003)
