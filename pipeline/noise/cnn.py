"""The paper's learned noise estimator: a network that gives every pixel's sigma; a patch's is their median.

Wischow et al. (T-ITS 2023), after Tan et al. (2019). The network (`networks.cnn_net`) and its loss are the paper's; it
is trained here on procedural pictures and 48 px crops (`training`); the report states its share of the paper's samples.
It has no interval, and white skies, which clip half of the noise away, are abstained from as by the classical
estimators.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.camera.saturation import SATURATED_FRACTION
from pipeline.errors import InputError
from pipeline.learning.inference import inference
from pipeline.noise.base import Estimator, Measured, as_stack
from pipeline.project_files import located
from pipeline.weight_files import active

RELEASED = located("data/weights/sigma_cnn.safetensors")


class PixelCnn(Estimator):
    """See the module.

    Args:
        weights: file of `pipeline.learning.weights`; None for the one that training leaves in ``data/weights``.
        batch: patches computed together.
        device: where, e.g. ``"cpu"`` or ``"cuda"``.
        quantise_like_paper: answer in whole DN (every pixel truncated, then the median), never abstain.
        saturated_fraction: of saturated pixels, (0, 1], from which a patch is refused.

    Raises:
        InputError: weights that are absent, broken or of another network; an option out of range.
    """

    min_size_px = 16

    def __init__(
        self,
        weights: str | Path | None = None,
        *,
        batch: int = 8,
        device: str = "cpu",
        quantise_like_paper: bool = False,
        saturated_fraction: float = SATURATED_FRACTION,
    ) -> None:
        from pipeline.learning.weights import into, untrained
        from pipeline.noise.networks.cnn_net import ARCHITECTURE, PixelNet

        super().__init__(saturated_fraction, quantise_like_paper=quantise_like_paper)
        if batch < 1:
            raise InputError(f"noise estimator 'cnn': batch={batch}, expected at least 1")
        path = Path(weights or active(RELEASED))
        if not path.is_file():
            raise InputError(
                f"noise estimator 'cnn': {path} is absent; train it with"
                " `python -m pipeline.stages.train_sigma --params +job.network=cnn`, or use 'cellwise'"
            )
        network = untrained(PixelNet)
        self.released = bool(into(network, path, ARCHITECTURE)["released"])
        self.network = network.eval().to(device)
        self.batch, self.device = batch, device

    def measure(self, stack: NDArray[np.floating], reason: NDArray[np.object_]) -> Measured:
        """See `pipeline.noise.base.Estimator.measure`."""
        sigma_dn = np.empty(len(stack))
        for first in range(0, len(stack), self.batch):
            maps = self._maps_dn(stack[first : first + self.batch])
            maps = np.trunc(maps) if self.quantise_like_paper else maps
            sigma_dn[first : first + self.batch] = np.median(maps, axis=(1, 2))
        return Measured(sigma_dn)

    def pixel_map(self, image: NDArray[np.floating]) -> NDArray[np.float32]:
        """Sigma of every pixel of an image (H, W) in [0, 1]: (H, W), DN."""
        return self._maps_dn(as_stack(np.asanyarray(image)[None, None], self.min_size_px))[0]

    def _maps_dn(self, stack: NDArray[np.floating]) -> NDArray[np.float32]:
        import torch

        with inference():
            copied = np.array(stack[:, None], dtype=np.float32)  # torch warns of arrays that are read-only
            image = torch.from_numpy(copied).to(self.device)
            result = self.network(image).clamp(0, 1)
            maps: NDArray[np.float32] = result.cpu().numpy() * np.float32(FULL_SCALE_DN)
        return maps
