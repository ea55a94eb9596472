"""Labels against geometry that can be worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.scenes.labels import _area_alone, boxes
from pipeline.scenes.light import Light
from pipeline.scenes.mesh import soup
from pipeline.scenes.objects.base import SceneObject
from pipeline.scenes.pose import Pose
from pipeline.scenes.render import render
from pipeline.scenes.shapes import box
from pipeline.scenes.tone import LINEAR
from pipeline.scenes.world import Placed, World

POSE = Pose((0.0, 0.0, 0.0), focal_px=100.0, width_px=120, height_px=100)
# a thin plate 10 m ahead, 2 m wide and 1 m high: 20 x 10 px around the image centre
PLATE = SceneObject(box([0, -1, -0.5], [0.01, 1, 0.5], "black"), label="car", kind="plate")
SCREEN = SceneObject(box([0, -5, -5], [0.01, 0, 5], "black"))


def labelled(*placed: Placed, samples: int = 3):
    world = World(list(placed))
    picture = render(world, Light(emissive=True), POSE, LINEAR, samples=samples)
    return boxes(world, POSE, picture)


def test_a_plate_in_the_open_is_where_projection_says():
    (result,) = labelled(Placed(PLATE, "car-0", 0.0, (10.0, 0.0, 0.0)))
    assert (result.label, result.name, result.kind) == ("car", "car-0", "plate")
    assert [result.x1, result.y1, result.x2, result.y2] == pytest.approx([50, 45, 70, 55], abs=0.34)
    assert result.amodal == pytest.approx((50, 45, 70, 55), abs=0.02)
    assert result.visible_fraction == pytest.approx(1.0, abs=0.01)
    assert result.pixels == pytest.approx(200, rel=0.02)
    assert result.distance_m == pytest.approx(10.0, abs=1e-3)
    assert result.height_px == pytest.approx(10, abs=0.34)


def test_half_hidden_means_half_visible():
    hidden = labelled(Placed(PLATE, "car-0", 0.0, (10.0, 0.0, 0.0)), Placed(SCREEN, "screen", 0.0, (5.0, 0.0, 0.0)))[0]
    # the screen covers all to the right of the optical axis
    assert [hidden.x1, hidden.x2] == pytest.approx([50, 60], abs=0.34)
    assert hidden.amodal[2] == pytest.approx(70, abs=0.02)
    assert hidden.visible_fraction == pytest.approx(0.5, abs=0.02)


def test_cut_off_by_the_frame_counts_as_hidden():
    (cut,) = labelled(Placed(PLATE, "car-0", 0.0, (10.0, 6.0, 0.0)))
    assert cut.x1 == 0.0 and cut.amodal[0] == pytest.approx(-10, abs=0.05)
    assert cut.x2 == pytest.approx(10, abs=0.34)
    assert cut.visible_fraction == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize("corner", [(-1, -0.5), (-1, 0.5), (1, -0.5), (1, 0.5)])
def test_the_area_of_a_triangle_is_half_of_its_box(corner):
    """Rays half a cell aside would hit 1.5 % more of it, or fewer."""
    y, z = corner
    half = SceneObject(soup([[0, y, z], [0, -y, z], [0, y, -z]], [[0, 1, 2]], "black"))
    area = _area_alone(
        Placed(half, "half", 0.0, (10.0, 0.0, 0.0)), POSE, np.array([50.0, 45.0]), np.array([70.0, 55.0])
    )
    assert area == pytest.approx(100, rel=4e-3)


def test_unlabelled_unseen_and_behind_are_left_out():
    behind = Placed(PLATE, "car-1", 0.0, (-10.0, 0.0, 0.0))
    covered = Placed(PLATE, "car-2", 0.0, (10.0, -3.0, 0.0))
    result = labelled(covered, behind, Placed(SCREEN, "screen", 0.0, (5.0, 0.0, 0.0)))
    assert result == []


def test_boxes_do_not_depend_on_the_number_of_samples_by_more_than_one():
    fine = labelled(Placed(PLATE, "car-0", 0.3, (8.0, 0.5, 0.1)), samples=4)[0]
    coarse = labelled(Placed(PLATE, "car-0", 0.3, (8.0, 0.5, 0.1)), samples=1)[0]
    difference = np.subtract([fine.x1, fine.y1, fine.x2, fine.y2], [coarse.x1, coarse.y1, coarse.x2, coarse.y2])
    assert np.abs(difference).max() <= 1.0


def test_rows_are_rounded_and_plain():
    (result,) = labelled(Placed(PLATE, "car-0", 0.0, (10.0, 0.0, 0.0)))
    row = result.row()
    assert row["label"] == "car" and len(row["box"]) == 4 and len(row["amodal"]) == 4
    assert all(isinstance(value, float) for value in row["box"])
