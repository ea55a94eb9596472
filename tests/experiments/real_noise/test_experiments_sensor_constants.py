"""Constants of simulated sensors: those they were made with, whatever the black level."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.camera.characterisation.emva1288 import PLANES
from pipeline.datasets.decoding.raw_frames import raw_frames
from pipeline.errors import InputError
from pipeline.experiments.real_noise.sensor_constants import SensorConstants, sensor_constants
from pipeline.streams import stream

GAIN, DARK_CURRENT_E_PER_S, WHITE_DN = 0.05, 30.0, 255.0


def write(folder: Path, name: str, exposure_ms: int, electrons: np.ndarray, black_dn: float, dark_e: float) -> None:
    """A raw frame of 8 bit: shot noise of light and dark current, and dark noise above a black level."""
    generator = stream(1, "sensor constants", name, exposure_ms)
    mean = electrons * exposure_ms / 1000 + DARK_CURRENT_E_PER_S * exposure_ms / 1000
    signal = generator.poisson(mean) + generator.normal(0, dark_e, mean.shape)
    folder.mkdir(exist_ok=True, parents=True)
    picture = np.clip(np.rint(black_dn + GAIN * signal), 0, 255).astype(np.uint8)
    assert cv2.imwrite(str(folder / f"{name}_{exposure_ms}ms_1.tif"), picture)


def measured(root: Path, black_dn: float, dark_e: float, white_dn: float = WHITE_DN) -> SensorConstants:
    """Two scenes, each at three exposures, up to 85 % of full scale, and dark frames."""
    steps = np.tile(np.repeat(np.linspace(1600, 16000, 10), 64), (480, 1))  # electrons per second
    for exposure in (50, 100, 250):
        for name in ("a", "b"):
            write(root / "light", name, exposure, steps if name == "a" else 0.6 * steps, black_dn, dark_e)
    for exposure in (50, 500, 2000):
        write(root / "dark", "dark", exposure, np.zeros((200, 200)), black_dn, dark_e)
    return sensor_constants(raw_frames(root / "light"), raw_frames(root / "dark"), white_dn)


@pytest.fixture(scope="module", params=[0.0, 10.0, 30.0])
def sensor(request, tmp_path_factory):
    """Constants of a sensor of 20 electrons of dark noise, and its black level."""
    black_dn = request.param
    return measured(tmp_path_factory.mktemp("raw"), black_dn, dark_e=20.0), black_dn


def test_gain_and_dark_noise_do_not_depend_on_the_black_level(sensor):
    """With the black level left in, 30 DN of it gave a gain 11 % too large and no dark noise at all."""
    constants, black_dn = sensor
    transfer = constants.transfer
    assert list(transfer["plane"]) == list(PLANES)
    assert transfer["gain_dn_per_e"].mean() == pytest.approx(GAIN, rel=0.02)
    assert transfer["dark_sigma_e"].mean() == pytest.approx(20, rel=0.06)
    assert transfer["full_scale_e"].mean() == pytest.approx((WHITE_DN - black_dn) / GAIN, rel=0.03)
    if black_dn:
        assert constants.dark["offset_dn"].mean() == pytest.approx(black_dn, abs=0.05)
        assert constants.dark["dark_current_e_per_s"].mean() == pytest.approx(DARK_CURRENT_E_PER_S, rel=0.05)


def test_the_error_of_the_dark_noise_is_that_of_the_planes(sensor):
    constants, _ = sensor
    errors = constants.transfer["dark_sigma_error"]
    assert 0 < errors.max() < 2
    assert np.ptp(constants.transfer["dark_sigma_e"]) < 5 * errors.max()
    assert (constants.transfer["dark_sigma_reason"] == "").all()


def test_points_are_above_black_and_below_70_percent_of_saturation(sensor):
    constants, black_dn = sensor
    assert constants.points["mean_dn"].max() <= 0.7 * (WHITE_DN - black_dn)
    assert (constants.points.groupby("plane")["mean_dn"].apply(lambda column: column.is_monotonic_increasing)).all()
    line = constants.points.merge(constants.transfer, on="plane")
    expected = line["dark_variance_dn2"] + line["gain_dn_per_e"] * line["mean_dn"]
    np.testing.assert_allclose(line["variance_dn2"] / expected, 1, atol=0.08)
    assert abs((line["variance_dn2"] / expected).mean() - 1) < 0.01


def test_the_noise_of_a_grey_value_counts_from_the_black_level(sensor):
    constants, black_dn = sensor
    for fit in constants.fits.values():
        dark, lit = fit.sigma_dn(np.array([black_dn, black_dn + 100]))
        assert dark == pytest.approx(np.sqrt((GAIN * 20) ** 2 + 1 / 12), rel=0.08)
        assert lit == pytest.approx(np.sqrt((GAIN * 20) ** 2 + 1 / 12 + GAIN * 100), rel=0.03)


def test_white_below_the_black_level_is_refused(tmp_path):
    with pytest.raises(InputError, match="white_dn: 20 DN, expected more than the black level of 30"):
        measured(tmp_path, 30.0, dark_e=20.0, white_dn=20.0)


def flat_fields(root: Path, offset_e: float = 0.0, light: str = "light", dark: str = "dark") -> None:
    """Two frames each of seven levels, and dark frames, 8 bit; pixels differ by offsets."""
    offsets = offset_e * stream(1, "sensor offsets").standard_normal((320, 320))
    for exposure in (50, 500, 2000):
        write(root / dark, "dark", exposure, np.zeros((200, 200)), 10.0, 20.0)
    for shot in ("1", "2"):
        for exposure in (10, 20, 40, 70, 110, 160, 220):
            generator = stream(1, "sensor flat", shot, exposure)
            signal = generator.poisson(15.0 * exposure, offsets.shape) + generator.normal(offsets, 20.0)
            (root / light).mkdir(exist_ok=True, parents=True)
            picture = np.clip(np.rint(10 + GAIN * signal), 0, 255).astype(np.uint8)
            assert cv2.imwrite(str(root / light / f"flat_{exposure}ms_{shot}.tif"), picture)


def test_offsets_of_pixels_cancel_in_pairs_of_equal_exposure(tmp_path):
    """Between unequal exposures offsets as strong as the dark noise raised it by 8 %."""
    flat_fields(tmp_path, offset_e=20.0)
    transfer = sensor_constants(raw_frames(tmp_path / "light"), raw_frames(tmp_path / "dark"), WHITE_DN).transfer
    assert transfer["gain_dn_per_e"].mean() == pytest.approx(GAIN, rel=0.01)
    assert transfer["dark_sigma_e"].mean() == pytest.approx(20, rel=0.03)


def test_frames_of_more_bits_than_white_are_refused_by_name(tmp_path):
    flat_fields(tmp_path)
    with pytest.raises(InputError, match=r"flat_\d+ms_\d.tif: grey values up to .* white_dn, 60 DN"):
        sensor_constants(raw_frames(tmp_path / "light"), raw_frames(tmp_path / "dark"), 60.0)


def test_frames_of_another_size_are_refused_by_name(tmp_path):
    flat_fields(tmp_path)
    assert cv2.imwrite(str(tmp_path / "light" / "flat_70ms_2.tif"), np.full((320, 300), 90, np.uint8))
    with pytest.raises(InputError, match=r"flat_70ms_2.tif: shape \(320, 300\), expected \(320, 320\) of flat_70ms_1"):
        sensor_constants(raw_frames(tmp_path / "light"), raw_frames(tmp_path / "dark"), WHITE_DN)


def test_lit_frames_for_dark_ones_are_refused(tmp_path):
    flat_fields(tmp_path, light="dark", dark="light")
    for name in ("_2", "_3"):
        write(tmp_path / "light", "dark" + name, 50, np.zeros((200, 200)), 10.0, 20.0)
    with pytest.raises(InputError, match="dark: all frames brighter than those of .*light"):
        sensor_constants(raw_frames(tmp_path / "light"), raw_frames(tmp_path / "dark"), WHITE_DN)


def test_scenes_of_single_frames_are_refused_with_how_to_name_them(tmp_path):
    flat_fields(tmp_path)
    for number, path in enumerate(sorted((tmp_path / "light").iterdir())):
        path.rename(path.with_name(f"{number}_{path.name}"))
    with pytest.raises(InputError, match="no scene has two frames.*0_flat_250ms_1.tif"):
        sensor_constants(raw_frames(tmp_path / "light"), raw_frames(tmp_path / "dark"), WHITE_DN)
