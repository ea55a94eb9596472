"""What the fused estimator joins: MTFs by GBB and PMP of patches that share a blur, beside the spectral network's."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.blur.base import FREQUENCIES
from pipeline.blur.gbb import GraphBlindDeblurring
from pipeline.blur.pmp import PatchwiseMinimalPixels
from pipeline.camera import mtf as camera_mtf


class Deconvolution:
    """GBB and PMP, fast, on patches that share a blur.

    Args:
        kernel_size: see `pipeline.blur.kernel_estimator.KernelEstimator`.
    """

    def __init__(self, kernel_size: int = 31) -> None:
        self.gbb = GraphBlindDeblurring(kernel_size=kernel_size)
        self.pmp = PatchwiseMinimalPixels(kernel_size=kernel_size)

    def __call__(self, patches: NDArray[np.float32]) -> NDArray[np.float64]:
        """MTFs by GBB and PMP, (2, 2, 8); NaN where a kernel is not identifiable.

        Args:
            patches: (N, 1, 192, 192) float32 in [0, 1], blurred alike.
        """
        members = np.full((2, 2, FREQUENCIES), np.nan)
        for index, estimator in enumerate((self.gbb, self.pmp)):
            kernel = estimator.shared_kernel(patches)
            if kernel is not None:
                members[index] = np.clip(camera_mtf.sample(kernel), 0.0, 1.0)
        return members


def join_members(mtf: NDArray[np.floating], others: NDArray[np.floating]) -> NDArray[np.float64]:
    """What the gate joins: (N, 3, 2, 8).

    Args:
        mtf: (N, 2, 8) by the spectral network, which stands in for the others where those have no answer.
        others: (N, 2, 2, 8) by GBB and PMP, or (2, 2, 8) that all share; NaN where abstained.
    """
    every = np.broadcast_to(others, (len(mtf), *others.shape[-3:]))
    spectral = np.asarray(mtf, np.float64)[:, None]
    return np.concatenate([spectral, np.where(np.isnan(every), spectral, every)], axis=1)
