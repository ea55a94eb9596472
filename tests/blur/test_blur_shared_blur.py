"""Patches that are blurred alike are grouped by their MTF estimates."""

import numpy as np
import pytest

from pipeline.blur import shared_blur
from pipeline.streams import stream

SCALE = 0.03


def answers(count, level, seed):
    """Estimates of one blur with Laplace errors."""
    errors = stream(seed, "test shared blur").laplace(0, 0.5 * SCALE, (count, 2, 8))
    return np.clip(level + errors, 0, 1)


def test_equal_blurs_are_one_group():
    mtf = answers(7, 0.4, 1)
    (group,) = shared_blur.groups(mtf, np.full_like(mtf, SCALE))
    assert group.tolist() == list(range(7))


def test_a_patch_with_its_own_blur_is_its_own_group():
    mtf = answers(7, 0.4, 2)
    mtf[3] = 0.75
    groups = shared_blur.groups(mtf, np.full_like(mtf, SCALE))
    assert [group.tolist() for group in groups] == [[0, 1, 2, 4, 5, 6], [3]]


def test_few_patches_with_blurs_of_their_own_do_not_move_the_one_of_the_others():
    mtf = answers(7, 0.3, 3)
    mtf[[1, 5]] = 0.95
    groups = shared_blur.groups(mtf, np.full_like(mtf, SCALE))
    assert [group.tolist() for group in groups] == [[0, 2, 3, 4, 6], [1], [5]]


def test_less_than_half_that_agree_are_no_group():
    mtf = np.stack([np.full((2, 8), level) for level in (0.1, 0.3, 0.5, 0.51, 0.7, 0.9)])
    assert [len(group) for group in shared_blur.groups(mtf, np.full_like(mtf, SCALE))] == [1] * 6


@pytest.mark.parametrize("count", [1, 2, 5])
def test_different_blurs_are_single(count):
    mtf = np.repeat(np.linspace(0.1, 0.9, count)[:, None, None], 16, axis=1).reshape(count, 2, 8)
    groups = shared_blur.groups(mtf, np.full_like(mtf, SCALE))
    assert sorted(int(group[0]) for group in groups) == list(range(count))
    assert all(len(group) == 1 for group in groups)


def test_wide_estimates_agree_where_narrow_ones_do_not():
    mtf = np.stack([np.full((2, 8), level) for level in (0.3, 0.4, 0.5)])
    assert len(shared_blur.groups(mtf, np.full_like(mtf, 0.1))) == 1
    assert len(shared_blur.groups(mtf, np.full_like(mtf, 0.01))) == 3


def test_no_patches_no_groups():
    assert shared_blur.groups(np.empty((0, 2, 8)), np.empty((0, 2, 8))) == []


def test_chosen_patches_are_spread_from_first_to_last():
    assert shared_blur.spread(np.arange(10), 4).tolist() == [0, 3, 6, 9]
    assert shared_blur.spread([5, 7], 4).tolist() == [5, 7]
    assert shared_blur.spread([5, 7, 9], 1).tolist() == [5]
