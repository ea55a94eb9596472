"""GBB: the MTF from a kernel found by graph-based blind deblurring.

Y. Bai, G. Cheung, X. Liu, W. Gao, "Graph-based blind image deblurring from a single photograph", IEEE TIP 2019; used
as a blur estimator in Wischow et al. 2023, Sec. IV. A skeleton image and the kernel are estimated in turn, three
times per level of a coarse-to-fine pyramid, after total-variation denoising.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pipeline.blur.deconvolution import framelet, informative, kernel_update, support
from pipeline.blur.deconvolution.failure import NoKernel
from pipeline.blur.deconvolution.graph import Solver, skeleton
from pipeline.blur.deconvolution.resample import resize
from pipeline.blur.deconvolution.total_variation import denoise
from pipeline.blur.kernel_estimator import Finder, KernelEstimator

SCALE = math.log2(3)  # between levels
COARSEST_KERNEL = 7
ITERATIONS = 3  # per level
DATA_WEIGHT = 25.0
KERNEL_RIDGE = 0.05
RIDGE_DECAY = 1.2  # per iteration, anew at each level
REFINED_LEVELS = 2  # the finest ones, where kernels are made sparse and centred

# fast: no less accurate than exact in benchmarks/blind_deconvolution.py, and 15 to 20 times as fast
SOLVERS = {
    "exact": Solver(),
    "fast": Solver(periodic=True, steps=2, dtype=np.float32),
}


def levels(kernel_size: int, image_size: tuple[int, int]) -> list[tuple[int, tuple[int, int]]]:
    """Kernel size and image size of each level, finest first."""
    count = max(math.ceil(math.log(kernel_size / COARSEST_KERNEL) / math.log(SCALE)), 0) + 1
    results = [(kernel_size, image_size)]
    for _ in range(count - 1):
        size, (height, width) = results[-1]
        smaller = math.floor(size / SCALE)
        results.append((smaller + 1 - smaller % 2, (math.floor(height / SCALE), math.floor(width / SCALE))))
    return results


def find_kernel(images: Sequence[NDArray[np.float64]], kernel_size: int, solver: Solver) -> NDArray:
    """The blur kernel that one or several images share.

    With several, every image has its skeleton and the kernel solves the stacked equations of all of them, their data
    terms averaged.

    Args:
        images: each (h, w) in [0, 1], all of one size and blurred by one kernel.
        kernel_size: odd, pixels.
        solver: of the skeleton image.

    Returns:
        (kernel_size, kernel_size) non-negative, unit sum.

    Raises:
        NoKernel: no image has gradients, or the kernel vanished.
    """
    pyramid = levels(kernel_size, (images[0].shape[0], images[0].shape[1]))
    reduced = [[denoise(image.astype(solver.dtype)) for image in images]]
    for _, shape in pyramid[1:]:
        reduced.append([resize(image, shape, "linear") for image in reduced[-1]])
    kernel: NDArray | None = None
    for level in reversed(range(len(pyramid))):
        size = pyramid[level][0]
        blurred = reduced[level]
        if kernel is None:
            kernel = np.zeros((size, size), solver.dtype)
            kernel[size // 2, size // 2] = 1
        else:
            kernel = support.drop_weak(resize(kernel, (size, size), "linear"))
        slopes = np.concatenate([informative.gradients(image) for image in blurred])
        ridge = KERNEL_RIDGE
        for _ in range(ITERATIONS):
            sharp = np.concatenate(
                [informative.informative_gradients(skeleton(image, kernel, solver)) for image in blurred]
            )
            if not sharp.any():
                raise NoKernel("no structure")
            weight = DATA_WEIGHT / len(images)
            kernel = kernel_update.solve(sharp, slopes, size, weight=weight, ridge=ridge, pad=size - 1)
            kernel = support.drop_weak(kernel)
            if level < REFINED_LEVELS:
                kernel = support.centre_box(support.drop_weak(framelet.keep_largest(kernel)))
            ridge /= RIDGE_DECAY
    assert kernel is not None
    return kernel


class GraphBlindDeblurring(KernelEstimator):
    """Graph-based blind deblurring as a blur estimator; see `KernelEstimator` for options."""

    def finder(self) -> Finder:
        return partial(find_kernel, kernel_size=self.kernel_size, solver=SOLVERS[self.mode])
