"""Cell-wise estimator: the sensor's noise of a patch with a 95 % interval, and a map of it, from a small network.

Fixed statistics of every 8 x 8 px cell (`cellwise_features`) go through a small network (`cellwise_net`), trained on
procedural pictures only (`training`). What it says, and how it differs from the classical estimators:

* sigma is that of the noise *before* the 8-bit range cut it. In a white sky half of the noise is gone; the other half
  tells. Only a patch with nearly no pixel left inside the range is abstained from as saturated.
* Noise counts as the sensor added it: what a lens or motion has blurred since (photon noise of a blurred scene in a
  simulation, film grain, a noisy picture resized) does not.
* Fine texture is told from noise by the fall of its spectrum; the less sure, the wider the interval.
* Photon noise is stronger where it is bright: `Cellwise.map` gives sigma for every cell.

It knows 8-bit images; others are rounded to 8 bit first.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.camera.saturation import SATURATED
from pipeline.errors import InputError
from pipeline.noise.base import Estimator, Measured, NoiseEstimate, as_stack, assemble, screen
from pipeline.noise.cellwise_features import CELL_PX
from pipeline.project_files import located
from pipeline.weight_files import active

if TYPE_CHECKING:
    import torch

RELEASED = located("data/weights/sigma_cellwise.safetensors")
TILE_PX = 128
"""Size of patch the network was trained on, and of the tiles that a map is made of."""

STEP_PX = 64
SATURATED_FRACTION = 0.98
"""Default fraction of saturated pixels from which a patch is refused: of a white patch with noise, half lie inside."""


class Cellwise(Estimator):
    """See the module.

    Args:
        weights: file of `pipeline.learning.weights`; None for the released one.
        batch: patches computed together (8 fit the cache of a core).
        device: where, e.g. ``"cpu"`` or ``"cuda"``.
        saturated_fraction: of saturated pixels, (0, 1], from which a patch is refused.

    Raises:
        InputError: weights that are absent, broken or of another network; an option out of range.
    """

    min_size_px = 32

    def __init__(
        self,
        weights: str | Path | None = None,
        *,
        batch: int = 8,
        device: str = "cpu",
        saturated_fraction: float = SATURATED_FRACTION,
    ) -> None:
        from pipeline.learning.weights import into
        from pipeline.noise.cellwise_net import ARCHITECTURE, CellwiseNet

        super().__init__(saturated_fraction)
        if batch < 1:
            raise InputError(f"noise estimator 'cellwise': batch={batch}, expected at least 1")
        network = CellwiseNet()
        path = weights or active(RELEASED)
        header = into(network, path, ARCHITECTURE)
        self.released = bool(header["released"])
        if not isinstance(header.get("interval"), float):
            raise InputError(f"{path}: says nothing of its interval; train it anew (dvc repro train_sigma_cellwise)")
        self.interval: float = header["interval"]
        self.network = network.eval().to(device)
        self.batch, self.device = batch, device

    def measure(self, stack: NDArray[np.floating], reason: NDArray[np.object_]) -> Measured:
        """See `pipeline.noise.base.Estimator.measure`.

        Rows and columns beyond a multiple of 8 px are left out. The ends of the interval are those of
        ``ln(1 + sigma) +- k b``, at least 0.
        """
        return self._measure_cells(stack)[0]

    def estimate_cells(self, patches: NDArray[np.floating] | torch.Tensor) -> tuple[NoiseEstimate, NDArray[np.float32]]:
        """The same answer, and with it sigma of every 8 x 8 px cell of each patch, at no further cost.

        Args:
            patches: as for `estimate`.

        Returns:
            the estimate, and (N, H // 8, W // 8) DN, NaN in patches abstained from as saturated.

        Raises:
            InputError: as for `estimate`.
        """
        stack = as_stack(patches, self.min_size_px)
        reason = screen(stack, self.saturated_fraction)
        measured, cells = self._measure_cells(stack)
        cells[reason == SATURATED] = np.nan
        return assemble(measured.sigma_dn, reason, measured.low_dn, measured.high_dn), cells

    def map(self, image: NDArray[np.floating] | torch.Tensor) -> NDArray[np.float32]:
        """Local noise of a picture: sigma of every 8 x 8 px cell.

        The picture is judged in overlapping tiles of 128 px and their answers are averaged.

        Args:
            image: (H, W) float in [0, 1], at least 32 px each.

        Returns:
            (ceil(H / 8), ceil(W / 8)) DN; cells with nearly no pixel inside the range in tiles that are abstained
            from are NaN.

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
        maps = self._predict(stack)[2]
        kept = screen(stack, self.saturated_fraction) != SATURATED
        total = np.zeros((rows // CELL_PX, columns // CELL_PX))
        count = np.zeros_like(total)
        for (y, x), found, good in zip(corners, maps, kept, strict=True):
            if good:
                part = np.s_[y // CELL_PX : (y + height) // CELL_PX, x // CELL_PX : (x + width) // CELL_PX]
                total[part] += found
                count[part] += 1
        return np.where(count > 0, total / np.maximum(count, 1), np.nan).astype(np.float32)

    def _measure_cells(self, stack: NDArray[np.floating]) -> tuple[Measured, NDArray[np.float32]]:
        """Noise levels with their intervals, and maps (N, H // 8, W // 8) DN, of patches (N, H, W)."""
        sigma, scale, cells = self._predict(stack)
        middle, reach = np.log1p(sigma), self.interval * scale
        return Measured(sigma, np.maximum(np.expm1(middle - reach), 0.0), np.expm1(middle + reach)), cells

    def _predict(
        self, stack: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float32]]:
        """Sigma (N,) DN, the scale of ln(1 + sigma) (N,), and maps (N, h, w) DN of patches (N, H, W)."""
        import torch

        from pipeline.noise.cellwise_features import features

        count, height, width = len(stack), *(side // CELL_PX for side in stack.shape[1:])
        sigma, scale = np.empty(count), np.empty(count)
        maps = np.empty((count, height, width), np.float32)
        with torch.inference_mode():
            for first in range(0, count, self.batch):
                part = slice(first, first + self.batch)
                pixels = np.rint(stack[part, : height * CELL_PX, : width * CELL_PX] * np.float32(FULL_SCALE_DN))
                found = self.network(*features(torch.from_numpy(pixels.astype(np.float32, copy=False)).to(self.device)))
                sigma[part], scale[part], maps[part] = (value.cpu().numpy() for value in found)
        return sigma, scale, maps


def _starts(length: int, tile: int) -> list[int]:
    """Where tiles begin along one axis: every `STEP_PX`, the last one at the border."""
    return sorted({*range(0, length - tile, STEP_PX), length - tile})
