"""Local noise of a frame: estimators that estimate it cell by cell, and the map of a frame from its patches."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from pipeline.datasets.patches import Patch
    from pipeline.noise.base import NoiseEstimate

CELL_PX = 8


@runtime_checkable
class NoiseMapper(Protocol):
    """An estimator that also answers cell by cell."""

    def map(self, image: NDArray[np.float32]) -> NDArray[np.float32]:
        """(H, W) in [0, 1] to (ceil(H / 8), ceil(W / 8)) DN; NaN where it abstains."""
        ...


@runtime_checkable
class CellEstimator(Protocol):
    """An estimator whose answer for a patch holds one for every cell of it."""

    def estimate_cells(self, patches: NDArray[np.float32]) -> tuple[NoiseEstimate, NDArray[np.float32]]:
        """(N, 1, H, W) to the estimate and (N, H // 8, W // 8) DN; NaN where it abstains."""
        ...


def pasted(
    cells_dn: NDArray[np.float32], squares: Sequence[Patch], frame_shape: tuple[int, int]
) -> NDArray[np.float32]:
    """One map of a frame from the cells of its patches; where patches overlap, their mean.

    A patch that does not begin at a cell's border is laid on a near one, less than 8 px away; one that ends with the
    frame ends with the map.

    Args:
        cells_dn: (N, h, w) of N patches, NaN where unknown.
        squares: where they lie in the frame.
        frame_shape: (H, W).

    Returns:
        (ceil(H / 8), ceil(W / 8)) DN; NaN where no patch has an estimate.
    """
    rows, columns = (-(-length // CELL_PX) for length in frame_shape)
    total, count = np.zeros((rows, columns)), np.zeros((rows, columns))
    for square, cells in zip(squares, cells_dn, strict=True):
        height, width = cells.shape
        y, x = (
            most - side if start + square.size_px == length else min(round(start / CELL_PX), most - side)
            for start, length, most, side in zip(
                (square.y_px, square.x_px), frame_shape, (rows, columns), cells.shape, strict=True
            )
        )
        reported = np.isfinite(cells)
        total[y : y + height, x : x + width] += np.where(reported, cells, 0.0)
        count[y : y + height, x : x + width] += reported
    return np.where(count > 0, total / np.maximum(count, 1), np.nan).astype(np.float32)
