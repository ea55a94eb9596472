"""Corrupted sets: pure functions of frame, effect, level and seed; the gallery shows what it says."""

import numpy as np
import pytest
from data_makers import make_kitti

from pipeline.camera.sensor import Sensor
from pipeline.config.schema import CameraSection, SensorSection
from pipeline.datasets import open_dataset
from pipeline.datasets.corrupted import CameraSettings, corrupted
from pipeline.datasets.gallery import gallery
from pipeline.errors import InputError


@pytest.fixture(scope="module")
def frame(tmp_path_factory):
    return open_dataset("kitti", "kitti", make_kitti(tmp_path_factory.mktemp("d") / "kitti")).frames()[0]


def test_the_key_tells_frames_levels_and_kernels_apart(frame):
    sharp, camera = frame.image(), CameraSettings()
    one = corrupted(sharp, frame, "dcsn", 10.0, camera, 1)
    assert np.array_equal(one.image, corrupted(sharp, frame, "dcsn", 10.0, camera, 1).image)
    for other in (
        corrupted(sharp, frame, "dcsn", 10.0, camera, 2),
        corrupted(sharp, frame, "dcsn", 10.0, camera, 1, np.ones((1, 1), np.float32), "none"),
    ):
        assert not np.array_equal(one.image, other.image)
    assert "kitti" in one.key


def test_level_zero_is_the_frame_itself(frame):
    sharp = frame.image()
    assert corrupted(sharp, frame, "combined", 0.0, CameraSettings(), 1).image.tobytes() == sharp.tobytes()


def test_camera_settings_come_from_the_configuration():
    section = CameraSection(kind="authors", poisson="hybrid", sensor=SensorSection(model="paper", full_well_e=10000))
    assert CameraSettings.from_section(section) == CameraSettings("authors", "hybrid", Sensor(full_well_e=10000))
    wrong = CameraSection(kind="physical", poisson="exact", sensor=SensorSection(model="paper", full_wel_e=1))
    with pytest.raises(InputError, match="did you mean 'full_well_e'"):
        CameraSettings.from_section(wrong)


def test_gallery_describes_the_arrays_it_holds(frame):
    arrays, described = gallery(frame, ["photon", "dcsn"], [0, 10], CameraSettings(), 1, 15, 11, 128)
    named = [entry["array"] for entry in described["chain"] + described["effects"]]
    assert sorted(named) == sorted(arrays)
    assert {array.shape for array in arrays.values()} == {(128, 128)}
    assert {array.dtype for array in arrays.values()} == {np.dtype(np.uint8)}
    assert np.array_equal(arrays["photon_0"], arrays["dcsn_0"])
