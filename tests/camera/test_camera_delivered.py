"""A finished picture through a camera: the truth is the noise between shots, and a noise-free camera has none."""

import numpy as np
import pytest

from pipeline.camera.processing import presets
from pipeline.camera.processing.delivered import deliver, linear_scene
from pipeline.camera.processing.develop import CameraPipeline
from pipeline.camera.processing.raw_noise import RawNoise
from pipeline.errors import InputError
from pipeline.streams import stream

FLAT = np.full((67, 130, 3), 0.5, np.float32)


def test_truth_of_white_noise_is_the_noise_of_the_sensor():
    camera = CameraPipeline(noise=RawNoise(1e-3, 0.1), demosaicing=None, gamma=1.0)
    light = 0.5**2.2
    shown = deliver(FLAT, camera, 16, stream(1, "delivered"))
    assert shown.picture.shape == (66, 130, 3)
    expected = 255 * np.sqrt(1e-3 * (light + 0.1))
    assert shown.noise.sigma_dn == pytest.approx(np.hypot(expected, np.sqrt(1 / 12)), rel=0.02)
    assert abs(shown.noise.correlation) < 0.03
    assert shown.noise.map_dn.shape == (8, 16)


def test_processing_correlates_the_noise_and_iso_raises_it():
    camera = presets.named("reflex")
    low, high = (deliver(FLAT, camera.at_iso(iso), 6, stream(1, "iso")).noise for iso in (400, 6400))
    assert high.sigma_dn > 2 * low.sigma_dn
    assert high.correlation > 0.3 and high.white_sigma_dn < 0.7 * high.sigma_dn


def test_without_noise_shots_are_equal_and_grey_pictures_stay_grey():
    shown = deliver(FLAT[..., 0], presets.named("machine_vision").at_iso(0), 2, stream(1, "none"))
    assert shown.noise.sigma_dn == 0
    inside = shown.picture[8:-8, 8:-8]
    assert (inside == inside[0, 0, 0]).all() and abs(int(inside[0, 0, 0]) - 255 * 0.5**2.2) <= 1


def test_a_linear_scene_is_the_power_law_of_the_picture():
    assert np.allclose(linear_scene(np.full((17, 16), 0.25, np.float32)), 0.25**2.2, atol=1e-6)


@pytest.mark.parametrize(
    ("shape", "shots", "word"), [((64, 64), 1, "shots"), ((16, 64), 2, "24 px"), ((64, 64, 4), 2, "4")]
)
def test_bad_input_is_named(shape, shots, word):
    with pytest.raises(InputError, match=word):
        deliver(np.zeros(shape, np.float32), CameraPipeline(), shots, stream(1, "bad"))


def test_pictures_scaled_below_the_least_size_are_refused():
    with pytest.raises(InputError, match="at least 24 px"):
        deliver(np.zeros((32, 64), np.float32), CameraPipeline(scaling=0.5), 2, stream(1, "small"))
