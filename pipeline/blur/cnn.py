"""CNN estimator: the paper's learned estimator, with features averaged over consecutive frames.

The network is the paper's to the letter (`networks.cnn_net`); the weights are our own (`training.cnn`), since the
published ones cannot be redistributed and were trained on photographs. It has no interval.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import as_array
from pipeline.blur.base import SHARP_FLOOR, BlurEstimate, Estimator, as_patches, unusable
from pipeline.errors import InputError
from pipeline.learning.inference import inference
from pipeline.project_files import located
from pipeline.weight_files import active

RELEASED = located("data/weights/mtf_cnn.safetensors")


class Cnn(Estimator):
    """See the module.

    Args:
        weights: file of `pipeline.learning.weights`; None for the released one.
        batch: patches computed together.
        device: where, e.g. ``"cpu"`` or ``"cuda"``.

    Raises:
        InputError: a weight file that is absent, broken or of another network, or a batch under 1.
    """

    def __init__(self, weights: str | Path | None = None, *, batch: int = 16, device: str = "cpu") -> None:
        import torch

        from pipeline.blur.networks.cnn_net import ARCHITECTURE, MtfCnn
        from pipeline.learning.weights import into, untrained

        if batch < 1:
            raise InputError(f"blur estimator 'cnn': batch={batch}, expected at least 1")
        self.batch, self.device = batch, device
        network = untrained(MtfCnn)
        self.released = bool(into(network, weights or active(RELEASED), ARCHITECTURE)["released"])
        self.network = network.eval().to(device, memory_format=torch.channels_last)  # type: ignore[call-overload]

    def measure(self, patches: NDArray[np.float32], reason: NDArray[np.str_]) -> BlurEstimate:
        """The uncalibrated answer from single frames; see `pipeline.blur.base.Estimator.measure`."""
        return self._answer(patches[:, None], reason)

    def estimate_sequences(self, patches: Any) -> BlurEstimate:
        """The MTF of places seen in several consecutive frames (the paper: four).

        Args:
            patches: (N, F, 1, 192, 192) float in [0, 1], NumPy or torch.

        Returns:
            one answer per place; abstains where any of its frames is flat or saturated.

        Raises:
            InputError: the patches are not as expected.
        """
        array = np.asarray(as_array(patches))
        if array.ndim != 5 or array.shape[1] < 1:
            raise InputError(f"patches: shape {array.shape}, expected (places, frames, 1, 192, 192)")
        count, frames = array.shape[:2]
        flat = as_patches(array.reshape(-1, *array.shape[2:]))
        reasons = unusable(flat).reshape(count, frames)
        bad = (reasons != "").any(axis=1)
        first = reasons[np.arange(count), (reasons != "").argmax(axis=1)]
        result = self._answer(flat.reshape(count, frames, *flat.shape[1:]), np.where(bad, first, ""))
        if self.sharp_mtf is None:
            return result
        return replace(result, mtf=np.clip(result.mtf / np.maximum(self.sharp_mtf, SHARP_FLOOR), 0.0, 1.0))

    def weights_sha256(self) -> dict[str, str]:
        """See `pipeline.blur.estimator_identity.HasNetworks`."""
        from pipeline.learning.weights import tensors_sha256

        return {"network": tensors_sha256(self.network.state_dict())}

    def _answer(self, patches: NDArray[np.float32], reason: NDArray[np.str_]) -> BlurEstimate:
        """Answers for (N, F, 1, 192, 192)."""
        import torch

        count, frames = patches.shape[:2]
        positions = max(self.batch // frames, 1)
        mtf = np.empty((count, 2, 8), np.float32)
        with inference():
            for first in range(0, count, positions):
                part = patches[first : first + positions, :, 0].reshape(-1, *patches.shape[3:])
                # A copy where the caller's array is read-only: torch warns of these.
                image = torch.from_numpy(np.require(part, requirements=["C", "W"])).to(self.device)
                mtf[first : first + positions] = self.network.both_directions(image, frames).cpu().numpy()
        abstained = reason != ""
        mtf[abstained] = np.nan
        return BlurEstimate(mtf, abstained, reason)
