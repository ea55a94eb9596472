"""Camera pose: rays and projection are inverse to each other, and the axes are what they say."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.scenes.pose import Pose

angles = st.floats(-1.2, 1.2)


@given(heading=st.floats(-3.1, 3.1), pitch=angles, roll=angles, focal=st.floats(300, 2000))
def test_a_point_along_a_ray_projects_to_where_the_ray_began(heading, pitch, roll, focal):
    pose = Pose((3.0, -2.0, 1.5), heading, pitch, roll, focal, 200, 120)
    columns, rows = np.array([0.5, 99.5, 180.25]), np.array([3.5, 60.0, 119.5])
    rays = pose.rays(columns, rows).astype(np.float64)
    assert np.allclose(np.linalg.norm(rays, axis=1), 1.0, atol=1e-6)
    at, ahead = pose.project(np.asarray(pose.position_m) + 17.0 * rays)
    expected = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    assert np.allclose(at, expected, atol=2e-3)
    assert (ahead > 0).all()


def test_axes_are_right_handed_and_level_without_roll():
    right, up, ahead = Pose((0, 0, 0), heading_rad=0.3, pitch_rad=0.2).axes()
    assert np.allclose(np.cross(right, up), -ahead, atol=1e-6)
    assert abs(right[2]) < 1e-7
    assert ahead[2] > 0 and up[2] > 0


def test_left_is_left_and_up_is_up_in_the_image():
    pose = Pose((0, 0, 0), width_px=100, height_px=80)
    at, _ = pose.project([[10, 1, 0], [10, 0, 1], [10, 0, 0]])
    assert at[0, 0] < 50 and at[1, 1] < 40
    assert np.allclose(at[2], [50, 40])


def test_what_lies_behind_has_no_place_in_the_image():
    at, ahead = Pose((0, 0, 0)).project([[-5, 0, 0]])
    assert np.isnan(at).all() and ahead[0] < 0


def test_roll_lowers_the_right_side():
    pose = Pose((0, 0, 0), roll_rad=0.1)
    assert pose.axes()[0][2] < 0
