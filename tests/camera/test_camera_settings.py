"""Camera settings: from the configuration, with its sensor's parameters checked."""

import pytest

from pipeline.camera.sensor import Sensor
from pipeline.camera.settings import CameraSettings
from pipeline.config.schema import CameraSection, SensorSection
from pipeline.errors import InputError


def test_camera_settings_come_from_the_configuration():
    section = CameraSection(kind="authors", poisson="hybrid", sensor=SensorSection(model="paper", full_well_e=10000))
    assert CameraSettings.from_section(section) == CameraSettings("authors", "hybrid", Sensor(full_well_e=10000))
    wrong = CameraSection(kind="physical", poisson="exact", sensor=SensorSection(model="paper", full_wel_e=1))
    with pytest.raises(InputError, match="did you mean 'full_well_e'"):
        CameraSettings.from_section(wrong)
