"""Windows of one picture that overlap are one scene; others, also flat ones, are scenes of their own."""

import numpy as np
import pytest

from pipeline.blur.calibration import overlap
from pipeline.learning import images


@pytest.fixture(scope="module")
def pictures():
    """Procedural pictures of 400 px."""
    return [images.picture(index, 5, "test overlap", 400).astype(np.float32) / 255 for index in range(3)]


def window(picture, x, y):
    return picture[y : y + 192, x : x + 192]


@pytest.mark.parametrize("shift", [(63, 0), (0, 63), (63, 63), (100, 30), (1, 120)])
def test_windows_that_overlap_are_one_scene(pictures, shift):
    patches = np.stack([window(pictures[0], 0, 0), window(pictures[1], 7, 9), window(pictures[0], *shift)])
    assert overlap.scenes(patches).tolist() == [0, 1, 0]


def test_windows_side_by_side_and_of_other_pictures_are_not(pictures):
    patches = np.stack([window(pictures[0], 0, 0), window(pictures[0], 192, 0), window(pictures[1], 0, 0)])
    assert overlap.scenes(patches).tolist() == [0, 1, 2]


def test_chains_are_one_scene_whatever_their_order(pictures):
    ends = [window(pictures[2], x, 0) for x in (0, 208)]
    assert overlap.scenes(np.stack(ends)).tolist() == [0, 1]
    assert overlap.scenes(np.stack([*ends, window(pictures[1], 0, 0), window(pictures[2], 104, 0)])).tolist() == [
        0,
        0,
        1,
        0,
    ]


def test_flat_patches_have_nothing_in_common(pictures):
    flat = np.full((192, 192), 0.5, np.float32)
    assert overlap.scenes(np.stack([flat, flat, window(pictures[0], 0, 0)])).tolist() == [0, 1, 2]


def test_many_patches_are_not_compared(pictures):
    patches = np.repeat(window(pictures[0], 0, 0)[None], overlap.MOST_PATCHES + 1, axis=0)
    assert overlap.scenes(patches).tolist() == list(range(overlap.MOST_PATCHES + 1))
    assert overlap.scenes(patches[1:]).tolist() == [0] * overlap.MOST_PATCHES
