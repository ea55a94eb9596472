"""Squares of a frame that it is estimated on: all of a frame of common size, an even selection of a larger one.

Noise and blur of a frame are medians over its tiles and its patches. Beyond some tens of them a median hardly changes,
because neighbouring squares share brightness, texture, lens and what the camera did to them, while time grows with
their number (``benchmarks/health.py`` compares selections with all):

    noise   135 tiles of 128 px cover a full-HD frame; 6 x 9 of them give the same median within a tenth of a DN,
            unless most of them abstain
    blur    60 patches of 192 px cover it; 4 x 7 of them give the same MTF well within its interval
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.datasets.patches import Patch, tiles
from pipeline.errors import InputError

MOST_TILES = 54
"""Of 128 px, for noise."""

MOST_PATCHES = 28
"""Of 192 px, for blur: as many as cover a frame of 1280 x 720 px."""

STEP_PX = 8  # tiles of two blocks or more begin at multiples of it, where the blocks of a codec begin


def frame_tiles(frame_shape: Sequence[int], size_px: int, most: int = MOST_TILES) -> list[Patch]:
    """Square tiles of a frame, row by row from the top.

    Where no more than `most` cover the frame, those (`pipeline.datasets.patches.tiles`). Else a grid of fewer rows and
    columns, in about the same ratio, whose tiles lie apart at even distances from border to border.

    Args:
        frame_shape: (H, W).
        size_px: side of a tile; smaller frames get one tile of their smaller side.
        most: number of tiles, at least 1.

    Returns:
        tiles inside the frame.

    Raises:
        InputError: `most` under 1, or a size that is none.
    """
    if most < 1:
        raise InputError(f"tiles of a frame: at most {most} wanted, expected at least 1")
    side = min(size_px, *frame_shape)
    every = tiles(frame_shape, side, "cover")
    if len(every) <= most:
        return every
    rows = len({tile.y_px for tile in every})
    columns = len(every) // rows
    chosen = min(
        ((down, min(columns, most // down)) for down in range(1, min(rows, most) + 1)),
        key=lambda grid: max(rows / grid[0], columns / grid[1]),  # the wider of the distances
    )
    step = STEP_PX if side >= 2 * STEP_PX else 1  # smaller ones may lie less than a block apart
    down, along = (_starts(length - side, count, step) for length, count in zip(frame_shape, chosen, strict=True))
    return [Patch(x, y, side) for y in down for x in along]


def _starts(last: int, count: int, step: int) -> list[int]:
    """Even starts from 0 to `last`, at multiples of `step` but for the last; the middle where there is one."""
    even = np.linspace(0, last, count) if count > 1 else np.array([last / 2])
    return [last if start == last and count > 1 else int(start) // step * step for start in even]
