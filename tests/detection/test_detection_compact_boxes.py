"""Boxes on a grid, overlaps, and which cell answers for which object."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pipeline.detection.compact import boxes
from pipeline.detection.compact.assignment import ABSENT, IGNORED, assign
from pipeline.detection.matching import overlaps

CORNERS, SIDES = st.floats(0, 100), st.floats(1, 60)


def box(x: float, y: float, width: float, height: float) -> torch.Tensor:
    return torch.tensor([[x, y, x + width, y + height]])


BOXES = st.builds(box, CORNERS, CORNERS, SIDES, SIDES)


@given(BOXES, BOXES)
def test_overlap_is_that_of_the_judge(one: torch.Tensor, two: torch.Tensor) -> None:
    expected = overlaps(one.numpy().astype(float), two.numpy().astype(float), 0.0)
    expected = expected[0] if isinstance(expected, tuple) else expected
    assert float(boxes.overlap(one, two)[0, 0]) == pytest.approx(float(np.ravel(expected)[0]), abs=1e-4)


@given(BOXES, BOXES)
def test_generalised_overlap_never_exceeds_the_plain_one(one: torch.Tensor, two: torch.Tensor) -> None:
    value = float(boxes.generalised_overlap(one, two)[0])
    assert -1.0 - 1e-4 <= value <= float(boxes.overlap(one, two)[0, 0]) + 1e-4
    assert float(boxes.generalised_overlap(one, one)[0]) == pytest.approx(1, abs=1e-5)


def test_generalised_overlap_falls_with_distance() -> None:
    values = [float(boxes.generalised_overlap(box(0, 0, 10, 10), box(x, 0, 10, 10))[0]) for x in (10, 20, 40, 80)]
    assert values == sorted(values, reverse=True)
    assert values[-1] < -0.7


def test_a_cell_spells_a_box_around_its_centre() -> None:
    centres, strides = boxes.cells(64, 96, (8, 16, 32))
    assert len(centres) == 8 * 12 + 4 * 6 + 2 * 3
    assert centres[0].tolist() == [4, 4]
    assert centres[1].tolist() == [12, 4]
    assert centres[-1].tolist() == [80, 48]
    spelled = boxes.spelled(torch.zeros(len(centres), 4), centres, strides)
    assert spelled[0].tolist() == [-4, -4, 12, 12]
    assert spelled[-1].tolist() == [48, 16, 112, 80]
    assert bool(torch.isfinite(boxes.spelled(torch.full((len(centres), 4), 1e4), centres, strides)).all())


def assigned(truth: list[list[float]], kind: list[int], good: int = 0):
    """Cells that all say 'a box of two strides around me, class 0 with probability 1/2', on a 96 x 64 grid."""
    centres, strides = boxes.cells(64, 96, (8, 16, 32))
    result = boxes.spelled(torch.zeros(1, len(centres), 4), centres, strides)
    probability = torch.full((1, len(centres), 2), 0.5)
    return assign(probability, result, centres, strides, torch.tensor([truth]), torch.tensor([kind])), result, centres


def test_the_cell_with_the_best_box_is_wished_its_overlap() -> None:
    goal, result, _ = assigned([[8.0, 8.0, 24.0, 24.0]], [1])
    over = boxes.overlap(torch.tensor([[8.0, 8.0, 24.0, 24.0]]), result[0])[0]
    best = int(goal.probability[0, :, 1].argmax())
    assert float(over[best]) == float(over[goal.taken[0]].max())
    assert float(goal.probability[0, best, 1]) == pytest.approx(float(over[best]), abs=1e-5)
    assert float(goal.probability[0, :, 0].sum()) == 0
    assert 1 <= int(goal.taken.sum()) <= 10


def test_an_object_without_a_cell_inside_is_taken_by_its_neighbours() -> None:
    goal, _, centres = assigned([[9.0, 9.0, 11.0, 11.0]], [0])  # between cell centres
    assert int(goal.taken.sum()) >= 1
    assert float((centres[goal.taken[0]] - 10).abs().max()) < 8


def test_a_cell_claimed_twice_goes_to_the_better_overlap() -> None:
    small, large = [8.0, 8.0, 24.0, 24.0], [0.0, 0.0, 96.0, 64.0]
    goal, result, _ = assigned([small, large], [0, 1])
    over = boxes.overlap(torch.tensor([small, large]), result[0])
    for cell in torch.nonzero(goal.taken[0]).ravel().tolist():
        owner = 0 if goal.box[0, cell].tolist() == small else 1
        claimed = float(over[owner, cell])
        if owner == 1:
            continue
        assert claimed >= float(over[1, cell])


def test_nothing_is_wished_for_absent_or_ignored_objects_and_ignored_ground_does_not_count() -> None:
    goal, _, centres = assigned([[8.0, 8.0, 40.0, 40.0], [0.0, 0.0, 0.0, 0.0]], [IGNORED, ABSENT])
    assert int(goal.taken.sum()) == 0
    assert float(goal.probability.sum()) == 0
    inside = ((centres > 8) & (centres < 40)).all(1)
    assert torch.equal(goal.counted[0], ~inside)
