"""The paper's program: each quirk separately, against numbers measured on the program itself."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.camera import authors, corruption
from pipeline.camera.chain import PRESETS
from pipeline.camera.sensor import Sensor
from pipeline.errors import InputError
from pipeline.streams import stream

GREY = np.full((300, 400), 120, np.uint8)


def residual(image: np.ndarray, noise_source: str, sigma_dn: float, **options: object) -> np.ndarray:
    """Noise seen in the 8-bit frame, DN."""
    made = corruption.corrupt(image, noise_source, sigma_dn=sigma_dn, generator=stream(1, noise_source), **options)
    return made.image_8bit.astype(float) - image


def test_authors_truncate_instead_of_rounding():
    # rounding down to electrons costs another half electron, amplified with the noise
    noise = residual(GREY, "photon", 10.0, camera="authors")
    assert noise.std() == pytest.approx(10.0, rel=0.01)
    assert noise.mean() == pytest.approx(-0.5, abs=4 * 10 / np.sqrt(GREY.size))
    assert abs(residual(GREY, "photon", 10.0).mean()) < 4 * 10 / np.sqrt(GREY.size)


def test_authors_old_program_scales_the_mean_absolute():
    made = corruption.corrupt(GREY, "readout", sigma_dn=10.0, generator=stream(2, "x"), camera="authors_2022")
    assert np.abs(made.noise_dn).mean() == pytest.approx(10.0, rel=1e-4)


def test_authors_old_program_leaks_a_share_of_the_signal():
    # full scale 256 instead of 255: n contains I / 255, amplified like the noise
    signal = Sensor().electrons(np.full((300, 400), 0.5, np.float32))
    raw = authors.raw_dn(signal, PRESETS["photon"], Sensor(), 293.15, 0.00014, stream(3, "x"), 256.0)
    assert raw.mean() - 127.5 == pytest.approx(127.5 / 255, abs=0.02)
    old = residual(GREY, "photon", 15.0, camera="authors_2022")
    assert 0.05 < old.mean() / 120 < 0.12  # measured on the program: +8 to 11 % of the signal on real frames


def test_authors_source_follower_noise_is_zero():
    from dataclasses import replace

    only = replace(PRESETS["readout"], reset=False)
    signal = Sensor().electrons(np.full((50, 60), 0.5, np.float32))
    raw = authors.raw_dn(signal, only, Sensor(), 330.0, 0.1, stream(4, "x"))
    assert np.ptp(raw) == 0.0


def test_authors_reset_noise_is_nearly_normal_and_lowers_the_signal():
    signal = Sensor().electrons(np.full((300, 400), 0.5, np.float32))
    sensor = Sensor()
    raw = authors.raw_dn(signal, PRESETS["readout"], sensor, 330.0, 0.1, stream(5, "x"))
    sigma_dn = sensor.reset_sigma_e(330.0) * sensor.dn_per_electron
    assert (raw - 127.5).std() == pytest.approx(sigma_dn, rel=0.01)
    # expm1 of a small normal: mean s^2 / 2 volts, downwards
    shift_dn = -0.5 * (sensor.reset_sigma_e(330.0) * 5e-6) ** 2 / 5e-6 * sensor.dn_per_electron
    assert (raw - 127.5).mean() == pytest.approx(shift_dn, abs=4 * sigma_dn / np.sqrt(raw.size))


def test_authors_noise_map_has_the_raw_magnitudes_of_the_program():
    signal = Sensor().electrons(np.full((300, 400), 0.5, np.float32))
    for noise_source, sigma_dn in (("photon", 1.27), ("dcsn", 0.482), ("readout", 0.96)):
        effects = PRESETS[noise_source]
        raw = authors.raw_dn(signal, effects, Sensor(), effects.temperature_k[0], effects.exposure_s[0], stream(6, "x"))
        assert raw.std() == pytest.approx(sigma_dn, abs=0.01)


def test_authors_full_well_holds_no_more_electrons():
    """Half of the photon noise of a white frame lies beyond, and is lost."""
    white = Sensor().electrons(np.ones((300, 400), np.float32))
    raw = authors.raw_dn(white, PRESETS["photon"], Sensor(), 293.15, 0.00014, stream(12, "x"))
    assert raw.max() == pytest.approx(255, abs=0.02)
    assert (raw == raw.max()).mean() == pytest.approx(0.5, abs=0.01)


def test_authors_saturated_frames_keep_one_side_of_the_noise():
    bright = np.full((300, 400), 245, np.uint8)
    noise = residual(bright, "photon", 25.0, camera="authors")
    # measured on the program at I ~ 245: mean -9 to -12.5
    assert -12.5 < noise.mean() < -5.0
    assert abs(noise.mean() - residual(bright, "photon", 25.0).mean()) < 1.5


def test_authors_blur_has_a_dark_frame_and_truncates():
    kernel = np.ones((11, 11), np.float32) / 121
    white = np.full((40, 50), 255, np.uint8)
    blurred = authors.blur_8bit(white.astype(float), kernel)
    assert blurred[0, 25] == np.trunc(255 * 6 / 11)
    assert set(np.unique(blurred[6:-6, 6:-6])) <= {254.0, 255.0}
    whole = corruption.corrupt(white, "photon", sigma_dn=0.0, generator=stream(7, "x"), psf=kernel, camera="authors")
    np.testing.assert_array_equal(whole.image_8bit, blurred)
    ours = corruption.corrupt(white, "photon", sigma_dn=0.0, generator=stream(7, "x"), psf=kernel)
    assert ours.image_8bit.min() == 255


def test_authors_order_photon_before_the_blur_and_the_rest_after():
    kernel = np.ones((5, 5), np.float32) / 25
    photon = residual(GREY, "photon", 15.0, camera="authors", psf=kernel)[10:-10, 10:-10]
    dark = residual(GREY, "dcsn", 15.0, camera="authors", psf=kernel)[10:-10, 10:-10]
    assert photon.std() == pytest.approx(15 / 5, rel=0.05)
    assert dark.std() == pytest.approx(15.0, rel=0.05)


def test_authors_conditions_are_those_of_the_physical_chain():
    both = [
        corruption.corrupt(GREY, "sensor", sigma_dn=5.0, generator=stream(8, "x"), camera=c) for c in corruption.CAMERAS
    ]
    assert len({(made.temperature_k, made.exposure_s) for made in both}) == 1
    assert [made.camera for made in both] == list(corruption.CAMERAS)


def test_authors_truth_describes_the_frame():
    made = corruption.corrupt(GREY, "combined", sigma_dn=10.0, generator=stream(9, "x"), camera="authors")
    assert made.unclipped_sigma_dn == pytest.approx(10.0, rel=1e-3)
    difference = made.noise_clipped_dn - made.noise_dn
    assert difference.max() <= 0.01 and difference.min() >= -1.01  # truncation only


def test_authors_refuse_a_sensor_their_program_does_not_know():
    for sensor in (Sensor(gain=2.0), Sensor(read_noise_e=3.0)):
        with pytest.raises(InputError, match="camera=physical"):
            corruption.corrupt(GREY, "photon", sigma_dn=5.0, generator=stream(10, "x"), camera="authors", sensor=sensor)
    with pytest.raises(InputError, match="no noise"):
        corruption.corrupt(
            np.zeros((8, 8), np.uint8), "photon", sigma_dn=5.0, generator=stream(10, "x"), camera="authors"
        )


@pytest.mark.shared
def test_authors_measured_on_a_real_frame(shared):
    """Mean, deviation and mean absolute of the published program at level 25 on the first KITTI frame."""
    import cv2

    path = sorted((shared / "realdata/kitti/training/image_2").glob("*.png"))[0]
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    measured = {
        ("authors", "photon"): (-0.88, 24.37, 17.61),
        ("authors", "dcsn"): (0.38, 23.20, 18.33),
        ("authors", "readout"): (0.51, 23.12, 18.26),
        ("authors_2022", "photon"): (8.93, 30.30, 23.12),
        ("authors_2022", "dcsn"): (16.01, 23.79, 22.60),
        ("authors_2022", "readout"): (10.88, 26.36, 22.37),
    }
    for (camera, noise_source), expected in measured.items():
        noise = residual(image, noise_source, 25.0, camera=camera)
        np.testing.assert_allclose([noise.mean(), noise.std(), np.abs(noise).mean()], expected, atol=0.15)
