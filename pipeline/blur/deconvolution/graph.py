"""The skeleton image of graph-based blind deblurring: sharp steps without texture.

Y. Bai, G. Cheung, X. Liu, W. Gao, "Graph-based blind image deblurring from a single photograph", IEEE TIP 2019.
The reweighted graph total variation promotes gradients that are either zero or large (a bimodal weight
distribution). It is minimised as a sequence of quadratic problems (`graph_problems`) whose edge weights follow the
last solution: w = w1 / max(|d|, 0.01), and after every third solution w1 = exp(-d^2 / 0.02), d the intensity
difference along the edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import DTypeLike, NDArray

from pipeline.blur.deconvolution.graph_problems import PeriodicProblem, Problem, ReplicatedProblem

LEAST_DIFFERENCE = 0.01
EDGE_VARIANCE = 0.02  # (0.1 sqrt 2)^2
REWEIGHTINGS = 3
SOLUTIONS = 3  # per reweighting


@dataclass(frozen=True)
class Solver:
    """How the quadratic problems are solved.

    Attributes:
        periodic: on a periodic extension of the image, preconditioned, each solution starting from the one before;
            instead of with a replicated border, plainly, always starting from the blurred image.
        steps: conjugate gradient steps per solution.
        dtype: float64 or float32.
    """

    periodic: bool = False
    steps: int = 20
    dtype: DTypeLike = np.float64


def skeleton(blurred: NDArray, kernel: NDArray, solver: Solver) -> NDArray:
    """The skeleton of a blurred image, given the kernel.

    Args:
        blurred: (h, w) in [0, 1].
        kernel: (n, n) centred, unit sum.
        solver: how.

    Returns:
        (h, w) in [0, 1].
    """
    problem: Problem = (PeriodicProblem if solver.periodic else ReplicatedProblem)(blurred, kernel, solver.steps)
    base: list[NDArray] = []
    weights = problem.uniform()
    for _ in range(REWEIGHTINGS):
        for _ in range(SOLUTIONS):
            image = problem.solve(weights)
            sizes = [np.abs(edge) for edge in problem.differences(image)]
            inverse = [1 / np.maximum(size, LEAST_DIFFERENCE) for size in sizes]
            factors = [item * other for item, other in zip(base, inverse, strict=True)] if base else inverse
            weights = (factors[0], factors[1])
        base = [np.exp(size * size * size.dtype.type(-1 / EDGE_VARIANCE)) for size in sizes]
        weights = (base[0] * inverse[0], base[1] * inverse[1])
    return problem.crop(image)
