"""The configured scenarios: what the comparison of policies is made on, and where drives begin."""

from __future__ import annotations

from pathlib import Path

import composed
import pytest

from pipeline.control import setup
from pipeline.control.simulation.scenario import Flicker, Scenario
from pipeline.control.state import CameraState, Limits
from pipeline.errors import InputError

ROOT = Path(__file__).resolve().parents[2]
IN_GOOD_LIGHT = {"start_dark", "start_bright", "small_sun"}
"""Their light is half of daylight or more; in ``standing`` nothing moves."""


def drive(light, speed_px_s, start=None, **options):
    knots = ([(float(step), value) for step, value in points] for points in (light, speed_px_s))
    return Scenario("test", 4, *map(tuple, knots), start=start or CameraState.of(8, 100), **options)


@pytest.mark.parametrize("profile", ["default", "smoke"])
def test_the_comparison_is_made_on_the_scenarios_with_motion_in_poor_light(profile):
    section = composed.config(f"profile={profile}").control
    drives = {name: setup.scenario(name, settings) for name, settings in section.scenarios.items()}
    demanding = {name for name, each in drives.items() if each.motion_in_poor_light}
    assert demanding == set(drives) - IN_GOOD_LIGHT - {"standing"} and len(demanding) == 10


@pytest.mark.parametrize(
    ("light", "speed_px_s", "demanding"),
    [
        ([(0, 0.25)], [(0, 100)], True),
        ([(0, 0.26)], [(0, 2_000)], False),
        ([(0, 0.01)], [(0, 99)], False),
        ([(0, 1), (3, 0.25)], [(0, 100)], True),  # at the last step
        ([(0, 1), (4, 0.25)], [(0, 100)], False),  # a frame behind it
        ([(0, 1), (1, 1), (2, 0.1)], [(0, 500), (1, 500), (2, 0)], False),  # never at the same step
    ],
)
def test_motion_in_poor_light_is_at_a_step_a_quarter_of_daylight_and_100_px_per_s(light, speed_px_s, demanding):
    assert drive(light, speed_px_s).motion_in_poor_light is demanding


def test_flicker_makes_no_poor_light():
    lamp = drive([(0, 0.4)], [(0, 500)], flicker=Flicker(100.0, 1.0))
    assert not lamp.motion_in_poor_light and min(lamp.light_at(step, 1e-4) for step in range(4)) < 0.25


@pytest.mark.parametrize("start", [CameraState.of(33.1, 100), CameraState.of(0.04, 100), CameraState.of(8, 3300)])
def test_a_drive_begins_within_the_limits_of_its_camera(start):
    words = "scenario 'test': start: .* lies outside the camera's limits; expected 0.05 to 33 ms and ISO 100 to 3200"
    with pytest.raises(InputError, match=words):
        drive([(0, 1)], [(0, 0)], start).first_state(Limits())


def test_a_drive_begins_on_the_steps_of_its_camera():
    limits = Limits(exposure_steps_per_stop=6, gain_step_db=1.0)
    for start in (CameraState.of(0.05, 100), CameraState.of(33, 3200), CameraState.of(8, 250)):
        first = drive([(0, 1)], [(0, 0)], start).first_state(limits)
        assert limits.accepts(first) and first == limits.nearest(start.exposure_s, start.gain)
