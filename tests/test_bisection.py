"""Where a condition begins to hold."""

import math

import pytest

from pipeline.bisection import bisected


def test_the_number_from_which_on_a_condition_holds() -> None:
    assert bisected(lambda x: x * x >= 2.0, 0.0, 2.0, 40) == pytest.approx(math.sqrt(2.0), abs=2.0 / 2**41)


def test_every_halving_halves_the_error_allowed() -> None:
    for halvings in range(12):
        assert abs(bisected(lambda x: x >= 0.3, 0.0, 1.0, halvings) - 0.3) <= 1.0 / 2 ** (halvings + 1)


@pytest.mark.parametrize(("holds", "end"), [(True, 1.0), (False, 3.0)])
def test_a_condition_that_does_not_change_gives_an_end(holds: bool, end: float) -> None:
    assert bisected(lambda x: holds, 1.0, 3.0, 50) == pytest.approx(end, abs=1e-12)
