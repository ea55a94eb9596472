"""Base class of noise estimators that answer for every 8 x 8 px cell of a patch, and their maps of frames."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.noise.base import Estimator, Measured, NoiseEstimate, as_stack, assemble, screen
from pipeline.noise.maps import CELL_PX

if TYPE_CHECKING:
    import torch

TILE_PX = 128
"""Size of patch that the networks were trained on, and of the tiles that a map is made of."""

STEP_PX = 64


class CellMapper(Estimator):
    """Subclasses implement `measure_cells`."""

    @abstractmethod
    def measure_cells(
        self, stack: NDArray[np.floating], reason: NDArray[np.object_]
    ) -> tuple[Measured, NDArray[np.float32]]:
        """Noise levels with their intervals, and a map of each patch.

        Args:
            stack: (N, H, W), see `pipeline.noise.base.Estimator.measure`.
            reason: (N,) likewise.

        Returns:
            the levels, and (N, H // 8, W // 8) DN.
        """

    def measure(self, stack: NDArray[np.floating], reason: NDArray[np.object_]) -> Measured:
        """See `pipeline.noise.base.Estimator.measure`; rows and columns beyond a multiple of 8 px are left out."""
        return self.measure_cells(stack, reason)[0]

    def estimate_cells(self, patches: NDArray[np.floating] | torch.Tensor) -> tuple[NoiseEstimate, NDArray[np.float32]]:
        """The same answer as `estimate`, and with it sigma of every 8 x 8 px cell of each patch, at no further cost.

        Args:
            patches: as for `estimate`.

        Returns:
            the estimate, and (N, H // 8, W // 8) DN, NaN in patches that are abstained from.

        Raises:
            InputError: as for `estimate`.
        """
        stack = as_stack(patches, self.min_size_px)
        reason = screen(stack, self.saturated_fraction)
        measured, cells = self.measure_cells(stack, reason)
        estimate = assemble(measured, reason)
        cells[estimate.abstained] = np.nan
        return estimate, cells

    def map(self, image: NDArray[np.floating] | torch.Tensor) -> NDArray[np.float32]:
        """Local noise of a picture: sigma of every 8 x 8 px cell.

        The picture is judged in overlapping tiles of 128 px and their answers are averaged.

        Args:
            image: (H, W) float in [0, 1], at least `min_size_px` each.

        Returns:
            (ceil(H / 8), ceil(W / 8)) DN; cells that lie only in tiles that are abstained from are NaN.

        Raises:
            InputError: wrong shape, type or range.
        """
        if getattr(image, "ndim", None) != 2:
            raise InputError(f"image: expected (H, W), not {getattr(image, 'shape', type(image).__name__)}")
        picture = as_stack(image[None, None], self.min_size_px)[0]
        padding = [(0, -side % CELL_PX) for side in picture.shape]
        picture = np.pad(picture, padding, mode="reflect")
        rows, columns = picture.shape
        height, width = min(rows, TILE_PX), min(columns, TILE_PX)
        corners = [(y, x) for y in _starts(rows, height) for x in _starts(columns, width)]
        stack = np.stack([picture[y : y + height, x : x + width] for y, x in corners])
        total = np.zeros((rows // CELL_PX, columns // CELL_PX))
        count = np.zeros_like(total)
        for (y, x), cells in zip(corners, self.estimate_cells(stack[:, None])[1], strict=True):
            if np.isfinite(cells).all():  # a tile abstains as a whole
                part = np.s_[y // CELL_PX : (y + height) // CELL_PX, x // CELL_PX : (x + width) // CELL_PX]
                total[part] += cells
                count[part] += 1
        return np.where(count > 0, total / np.maximum(count, 1), np.nan).astype(np.float32)


def _starts(length: int, tile: int) -> list[int]:
    """Where tiles begin along one axis: every `STEP_PX`, the last one at the border."""
    return sorted({*range(0, length - tile, STEP_PX), length - tile})
