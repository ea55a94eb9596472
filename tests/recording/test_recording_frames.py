"""What a recording of frames chooses: grid patches drawn at random over the frame, the same each time."""

from __future__ import annotations

from pathlib import Path

from pipeline.datasets.frame import Frame
from pipeline.datasets.patches import Patch
from pipeline.experiments.frames import TestFrame
from pipeline.recording.frames import _sampled

COLUMNS, ROWS, SIDE_PX = 10, 6, 192


def frame(name: str) -> TestFrame:
    tiles = [Patch(x * SIDE_PX, y * SIDE_PX, SIDE_PX) for y in range(ROWS) for x in range(COLUMNS)]
    return TestFrame(Frame("mine", name, Path(f"{name}.png")), {"mtf": tiles})


def test_patches_of_a_grid_are_of_all_its_columns_and_rows() -> None:
    """Every n-th of ten columns would be one column, the sky of its upper rows among it."""
    drawn = [patch for name in "abcdefgh" for patch in _sampled(frame(name), 6, 1).patches["mtf"]]
    assert len({patch.x_px for patch in drawn}) == COLUMNS and len({patch.y_px for patch in drawn}) == ROWS


def test_the_same_patches_are_drawn_again_and_none_twice() -> None:
    first, again = (_sampled(frame("a"), 6, 1).patches["mtf"] for _ in range(2))
    assert first == again and len(set(first)) == 6
    assert first != _sampled(frame("b"), 6, 1).patches["mtf"] != _sampled(frame("b"), 6, 2).patches["mtf"]


def test_all_are_taken_where_none_are_left_out() -> None:
    assert _sampled(frame("a"), None, 1).patches["mtf"] == frame("a").patches["mtf"]
    assert len(_sampled(frame("a"), 100, 1).patches["mtf"]) == COLUMNS * ROWS
