"""PMP: the MTF from a kernel found by blind deblurring with the patch-wise minimal pixels prior.

F. Wen et al., "A simple local minimal intensity prior and an improved algorithm for blind image deblurring",
IEEE TCSVT 2021; used as a blur estimator in Wischow et al. 2023, Sec. IV. Latent image and kernel are estimated in
turn, five times per level of a coarse-to-fine pyramid.
"""

from __future__ import annotations

import math
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


def find_kernel(image: NDArray[np.float64], kernel_size: int, schedule: Schedule) -> NDArray:
    """The blur kernel of an image.

    Args:
        image: (h, w) in [0, 1].
        kernel_size: odd, pixels.
        schedule: of the latent image.

    Returns:
        (kernel_size, kernel_size) non-negative, unit sum, centroid in the middle pixel.

    Raises:
        NoKernel: the image has no gradients, or the kernel vanished.
    """
    block = max(math.floor(BLOCK_FRACTION * sum(image.shape) / 2), 1)
    minima_weight, gradient_weight = MINIMA_WEIGHT, GRADIENT_WEIGHT
    pyramid = levels(kernel_size)
    kernel: NDArray | None = None
    for level in reversed(range(len(pyramid))):
        size, scale = pyramid[level]
        reduced = gaussian_reduce(image, scale)
        if kernel is None:
            kernel = np.zeros((size, size), schedule.dtype)
            # off-centre on purpose: a centred start is a fixed point
            kernel[(size - 1) // 2 - 1, (size - 1) // 2 - 1 : (size - 1) // 2 + 1] = 0.5
            first_threshold = salient.first_threshold(reduced, size)
        else:
            side = math.ceil(len(kernel) / RATIO)
            grown = resize(kernel, (side, side), "cubic", scale=1 / RATIO)
            kernel = support.normalise(fit(np.maximum(grown, 0), size))
        height, width = reduced.shape
        room = [schedule.length(side + size - 1, block) for side in (height, width)]
        wrapped = smooth_wrap(reduced.astype(schedule.dtype), (room[0], room[1]))
        observed = salient.gradients(wrapped[:height, :width])
        threshold = first_threshold
        hard = level + 1 < len(pyramid) / 2
        for _ in range(ITERATIONS):
            latent = latent_image(wrapped, kernel, minima_weight, gradient_weight, block, hard, schedule)
            strong, threshold = salient.select(latent[:height, :width], threshold)
            if not strong.any():
                raise NoKernel("no structure")
            kernel = kernel_update.solve(strong, observed, size, ridge=KERNEL_RIDGE)
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
