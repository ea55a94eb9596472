"""Cell-wise estimator: the sensor's noise of a patch with a 95 % interval, and a map of it, from a small network.

Fixed statistics of every 8 x 8 px cell (`networks.cellwise_features`) go through a small network
(`networks.cellwise_net`), trained on procedural pictures only (`training`). Its output, and how it differs from the
classical estimators:

* sigma is that of the noise *before* the 8-bit range cut it. In a white sky half of the noise is gone; the other half
  tells. (Behind a tone curve it is what black has left of the noise: without light there is none.) Only a patch with
  nearly no pixel left inside the range is abstained from as saturated.
* Noise counts as the sensor added it: what a lens or motion has blurred since (photon noise of a blurred scene in a
  simulation, film grain, a noisy picture resized) does not.
* Fine texture is told from noise by the fall of its spectrum; the less sure, the wider the interval.
* Photon noise is stronger where it is bright, noise behind a tone curve where it is dark: sigma is the root mean square
  over the patch, and `Cellwise.map` gives it for every cell.

It knows 8-bit images; others are rounded to 8 bit first.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.errors import InputError
from pipeline.learning.inference import inference
from pipeline.noise.base import Measured
from pipeline.noise.cell_mapper import CellMapper
from pipeline.noise.maps import CELL_PX
from pipeline.project_files import located
from pipeline.weight_files import active

RELEASED = located("data/weights/sigma_cellwise.safetensors")
SATURATED_FRACTION = 0.98
"""Default fraction of saturated pixels from which a patch is refused: of a white patch with noise, half lie inside."""


class Cellwise(CellMapper):
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
        from pipeline.learning.weights import into, untrained
        from pipeline.noise.networks.cellwise_net import ARCHITECTURE, CellwiseNet

        super().__init__(saturated_fraction)
        if batch < 1:
            raise InputError(f"noise estimator 'cellwise': batch={batch}, expected at least 1")
        network = untrained(CellwiseNet)
        path = weights or active(RELEASED)
        header = into(network, path, ARCHITECTURE)
        self.released = bool(header["released"])
        if not isinstance(header.get("interval"), float):
            raise InputError(f"{path}: holds no interval; train it anew (dvc repro train_sigma_cellwise)")
        self.interval: float = header["interval"]
        self.network = network.eval().to(device)
        self.batch, self.device = batch, device

    def measure_cells(
        self, stack: NDArray[np.floating], reason: NDArray[np.object_]
    ) -> tuple[Measured, NDArray[np.float32]]:
        """See `pipeline.noise.cell_mapper.CellMapper.measure_cells`.

        The ends of the interval are those of ``ln(1 + sigma) +- k b``, at least 0.
        """
        sigma, scale, cells = self._predict(stack)
        middle, reach = np.log1p(sigma), self.interval * scale
        return Measured(sigma, np.maximum(np.expm1(middle - reach), 0.0), np.expm1(middle + reach)), cells

    def _predict(
        self, stack: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float32]]:
        """Sigma (N,) DN, the scale of ln(1 + sigma) (N,), and maps (N, h, w) DN of patches (N, H, W)."""
        import torch

        from pipeline.noise.networks.cellwise_features import features

        count, height, width = len(stack), *(side // CELL_PX for side in stack.shape[1:])
        sigma, scale = np.empty(count), np.empty(count)
        maps = np.empty((count, height, width), np.float32)
        with inference():
            for first in range(0, count, self.batch):
                part = slice(first, first + self.batch)
                pixels = np.rint(stack[part, : height * CELL_PX, : width * CELL_PX] * np.float32(FULL_SCALE_DN))
                result = self.network(
                    *features(torch.from_numpy(pixels.astype(np.float32, copy=False)).to(self.device))
                )
                sigma[part], scale[part], maps[part] = (value.cpu().numpy() for value in result)
        return sigma, scale, maps
