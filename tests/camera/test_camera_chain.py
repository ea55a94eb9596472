"""The ordered chain: identity, order, switches, natural moments, independence of sources."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from pipeline.camera import chain, psf
from pipeline.camera.sensor import Sensor
from pipeline.errors import InputError
from pipeline.streams import stream

GREY = np.full((300, 400), 128 / 255, np.float32)


def scene(height: int = 120, width: int = 160) -> np.ndarray:
    """A smooth scene between 0.2 and 0.8 on the 8-bit grid."""
    y, x = np.mgrid[:height, :width]
    image = 0.5 + 0.15 * np.sin(x / 9.0) + 0.15 * np.cos(y / 7.0)
    return (np.rint(image * 255) / 255).astype(np.float32)


def test_chain_with_nothing_on_returns_the_frame_bit_for_bit():
    image = stream(1, "chain").random((37, 41), dtype=np.float32)
    assert np.array_equal(chain.expose(image, chain.Effects(), stream(1, "chain")).image, image)
    eight = stream(2, "chain").integers(0, 256, (37, 41), dtype=np.uint8)
    formed = chain.expose(eight, chain.Effects(), stream(1, "chain"))
    np.testing.assert_array_equal(formed.image_8bit, eight)
    np.testing.assert_array_equal(formed.image, eight.astype(np.float32) / np.float32(255))
    off = chain.expose(eight, chain.PRESETS["combined"], stream(1, "chain"), noise_scale=0.0)
    np.testing.assert_array_equal(off.image_8bit, eight)
    assert formed.unclipped_sigma_dn == 0.0 and formed.noise_scale == 0.0 and not formed.noise_e


@pytest.mark.parametrize("noise_source", ["photon", "dcsn", "readout", "combined"])
def test_chain_takes_frames_in_any_memory_order(noise_source):
    """A transposed frame is the same frame; the image was once filled in another order than it was made in."""
    image = scene()
    effects = chain.PRESETS[noise_source]
    formed = chain.expose(image, effects, stream(1, "order"))
    other = chain.expose(np.asfortranarray(image), effects, stream(1, "order"))
    np.testing.assert_array_equal(other.image, formed.image)
    assert other.clipped_sigma_dn == formed.clipped_sigma_dn


@pytest.mark.parametrize(
    ("noise_source", "variance_e2"),
    [
        ("photon", 20_000 * 128 / 255),
        ("dcsn", 1427.947),
        ("readout", 75.415**2 + 6.0867**2),
    ],
)
def test_chain_natural_noise_equals_its_closed_form(noise_source, variance_e2):
    formed = chain.expose(GREY, chain.PRESETS[noise_source], stream(3, "chain", noise_source))
    count = GREY.size
    expected_dn2 = variance_e2 * Sensor().dn_per_electron ** 2
    assert (
        abs(formed.unclipped_sigma_dn**2 - expected_dn2) < 3 * expected_dn2 * np.sqrt(2 / count) + 1e-3 * expected_dn2
    )
    assert abs(formed.noise_dn.mean(dtype=float)) < 3 * np.sqrt(expected_dn2 / count)


def test_chain_combined_noise_adds_in_squares_and_quantisation_adds_a_twelfth():
    at = chain.expose(GREY, chain.PRESETS["combined"], stream(4, "chain"))
    sensor = Sensor()
    dark = sensor.dark_electrons(at.temperature_k, at.exposure_s)
    electrons2 = 20_000 * 128 / 255 + dark + sensor.readout_sigma_e(at.temperature_k) ** 2
    expected = electrons2 * sensor.dn_per_electron**2
    assert at.unclipped_sigma_dn**2 == pytest.approx(expected, rel=0.015)
    assert at.clipped_sigma_dn**2 == pytest.approx(expected + 1 / 12, rel=0.015)
    # charge comes in whole electrons: half an electron is lost on average
    assert at.shift_dn == pytest.approx(-0.5 * sensor.dn_per_electron, abs=3 * np.sqrt(expected / GREY.size))


@pytest.mark.parametrize("noise_source", ["combined", "sensor"])
def test_chain_draws_conditions_in_the_papers_ranges(noise_source):
    results = [
        chain.draw(GREY[:2, :2] * 20_000, chain.PRESETS[noise_source], Sensor(), stream(5, "chain", n))
        for n in range(60)
    ]
    temperatures, times = np.array([[f.temperature_k, f.exposure_s] for f in results]).T
    assert 300 <= temperatures.min() < 305 and 325 < temperatures.max() <= 330
    assert 0.002 <= times.min() < 0.1 and 0.9 < times.max() <= 1.0


def test_chain_sources_do_not_disturb_each_other():
    signal = Sensor().electrons(scene())
    everything = chain.draw(signal, chain.PRESETS["combined"], Sensor(), stream(6, "chain"))
    without = chain.draw(signal, chain.PRESETS["sensor"], Sensor(), stream(6, "chain"))
    assert set(everything.noise_e) == {"photon", "dark", "readout"} and set(without.noise_e) == {"dark", "readout"}
    for source, noise in without.noise_e.items():
        np.testing.assert_array_equal(noise, everything.noise_e[source])
    flat = [noise.ravel() - noise.mean() for noise in everything.noise_e.values()]
    assert np.abs(np.corrcoef(flat)[np.triu_indices(3, 1)]).max() < 4 / np.sqrt(signal.size)


def test_chain_order_photon_noise_is_blurred_and_sensor_noise_is_not():
    kernel = psf.create("defocus", 11)
    photon = chain.expose(GREY, chain.PRESETS["photon"], stream(7, "chain"), psf=kernel)
    share = float(np.sqrt((kernel.astype(float) ** 2).sum()))
    natural = np.sqrt(20_000 * 128 / 255) * Sensor().dn_per_electron
    assert photon.unclipped_sigma_dn == pytest.approx(natural * share, rel=0.03)
    read = chain.expose(GREY, chain.PRESETS["readout"], stream(7, "chain"), psf=kernel)
    sharp = chain.expose(GREY, chain.PRESETS["readout"], stream(7, "chain"))
    np.testing.assert_array_equal(read.noise_dn, sharp.noise_dn)


def test_chain_blur_alone_is_blur_and_rounding():
    from pipeline.camera.blur import blur

    kernel = psf.create("linear_motion", 9, 45)
    image = scene()
    formed = chain.expose(image, chain.Effects(), stream(8, "chain"), psf=kernel)
    expected = blur(image, kernel)
    assert np.abs(formed.image - expected).max() <= 0.5 / 255 + 1e-4
    assert np.array_equal(np.rint(formed.image * 255), formed.image_8bit)
    np.testing.assert_allclose(formed.clean_dn, expected * 255, atol=1e-3)
    assert formed.mtf.shape == (2, 8) and formed.mtf.max() < 1


def test_chain_delta_kernel_is_no_blur():
    image = scene()
    formed = chain.expose(image, chain.Effects(), stream(9, "chain"), psf=np.ones((1, 1), np.float32))
    np.testing.assert_array_equal(formed.image, image)


def test_chain_without_quantisation_is_linear_in_the_gain():
    effects = chain.Effects(photon=True, quantise=False)
    once, twice = (chain.expose(scene(), effects, stream(10, "chain"), noise_scale=g) for g in (1.0, 2.0))
    np.testing.assert_allclose(twice.image - scene(), 2 * (once.image - scene()), atol=2e-6)


def test_chain_full_well_and_camera_gain():
    bright = np.ones((200, 300), np.float32)
    formed = chain.expose(bright, chain.PRESETS["photon"], stream(11, "chain"), noise_scale=20)
    assert formed.image.max() == 1.0
    assert formed.clipped_fraction == pytest.approx(0.5, abs=0.01)
    assert formed.shift_dn == pytest.approx(-20 * np.sqrt(20_000 / (2 * np.pi)) * 255 / 20_000, rel=0.03)
    # four times the camera gain: a quarter of the light for the same grey, half the signal-to-noise ratio
    low, high = (
        chain.expose(GREY, chain.PRESETS["photon"], stream(12, "chain"), sensor=Sensor(gain=g)) for g in (1.0, 4.0)
    )
    assert high.unclipped_sigma_dn / low.unclipped_sigma_dn == pytest.approx(2.0, rel=0.01)


def test_chain_noise_below_black_is_clipped_as_well():
    black = chain.expose(np.zeros((200, 300), np.float32), chain.PRESETS["readout"], stream(13, "chain"))
    assert black.image.min() == 0.0 and black.clipped_fraction == pytest.approx(0.5, abs=0.01)


def test_chain_over_exposure_saturates():
    formed = chain.expose(scene(), chain.Effects(), stream(13, "chain"), sensor=Sensor(over_exposure=3.0))
    # charge comes in whole electrons, so a level may fall by the hundredth of a DN that one electron is
    expected = np.clip(scene() * 3, 0, 1) * 255
    assert np.abs(formed.image * 255 - expected).max() < 0.52


def test_chain_truth_fits_together():
    formed = chain.expose(scene(), chain.PRESETS["combined"], stream(14, "chain"), psf=psf.create("defocus", 5))
    unclipped = formed.clean_dn + formed.noise_dn
    assert np.abs(formed.image * 255 - unclipped).max() <= 0.5 + 0.013 + 1e-3
    np.testing.assert_allclose(formed.electrons * Sensor().dn_per_electron, unclipped, rtol=1e-5)
    row = formed.row()
    assert row["unclipped_sigma_dn"] == formed.unclipped_sigma_dn and row["clipped_fraction"] == 0.0
    assert all(not isinstance(value, np.generic) for value in row.values())
    again = pickle.loads(pickle.dumps(formed))
    np.testing.assert_array_equal(again.image, formed.image)


def test_chain_preset_of_several_effects_is_their_union():
    name, effects = chain.preset(["photon", "dcsn"])
    assert name == "photon+dcsn"
    assert effects.photon and effects.dark and not effects.reset and not effects.source_follower
    assert effects.temperature_k == (300.0, 330.0)
    assert chain.preset("photon") == chain.preset(("photon",))
    assert chain.preset(["photon", "sensor"])[1] == chain.PRESETS["combined"]


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (np.zeros((3, 4, 3), np.uint8), "convert colour"),
        (np.zeros((0, 4), np.uint8), "height, width"),
        (np.full((3, 4), 2.0), "divide by its full scale"),
        (np.full((3, 4), np.nan), r"lies in \[0, 1\]"),
        (np.zeros((3, 4), np.uint16), "uint16"),
    ],
)
def test_chain_refuses_what_is_not_a_grey_image(image, message):
    with pytest.raises(InputError, match=message):
        chain.expose(image, chain.PRESETS["photon"], stream(15, "chain"))


def test_chain_refuses_bad_gain_and_names():
    with pytest.raises(InputError, match="noise_scale"):
        chain.expose(GREY, chain.Effects(), stream(16, "chain"), noise_scale=-1.0)
    with pytest.raises(InputError, match="did you mean 'readout'"):
        chain.preset("redout")
