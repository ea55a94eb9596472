"""What the kernel-finding estimators share: options, patches in parallel, abstentions, and the MTF of kernels."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.blur.base import PATCH_PX, BlurEstimate, Estimator, unusable
from pipeline.blur.deconvolution.failure import NoKernel
from pipeline.camera import mtf
from pipeline.errors import InputError, did_you_mean
from pipeline.executor import run_map

Finder = Callable[[Sequence[NDArray[np.float64]]], NDArray]

EDGE_DN_PER_PX, EDGE_QUANTILE, NOISE_SCALE_PX = 1.5, 0.995, 1.0
SMALLEST_KERNEL, LARGEST_KERNEL = 7, 63  # pixels; larger ones leave too little of a patch inside


def lacks_edges(patch: NDArray[np.float32]) -> bool:
    """Whether a (h, w) patch has slopes only, such as a shaded sky: its kernel is not identifiable.

    The 99.5 % quantile of the gradient magnitude, after a Gaussian of 1 px against noise, is under 1.5 DN per pixel;
    patches on objects stay above 5 even under 21 px of defocus.
    """
    smooth = cv2.GaussianBlur(patch, (0, 0), NOISE_SCALE_PX)
    across, down = np.diff(smooth, axis=1)[:-1], np.diff(smooth, axis=0)[:, :-1]
    return float(np.quantile(np.hypot(across, down), EDGE_QUANTILE)) * 255.0 < EDGE_DN_PER_PX


def _double(patch: NDArray[np.float32]) -> NDArray[np.float64]:
    """The patch in double precision; 8-bit values become exact again.

    Both algorithms branch on thresholds, so that rounding 8-bit values to float32 shows in the kernel.
    """
    levels = patch.astype(np.float64) * 255.0
    whole = np.rint(levels)
    return (whole if np.abs(levels - whole).max() < 1e-4 else levels) / 255.0


def _kernel_or_reason(patch: NDArray[np.float32], find: Finder) -> NDArray | str:
    try:
        return find([_double(patch)])
    except NoKernel as error:
        return str(error)


class KernelEstimator(Estimator):
    """An estimator that finds a blur kernel and answers its MTF.

    Args:
        mode: "exact" (float64, reproduces the original program) or "fast" (float32, a cheaper schedule).
        kernel_size: side of the kernel, odd, pixels. 31 in the paper's text; its programs use 25.
        workers: processes that share the patches.

    Raises:
        InputError: an unknown mode, an even or extreme kernel size, or no worker.
    """

    modes: tuple[str, ...] = ("exact", "fast")

    def __init__(self, mode: str = "fast", kernel_size: int = 31, workers: int = 1) -> None:
        if mode not in self.modes:
            raise InputError(f"mode={mode!r}: {did_you_mean(str(mode), self.modes)}")
        if not isinstance(kernel_size, int) or kernel_size % 2 == 0:
            raise InputError(f"kernel_size={kernel_size!r}: expected an odd whole number of pixels, e.g. 31")
        if not SMALLEST_KERNEL <= kernel_size <= LARGEST_KERNEL:
            raise InputError(f"kernel_size={kernel_size}: expected {SMALLEST_KERNEL} to {LARGEST_KERNEL} pixels")
        if not isinstance(workers, int) or workers < 1:
            raise InputError(f"workers={workers!r}: expected a whole number of at least 1")
        self.mode, self.kernel_size, self.workers = mode, kernel_size, workers

    @abstractmethod
    def finder(self) -> Finder:
        """A picklable function from images that share a blur, (h, w) float64 in [0, 1], to their one kernel.

        It may raise `NoKernel`.
        """

    def shared_kernel(self, patches: NDArray[np.float32]) -> NDArray | None:
        """The one kernel of several patches that are blurred alike, from the stacked equations of all of them.

        Args:
            patches: (N, 1, 192, 192) float32 in [0, 1], N at least 1.

        Returns:
            (k, k) with unit sum; None where no patch has edges, or no kernel is identifiable.
        """
        reasons = unusable(patches)
        usable = [
            patch[0] for patch, why in zip(patches, reasons, strict=True) if not why and not lacks_edges(patch[0])
        ]
        try:
            return self.finder()([_double(patch) for patch in usable]) if usable else None
        except NoKernel:
            return None

    def measure(self, patches: NDArray[np.float32], reason: NDArray[np.str_]) -> BlurEstimate:
        """See `Estimator.measure`; one kernel per patch that is not abstained from."""
        count, size = len(patches), self.kernel_size
        kernels = np.full((count, size, size), np.nan, np.float64 if self.mode == "exact" else np.float32)
        answer = np.full((count, *mtf.sample(np.ones((1, 1))).shape), np.nan)
        reasons = [
            str(why) or ("no edges" if lacks_edges(patch[0]) else "")
            for why, patch in zip(reason, patches, strict=True)
        ]
        usable = [index for index, why in enumerate(reasons) if not why]
        result = run_map(
            partial(_kernel_or_reason, find=self.finder()),
            [patches[index].reshape(PATCH_PX, PATCH_PX) for index in usable],
            workers=self.workers,
            label="blur kernels",
        )
        for index, kernel in zip(usable, result, strict=True):
            if isinstance(kernel, str):
                reasons[index] = kernel
            else:
                kernels[index] = kernel
                answer[index] = np.clip(mtf.sample(kernel), 0.0, 1.0)
        return BlurEstimate(
            mtf=answer,
            abstained=np.array([bool(why) for why in reasons], dtype=bool),
            reason=np.array(reasons, dtype=np.str_),
            kernel=kernels,
        )
