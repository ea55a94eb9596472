"""The paper's learned noise estimator: a network that gives every pixel's sigma; a patch's is their median.

Wischow et al. (T-ITS 2023), after Tan et al. (2019). The network (`cnn_net`) and its loss are the paper's; it is
trained here on procedural pictures and 48 px crops (`training`), a small share of the paper's budget. It has no
interval, and white skies, which clip half of the noise away, are abstained from as by the classical estimators.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.noise.base import (
    SATURATED_FRACTION,
    WHITE_DN,
    NoiseEstimate,
    as_published,
    as_stack,
    assemble,
    check_fraction,
    screen,
)

if TYPE_CHECKING:
    import torch

RELEASED = Path(__file__).resolve().parents[2] / "data/weights/sigma_cnn.safetensors"
LEAST_PX = 16


class PixelCnn:
    """See the module.

    Args:
        weights: file of `pipeline.learning.weights`; None for the one that training leaves in ``data/weights``.
        batch: patches computed together.
        device: where, e.g. ``"cpu"`` or ``"cuda"``.
        quantise_like_paper: answer in whole DN (every pixel truncated, then the median), never abstain.
        saturated_fraction: share of clipped pixels, (0, 1], from which a patch is refused.

    Raises:
        InputError: weights that are absent, broken or of another network; an option out of range.
    """

    def __init__(
        self,
        weights: str | Path | None = None,
        *,
        batch: int = 8,
        device: str = "cpu",
        quantise_like_paper: bool = False,
        saturated_fraction: float = SATURATED_FRACTION,
    ) -> None:
        from pipeline.learning.weights import into
        from pipeline.noise.cnn_net import ARCHITECTURE, PixelNet

        if batch < 1:
            raise InputError(f"noise estimator 'cnn': batch={batch}, expected at least 1")
        path = Path(weights or RELEASED)
        if not path.is_file():
            raise InputError(
                f"noise estimator 'cnn': {path} is absent; train it with"
                " `python -m pipeline.stages.train_sigma --params +job.network=cnn`, or use 'cellwise'"
            )
        network = PixelNet()
        into(network, path, ARCHITECTURE)
        self.network = network.eval().to(device)
        self.batch, self.device, self.quantise_like_paper = batch, device, quantise_like_paper
        self.saturated_fraction = check_fraction("saturated_fraction", saturated_fraction)

    def estimate(self, patches: NDArray[np.floating] | torch.Tensor) -> NoiseEstimate:
        """See `pipeline.noise.base.NoiseEstimator.estimate`; patches of at least 16 x 16 px."""
        stack = as_stack(patches, LEAST_PX)
        sigma_dn = np.empty(len(stack))
        for first in range(0, len(stack), self.batch):
            maps = self._maps_dn(stack[first : first + self.batch])
            maps = np.trunc(maps) if self.quantise_like_paper else maps
            sigma_dn[first : first + self.batch] = np.median(maps, axis=(1, 2))
        if self.quantise_like_paper:
            return as_published(sigma_dn)
        return assemble(sigma_dn, screen(stack, self.saturated_fraction))

    def map(self, image: NDArray[np.floating]) -> NDArray[np.float32]:
        """Sigma of every pixel of an image (H, W) in [0, 1]: (H, W), DN."""
        return self._maps_dn(as_stack(np.asarray(image)[None, None], LEAST_PX))[0]

    def _maps_dn(self, stack: NDArray[np.floating]) -> NDArray[np.float32]:
        import torch

        with torch.inference_mode():
            image = torch.from_numpy(np.ascontiguousarray(stack[:, None], dtype=np.float32)).to(self.device)
            found = self.network(image).clamp(0, 1)
            maps: NDArray[np.float32] = found.cpu().numpy() * np.float32(WHITE_DN)
        return maps
