"""The sensor's own measurements agree with its formulas, and the chain's steps with its result."""

import numpy as np
import pytest
from data_makers import picture

from pipeline.camera.characterisation.moments import moments, simulated_transfer
from pipeline.camera.corruption import corrupt
from pipeline.camera.psf import create
from pipeline.camera.sensor import Sensor
from pipeline.camera.steps import steps
from pipeline.streams import stream

SENSOR = Sensor()


@pytest.mark.parametrize("sensor", [SENSOR, Sensor(full_well_e=5000.0), SENSOR.at_gain(4.0)])
def test_photon_transfer_finds_the_gain_again(sensor):
    assert abs(simulated_transfer(sensor, 1).slope / sensor.dn_per_electron - 1) < 0.01


def test_photon_transfer_offset_is_the_read_noise():
    read_dn = SENSOR.readout_sigma_e(293.15) * SENSOR.dn_per_electron
    assert abs(simulated_transfer(SENSOR, 1).offset_dn2 / read_dn**2 - 1) < 0.02


def test_moments_meet_their_closed_forms():
    result = moments(SENSOR, 1)
    pixels = 512 * 512
    for name, (temperature_k, exposure_s) in {"330k_100ms": (330.0, 0.1), "300k_2ms": (300.0, 0.002)}.items():
        mean = SENSOR.dark_electrons(temperature_k, exposure_s)
        assert abs(result[f"dark_mean_{name}_e"] - mean) < 3 * np.sqrt(mean / pixels)
    for name, temperature_k in {"293k": 293.15, "330k": 330.0}.items():
        sigma = SENSOR.reset_sigma_e(temperature_k)
        assert abs(result[f"ktc_std_{name}_e"] - sigma) < 3 * sigma / np.sqrt(2 * pixels)
    assert abs(result["photon_std_mid_grey_e"] - 100) < 3 * 100 / np.sqrt(2 * pixels)


def test_steps_start_sharp_and_end_at_the_frame():
    image = picture("a").astype(np.float32) / np.float32(255)
    psf = create("defocus", 7)
    shown = corrupt(image, "combined", sigma_dn=10, generator=stream(1, "steps"), psf=psf)
    result = steps(shown)
    assert [step.name for step in result] == ["input", "photon", "optics", "dark", "readout", "quantised"]
    assert np.allclose(result[0].image, image, atol=1e-6)
    assert np.array_equal(result[-1].image, shown.image)
    assert np.abs(result[-2].image - result[-1].image).max() < 1.01 / 255  # whole electrons and rounding


def test_steps_that_were_off_are_left_out():
    image = picture("a").astype(np.float32) / np.float32(255)
    result = steps(corrupt(image, "photon", sigma_dn=10, generator=stream(1, "steps")))
    assert [step.name for step in result] == ["input", "photon", "quantised"]


def test_steps_of_the_authors_program_show_its_noise_in_one_piece():
    image = picture("a").astype(np.float32) / np.float32(255)
    result = steps(corrupt(image, "dcsn", sigma_dn=10, generator=stream(1, "steps"), camera="authors"))
    assert [step.name for step in result] == ["input", "total", "quantised"]
    assert np.abs(result[1].image - result[2].image).max() < 1.5 / 255
