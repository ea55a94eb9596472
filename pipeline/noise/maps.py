"""Local noise of a frame: the map an estimator draws, beside the noise really added in each cell's neighbourhood.

Photon noise grows with brightness, so that one number for a frame says little; an estimator that answers cell by cell
is judged by the noise of each place.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pipeline.datasets.corrupted import CameraSettings, corrupted

if TYPE_CHECKING:
    from pipeline.datasets.frame import Frame
    from pipeline.datasets.patches import Patch
    from pipeline.noise.base import NoiseEstimate

CELL_PX = 8
NEIGHBOURHOOD_PX = 40
"""Side of the square whose noise is a cell's truth: 1600 samples tell a standard deviation to 1.8 %."""

SHOWN_EFFECTS = ("photon", "dcsn")


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
        (ceil(H / 8), ceil(W / 8)) DN; NaN where no patch tells.
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
        told = np.isfinite(cells)
        total[y : y + height, x : x + width] += np.where(told, cells, 0.0)
        count[y : y + height, x : x + width] += told
    return np.where(count > 0, total / np.maximum(count, 1), np.nan).astype(np.float32)


def local_truth(noise_dn: NDArray[np.float32]) -> NDArray[np.float32]:
    """Root mean square of the noise about each cell's centre.

    Args:
        noise_dn: (H, W) noise of zero mean, DN.

    Returns:
        (ceil(H / 8), ceil(W / 8)) DN.
    """
    import cv2

    side = (NEIGHBOURHOOD_PX, NEIGHBOURHOOD_PX)
    # In double precision, and never below zero: a running sum leaves rounding where there is no noise.
    power = np.maximum(cv2.blur(np.square(noise_dn, dtype=np.float64), side, borderType=cv2.BORDER_REFLECT_101), 0.0)
    rows, columns = (
        np.minimum(np.arange(CELL_PX // 2, length + CELL_PX // 2, CELL_PX), length - 1) for length in noise_dn.shape
    )
    found: NDArray[np.float32] = np.sqrt(power[np.ix_(rows, columns)]).astype(np.float32)
    return found


def shown_maps(
    frame: Frame, estimator: Any, effects: Sequence[str], level_dn: float, camera: CameraSettings, seed: int
) -> tuple[dict[str, NDArray[Any]], dict[str, Any]] | None:
    """Maps of one frame under photon noise and under noise that knows no brightness.

    Args:
        frame: a sharp frame.
        estimator: of noise; without a ``map`` there is nothing to show.
        effects: that the study uses; the maps take `SHOWN_EFFECTS` of them, or else the first.
        level_dn: standard deviation over the frame asked for, DN.
        camera: the camera that adds the noise.
        seed: root of the random streams.

    Returns:
        arrays ``<effect>_seen`` (H, W) uint8, ``<effect>_added`` and ``<effect>_found`` (h, w) float32 DN, and what
        they are (dataset, frame, level_dn, cell_px, effects); None without a ``map`` of cells.
    """
    if not isinstance(estimator, NoiseMapper):
        return None
    sharp = frame.image()
    arrays: dict[str, NDArray[Any]] = {}
    chosen = [effect for effect in SHOWN_EFFECTS if effect in effects] or list(effects[:1])
    for effect in chosen:
        shown = corrupted(sharp, frame, effect, level_dn, camera, seed)
        found, added = estimator.map(shown.image), local_truth(shown.noise_dn)
        if found.shape != added.shape:  # a map of other cells than ours
            return None
        arrays |= {f"{effect}_seen": shown.image_8bit, f"{effect}_added": added, f"{effect}_found": found}
    said = {"dataset": frame.dataset, "frame": frame.name, "level_dn": level_dn, "cell_px": CELL_PX, "effects": chosen}
    return arrays, said
