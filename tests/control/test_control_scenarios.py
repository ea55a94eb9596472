"""The configured scenarios: what the comparison of policies is made on."""

from __future__ import annotations

from pathlib import Path

import composed

from pipeline.control import setup

ROOT = Path(__file__).resolve().parents[2]
POOR_LIGHT, MOVING_PX_S = 0.25, 100.0


def test_motion_in_poor_light_is_flagged_by_its_definition():
    """At some step at most a quarter of daylight, and 100 px/s or more."""
    for profile in ("default", "smoke"):
        section = composed.config(f"profile={profile}").control
        flagged = []
        for name, settings in section.scenarios.items():
            drive = setup.scenario(name, settings)
            steady = [(drive.light_at(step, 1.0), drive.speed_at(step)) for step in range(drive.steps)]
            demanding = any(light <= POOR_LIGHT * 1.01 and speed >= MOVING_PX_S for light, speed in steady)
            assert drive.motion_in_poor_light == demanding, name
            flagged.append(drive.motion_in_poor_light)
        assert {True, False} == set(flagged)
