"""Camera settings: from the configuration, with its sensor's parameters checked; described as there."""

import pytest
from pydantic import TypeAdapter, ValidationError

from pipeline.camera.sensor import SENSORS, Sensor, described, named
from pipeline.camera.settings import CameraSettings


def read(**content):
    return TypeAdapter(CameraSettings).validate_python(content)


def test_camera_settings_come_from_the_configuration():
    given = {"kind": "authors", "poisson": "hybrid", "sensor": {"model": "paper", "full_well_e": 10000}}
    assert read(**given) == CameraSettings("authors", "hybrid", Sensor(full_well_e=10000))


@pytest.mark.parametrize(
    ("sensor", "message"),
    [
        ({"model": "paper", "full_wel_e": 1}, "did you mean 'full_well_e'"),
        ({"model": "papr"}, "did you mean 'paper'"),
        ({"model": "paper", "full_well_e": "much"}, "full_well_e: expected a number"),
        ({"model": "paper", "full_well_e": -1.0}, "full_well_e"),
    ],
)
def test_a_wrong_sensor_is_refused_with_a_hint(sensor, message):
    with pytest.raises(ValidationError, match=message):
        read(sensor=sensor)


@pytest.mark.parametrize("model", SENSORS)
def test_settings_are_described_as_the_configuration_writes_them(model):
    content = {"kind": "physical", "poisson": "exact", "order": "detector", "light": "linear"}
    assert read(**content, sensor={"model": model}).described() == content | {"sensor": {"model": model}}
    changed = named(model, full_well_e=12345.0)
    assert described(changed) == {"model": model, "full_well_e": 12345.0}
