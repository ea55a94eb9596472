"""The skeleton image of graph-based blind deblurring: sharp steps without texture.

Y. Bai, G. Cheung, X. Liu, W. Gao, "Graph-based blind image deblurring from a single photograph", IEEE TIP 2019.
The reweighted graph total variation promotes gradients that are either zero or large (a bimodal weight
distribution). It is minimised as a sequence of quadratic problems

    (K'K + 2 mu L) x = K'y,       L = graph Laplacian of the four-neighbour grid,

whose edge weights follow the last solution: w = w1 / max(|d|, 0.01), and after every third solution
w1 = exp(-d^2 / 0.02), d the intensity difference along the edge.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import DTypeLike, NDArray
from scipy import fft

from pipeline.blur.deconvolution.boundary import fast_length, smooth_wrap
from pipeline.blur.deconvolution.minimal_pixels import kernel_spectrum

GRAPH_WEIGHT = 0.01  # mu
LEAST_DIFFERENCE = 0.01
EDGE_VARIANCE = 0.02  # (0.1 sqrt 2)^2
REWEIGHTINGS = 3
SOLUTIONS = 3  # per reweighting


@dataclass(frozen=True)
class Solver:
    """How the quadratic problems are solved.

    Attributes:
        periodic: on a periodic extension of the image instead of a replicated border; two transforms per step
            instead of four.
        steps: conjugate gradient steps per solution.
        warm: start from the solution before, instead of from the blurred image every time.
        dtype: float64 or float32.
    """

    periodic: bool = False
    steps: int = 20
    warm: bool = False
    dtype: DTypeLike = np.float64


class Blur(Protocol):
    """Blurring by one kernel, and the grid's differences, on an extended image."""

    def adjoint(self, image: NDArray) -> NDArray:
        """K'x."""
        ...

    def normal(self, image: NDArray) -> NDArray:
        """K'K x."""
        ...

    def differences(self, image: NDArray) -> tuple[NDArray, NDArray]:
        """Intensity differences along horizontal and vertical edges."""
        ...

    def divergence(self, across: NDArray, down: NDArray) -> NDArray:
        """Sum at each pixel of what its edges carry: D'(w D x)."""
        ...


class ReplicatedBlur:
    """Image borders replicated without end. (h, w) images; edges (h, w - 1) and (h - 1, w)."""

    def __init__(self, kernel: NDArray, shape: tuple[int, int]) -> None:
        self.size, self.shape = len(kernel), shape
        self.points = [fast_length(side + self.size - 1) for side in shape]
        self.forward = fft.rfft2(kernel, s=self.points)
        self.backward = fft.rfft2(kernel[::-1, ::-1], s=self.points)

    def _convolve(self, image: NDArray, transfer: NDArray) -> NDArray:
        padded = np.pad(image, self.size // 2, mode="edge")
        full = fft.irfft2(fft.rfft2(padded, s=self.points) * transfer, s=self.points)
        first = self.size - 1
        return full[first : first + self.shape[0], first : first + self.shape[1]]

    def adjoint(self, image: NDArray) -> NDArray:
        return self._convolve(image, self.backward)

    def normal(self, image: NDArray) -> NDArray:
        return self.adjoint(self._convolve(image, self.forward))

    def differences(self, image: NDArray) -> tuple[NDArray, NDArray]:
        return np.diff(image, axis=1), np.diff(image, axis=0)

    def divergence(self, across: NDArray, down: NDArray) -> NDArray:
        result = np.zeros(self.shape, across.dtype)
        result[:, :-1] -= across
        result[:, 1:] += across
        result[:-1] -= down
        result[1:] += down
        # Of the two directed edges between a border pixel and its neighbour, the adjoint of a replicating filter
        # loses one: the border sees its edge once, all other pixels twice.
        result[:, 0] += across[:, 0] / 2
        result[:, -1] -= across[:, -1] / 2
        result[0] += down[0] / 2
        result[-1] -= down[-1] / 2
        return result


class PeriodicBlur:
    """A periodic (h, w) image; edges (h, w) in both directions, the last ones joining opposite borders."""

    def __init__(self, kernel: NDArray, shape: tuple[int, int]) -> None:
        self.shape = shape
        self.transfer = kernel_spectrum(kernel, shape)
        self.power = self.transfer.real**2 + self.transfer.imag**2
        self.across, self.down, self.result = (np.empty(shape, kernel.dtype) for _ in range(3))

    def _times(self, image: NDArray, factor: NDArray) -> NDArray:
        spectrum = fft.rfft2(image)
        spectrum *= factor
        return fft.irfft2(spectrum, s=self.shape, overwrite_x=True)

    def adjoint(self, image: NDArray) -> NDArray:
        return self._times(image, self.transfer.conj())

    def normal(self, image: NDArray) -> NDArray:
        return self._times(image, self.power)

    def differences(self, image: NDArray) -> tuple[NDArray, NDArray]:
        """As in the protocol; the arrays are overwritten by the next call."""
        np.subtract(image[:, 1:], image[:, :-1], out=self.across[:, :-1])
        np.subtract(image[:, 0], image[:, -1], out=self.across[:, -1])
        np.subtract(image[1:], image[:-1], out=self.down[:-1])
        np.subtract(image[0], image[-1], out=self.down[-1])
        return self.across, self.down

    def divergence(self, across: NDArray, down: NDArray) -> NDArray:
        """As in the protocol; the array is overwritten by the next call."""
        result = self.result
        np.subtract(across[:, :-1], across[:, 1:], out=result[:, 1:])
        np.subtract(across[:, -1], across[:, 0], out=result[:, 0])
        result[1:] += down[:-1]
        result[0] += down[-1]
        result -= down
        return result


def _solve(blur: Blur, right: NDArray, weights: tuple[NDArray, NDArray], start: NDArray, steps: int) -> NDArray:
    """Conjugate gradients on (K'K + 2 mu L) x = right; x (not the residual) is clipped to [0, 1] at every step."""

    def operator(image: NDArray) -> NDArray:
        across, down = blur.differences(image)
        across, down = across * weights[0], down * weights[1]
        result = blur.divergence(across, down)
        result *= 2 * GRAPH_WEIGHT
        result += blur.normal(image)
        return result

    x = start.copy()
    residual = right - operator(x)
    direction = residual.copy()
    power = float(np.vdot(residual, residual))
    for _ in range(steps):
        moved = operator(direction)
        curvature = float(np.vdot(direction, moved))
        if power <= 0.0 or curvature <= 0.0:  # solved exactly, as flat images are
            break
        length = x.dtype.type(power / curvature)
        x += length * direction
        np.clip(x, 0, 1, out=x)
        moved *= length
        residual -= moved
        before, power = power, float(np.vdot(residual, residual))
        direction *= x.dtype.type(power / before)
        direction += residual
    return x


def _inverse(differences: tuple[NDArray, NDArray]) -> list[NDArray]:
    return [1 / np.maximum(np.abs(edge), LEAST_DIFFERENCE) for edge in differences]


def skeleton(blurred: NDArray, kernel: NDArray, solver: Solver) -> NDArray:
    """The skeleton of a blurred image, given the kernel.

    Args:
        blurred: (h, w) in [0, 1].
        kernel: (n, n) centred, unit sum.
        solver: how.

    Returns:
        (h, w) in [0, 1].
    """
    size = len(kernel)
    height, width = blurred.shape
    blur: Blur
    if solver.periodic:
        extended = smooth_wrap(blurred, (fast_length(height + size - 1), fast_length(width + size - 1)))
        blur, corner = PeriodicBlur(kernel, extended.shape), 0
    else:
        extended = np.pad(blurred, size, mode="edge")
        blur, corner = ReplicatedBlur(kernel, extended.shape), size
    right = blur.adjoint(extended)
    base = [np.ones_like(edge) for edge in blur.differences(extended)]
    weights = (base[0], base[1])
    image = extended
    for _ in range(REWEIGHTINGS):
        for _ in range(SOLUTIONS):
            image = _solve(blur, right, weights, image if solver.warm else extended, solver.steps)
            inverse = _inverse(blur.differences(image))
            weights = (base[0] * inverse[0], base[1] * inverse[1])
        base = [np.exp(-(edge**2) / EDGE_VARIANCE) for edge in blur.differences(image)]
        weights = (base[0] * inverse[0], base[1] * inverse[1])
    return image[corner : corner + height, corner : corner + width]
