"""Windows of one picture that overlap are one scene; others, also flat ones, are scenes of their own."""

import numpy as np
import pytest

from pipeline.blur import overlap
from pipeline.learning import images
from pipeline.streams import stream


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


def pairwise_scenes(patches):
    """The definition: each patch compared with each, run by run."""
    runs = []
    for patch in patches:
        levels = np.rint(patch * 255).astype(np.uint8)
        windows = np.lib.stride_tricks.sliding_window_view(levels, overlap.RUN_PX, axis=1).reshape(-1, overlap.RUN_PX)
        runs.append({run.tobytes() for run in windows[np.ptp(windows, axis=1) >= overlap.LEAST_RANGE_DN]})
    label = np.arange(len(patches))
    for second in range(len(patches)):
        for first in range(second):
            fewer = min(len(runs[first]), len(runs[second]))
            if fewer and len(runs[first] & runs[second]) / fewer >= overlap.LEAST_SHARE:
                earlier, later = sorted((label[first], label[second]))
                label[label == later] = earlier
    return np.unique(label, return_inverse=True)[1].tolist()


@pytest.mark.parametrize("seed", range(6))
def test_scenes_are_those_of_a_comparison_of_every_pair(pictures, seed):
    """Windows anywhere, some of them flat but for a strip, or black and white."""
    generator = stream(seed, "test overlap windows")
    patches = []
    for _ in range(24):
        patch = window(pictures[generator.integers(3)], *generator.integers(0, 209, 2)).copy()
        kind, strip_px = generator.integers(6), generator.integers(0, 24)
        if kind == 0:
            patch[strip_px:] = 0.5
        elif kind == 1:
            patch[:, strip_px:] = 0.2
        elif kind == 2:
            patch = np.rint(patch)
        patches.append(patch)
    patches = np.stack(patches)
    assert overlap.scenes(patches).tolist() == pairwise_scenes(patches)


def test_patches_that_just_overlap_are_one_scene():
    """9 of 192 rows are less than 5 % of the runs, 10 are more."""
    generator = stream(0, "test overlap rows")
    first, *others = generator.random((9, 192, 192), dtype=np.float32)
    for rows, other in zip((9, 10) * 4, others, strict=True):
        other[:rows] = first[-rows:]
    assert overlap.scenes(np.stack([first, *others])).tolist() == [0, 1, 0, 2, 0, 3, 0, 4, 0]


def test_any_number_of_patches_is_compared(pictures):
    """Beyond 40 patches every window was a scene of its own."""
    generator = stream(0, "test overlap many")
    number = np.arange(90) % 3
    patches = [window(pictures[index], *generator.integers(0, 209, 2)) for index in number]
    assert overlap.scenes(np.stack(patches)).tolist() == number.tolist()


def test_no_patches_have_no_scenes():
    assert overlap.scenes(np.empty((0, 192, 192), np.float32)).tolist() == []
    assert overlap.scenes(np.full((2, 192, 192), 0.5, np.float32)).tolist() == [0, 1]
