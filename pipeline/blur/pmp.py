"""PMP: the MTF from a kernel found by blind deblurring with the patch-wise minimal pixels prior.

F. Wen et al., "A simple local minimal intensity prior and an improved algorithm for blind image deblurring",
IEEE TCSVT 2021; used as a blur estimator in Wischow et al. 2023, Sec. IV. Latent image and kernel are estimated in
turn, five times per level of a coarse-to-fine pyramid.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pipeline.blur.deconvolution import kernel_update, salient, support
from pipeline.blur.deconvolution.boundary import smooth_wrap
from pipeline.blur.deconvolution.failure import NoKernel
from pipeline.blur.deconvolution.minimal_pixels import Schedule, latent_image
from pipeline.blur.deconvolution.resample import fit, gaussian_reduce, resize
from pipeline.blur.kernel_estimator import Finder, KernelEstimator

MINIMA_WEIGHT = 0.1  # lambda
GRADIENT_WEIGHT = 4e-3  # mu
WEIGHT_DECAY = 1.1
LEAST_MINIMA_WEIGHT, LEAST_GRADIENT_WEIGHT = 0.01, 1e-4
ITERATIONS = 5  # per level
KERNEL_RIDGE = 2.0
BLOCK_FRACTION = 0.025  # of the mean image side
COARSEST_KERNEL = 5
RATIO = math.sqrt(0.5)

# fast: no less accurate than exact in benchmarks/blind_deconvolution.py, and about 5 times as fast
SCHEDULES = {
    "exact": Schedule(),
    "fast": Schedule(inner=1, last_penalty=1e3, aligned=True, dtype=np.float32),
}


def levels(kernel_size: int) -> list[tuple[int, float]]:
    """Kernel size and image scale of each level, finest first."""
    count = max(math.floor(math.log(COARSEST_KERNEL / kernel_size) / math.log(RATIO)), 0) + 1
    scales = [RATIO**level for level in range(count)]
    sizes = [math.ceil(kernel_size * scale) for scale in scales]
    return [(size + 1 - size % 2, scale) for size, scale in zip(sizes, scales, strict=True)]


def find_kernel(images: Sequence[NDArray[np.float64]], kernel_size: int, schedule: Schedule) -> NDArray:
    """The blur kernel that one or several images share.

    With several, every image has its latent image and its gradient threshold, and the kernel solves the stacked
    equations of all of them, their data terms averaged.

    Args:
        images: each (h, w) in [0, 1], all of one size and blurred by one kernel.
        kernel_size: odd, pixels.
        schedule: of the latent image.

    Returns:
        (kernel_size, kernel_size) non-negative, unit sum, centroid in the middle pixel.

    Raises:
        NoKernel: no image has gradients, or the kernel vanished.
    """
    block = max(math.floor(BLOCK_FRACTION * sum(images[0].shape) / 2), 1)
    minima_weight, gradient_weight = MINIMA_WEIGHT, GRADIENT_WEIGHT
    pyramid = levels(kernel_size)
    kernel: NDArray | None = None
    for level in reversed(range(len(pyramid))):
        size, scale = pyramid[level]
        reduced = [gaussian_reduce(image, scale) for image in images]
        if kernel is None:
            kernel = np.zeros((size, size), schedule.dtype)
            # off-centre on purpose: a centred start is a fixed point
            kernel[(size - 1) // 2 - 1, (size - 1) // 2 - 1 : (size - 1) // 2 + 1] = 0.5
            first_thresholds = [salient.first_threshold(image, size) for image in reduced]
        else:
            side = math.ceil(len(kernel) / RATIO)
            grown = resize(kernel, (side, side), "cubic", scale=1 / RATIO)
            kernel = support.normalise(fit(np.maximum(grown, 0), size))
        height, width = reduced[0].shape
        room = [schedule.length(side + size - 1, block) for side in (height, width)]
        wrapped = [smooth_wrap(image.astype(schedule.dtype), (room[0], room[1])) for image in reduced]
        observed = np.concatenate([salient.gradients(image[:height, :width]) for image in wrapped])
        thresholds = list(first_thresholds)
        hard = level + 1 < len(pyramid) / 2
        for _ in range(ITERATIONS):
            strong = []
            for index, image in enumerate(wrapped):
                latent = latent_image(image, kernel, minima_weight, gradient_weight, block, hard, schedule)
                selected, thresholds[index] = salient.select(latent[:height, :width], thresholds[index])
                strong.append(selected)
            sharp = np.concatenate(strong)
            if not sharp.any():
                raise NoKernel("no structure")
            kernel = kernel_update.solve(sharp, observed, size, weight=1 / len(images), ridge=KERNEL_RIDGE)
            kernel = support.drop_islands(support.drop_weak(kernel))
            minima_weight = max(minima_weight / WEIGHT_DECAY, LEAST_MINIMA_WEIGHT)
            gradient_weight = max(gradient_weight / WEIGHT_DECAY, LEAST_GRADIENT_WEIGHT)
        kernel = support.centre_mass(kernel)
    assert kernel is not None
    return support.drop_weak(kernel)


class PatchwiseMinimalPixels(KernelEstimator):
    """The patch-wise minimal pixels prior as a blur estimator; see `KernelEstimator` for options."""

    def finder(self) -> Finder:
        return partial(find_kernel, kernel_size=self.kernel_size, schedule=SCHEDULES[self.mode])
