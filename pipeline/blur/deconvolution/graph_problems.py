"""The quadratic problems of graph-based deblurring, exact and fast.

(K'K + 2 mu L) x = K'y,     L the weighted Laplacian of the four-neighbour grid, K the blur
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from pipeline.blur.deconvolution.boundary import fast_length, smooth_wrap
from pipeline.blur.deconvolution.periodic import Differences, kernel_spectrum, laplacian_spectrum, power

GRAPH_WEIGHT = 0.01  # mu

Edges = tuple[NDArray, NDArray]
"""Values on the horizontal and on the vertical edges of the grid."""


class Problem(Protocol):
    """One blurred image and kernel, to be solved for a sequence of edge weights."""

    def differences(self, image: NDArray) -> Edges:
        """Intensity differences along the edges; valid until the next call."""
        ...

    def uniform(self) -> Edges:
        """Weights of 1."""
        ...

    def solve(self, weights: Edges) -> NDArray:
        """The skeleton for these weights, extended as the problem is; in [0, 1]."""
        ...

    def crop(self, image: NDArray) -> NDArray:
        """The part that was given."""
        ...


class ReplicatedProblem:
    """Borders replicated without end; edges (h, w - 1) and (h - 1, w)."""

    def __init__(self, blurred: NDArray, kernel: NDArray, steps: int) -> None:
        self.size, self.steps = len(kernel), steps
        self.extended = np.pad(blurred, self.size, mode="edge")
        self.points = [fast_length(side + self.size - 1) for side in self.extended.shape]
        self.forward = fft.rfft2(kernel, s=self.points)
        self.backward = fft.rfft2(kernel[::-1, ::-1], s=self.points)
        self.right = self._convolve(self.extended, self.backward)

    def _convolve(self, image: NDArray, transfer: NDArray) -> NDArray:
        padded = np.pad(image, self.size // 2, mode="edge")
        full = fft.irfft2(fft.rfft2(padded, s=self.points) * transfer, s=self.points)
        first = self.size - 1
        return full[first : first + image.shape[0], first : first + image.shape[1]]

    def uniform(self) -> Edges:
        across, down = self.differences(self.extended)
        return np.ones_like(across), np.ones_like(down)

    def differences(self, image: NDArray) -> Edges:
        return np.diff(image, axis=1), np.diff(image, axis=0)

    def _operator(self, image: NDArray, weights: Edges) -> NDArray:
        """(K'K + 2 mu L) x."""
        across, down = (edge * weight for edge, weight in zip(self.differences(image), weights, strict=True))
        laplacian = np.zeros_like(image)
        laplacian[:, :-1] -= across
        laplacian[:, 1:] += across
        laplacian[:-1] -= down
        laplacian[1:] += down
        # Of the two directed edges between a border pixel and its neighbour, the adjoint of a replicating filter
        # loses one: the border sees its edge once, all other pixels twice.
        laplacian[:, 0] += across[:, 0] / 2
        laplacian[:, -1] -= across[:, -1] / 2
        laplacian[0] += down[0] / 2
        laplacian[-1] -= down[-1] / 2
        return self._convolve(self._convolve(image, self.forward), self.backward) + 2 * GRAPH_WEIGHT * laplacian

    def solve(self, weights: Edges) -> NDArray:
        """Conjugate gradients from the blurred image; x, not the residual, is clipped to [0, 1] at every step."""
        x = self.extended.copy()
        residual = self.right - self._operator(x, weights)
        direction = residual.copy()
        size = float(np.vdot(residual, residual))
        for _ in range(self.steps):
            moved = self._operator(direction, weights)
            curvature = float(np.vdot(direction, moved))
            if size <= 0.0 or curvature <= 0.0:  # solved exactly, as flat images are
                break
            length = size / curvature
            x = np.clip(x + length * direction, 0, 1)
            residual -= length * moved
            before, size = size, float(np.vdot(residual, residual))
            direction = residual + size / before * direction
        return x

    def crop(self, image: NDArray) -> NDArray:
        return image[self.size : -self.size, self.size : -self.size]


class PeriodicProblem:
    """A periodic extension; edges (h, w) in both directions, the last ones joining opposite borders.

    Blurring is diagonal in the Fourier domain, and the Laplacian would be if all weights were equal to their mean.
    That inverse preconditions the conjugate gradients: two steps find kernels at least as accurate as ten plain ones
    do, with a fifth of the transforms.
    """

    def __init__(self, blurred: NDArray, kernel: NDArray, steps: int) -> None:
        self.steps, self.given = steps, (blurred.shape[0], blurred.shape[1])
        self.number = blurred.dtype.type
        room = [fast_length(side + len(kernel) - 1) for side in self.given]
        self.image = smooth_wrap(blurred, (room[0], room[1]))
        self.shape = (room[0], room[1])
        transfer = kernel_spectrum(kernel, self.shape)
        self.power = power(transfer)
        self.smoothness = laplacian_spectrum(self.shape, blurred.dtype)
        self.grid = Differences(self.shape, blurred.dtype)
        spectrum = fft.rfft2(self.image)
        self.right = fft.irfft2(spectrum * transfer.conj(), s=self.shape)
        self.blurred_twice = fft.irfft2(spectrum * self.power, s=self.shape)  # K'K x of the image so far

    def uniform(self) -> Edges:
        return np.ones_like(self.image), np.ones_like(self.image)

    def differences(self, image: NDArray) -> Edges:
        return self.grid.of(image)

    def _laplacian(self, image: NDArray, weights: Edges) -> NDArray:
        """2 mu L x; valid until the next call."""
        across, down = self.grid.of(image)
        across *= weights[0]
        down *= weights[1]
        result = self.grid.adjoint(across, down)
        result *= self.number(2 * GRAPH_WEIGHT)
        return result

    def solve(self, weights: Edges) -> NDArray:
        """Preconditioned conjugate gradients from the solution before; x is clipped to [0, 1] at every step.

        K'K x is carried along by linearity, which leaves out what clipping changes: a fraction of the transforms is
        saved and the error decays, since every solution weighs it anew.
        """
        mean = self.number(GRAPH_WEIGHT * (float(weights[0].mean()) + float(weights[1].mean())))
        inverse = 1 / (self.power + mean * self.smoothness)
        residual = self.right - self.blurred_twice
        residual -= self._laplacian(self.image, weights)
        direction = np.zeros_like(residual)
        spectrum = np.zeros_like(inverse, dtype=np.result_type(inverse, 1j))
        before = np.inf
        for step in range(self.steps):
            conditioned = fft.rfft2(residual)
            conditioned *= inverse
            spatial = fft.irfft2(conditioned, s=self.shape)
            size = float(np.vdot(residual, spatial))
            if size <= 0.0:  # solved exactly, as flat images are
                break
            direction *= self.number(size / before)
            direction += spatial
            spectrum *= self.number(size / before)
            spectrum += conditioned
            before = size
            twice = fft.irfft2(spectrum * self.power, s=self.shape, overwrite_x=True)
            moved = self._laplacian(direction, weights)
            moved += twice
            curvature = float(np.vdot(direction, moved))
            if curvature <= 0.0:
                break
            length = self.number(size / curvature)
            self.image += length * direction
            np.clip(self.image, 0, 1, out=self.image)
            twice *= length
            self.blurred_twice += twice
            if step + 1 < self.steps:
                moved *= length
                residual -= moved
        return self.image

    def crop(self, image: NDArray) -> NDArray:
        return image[: self.given[0], : self.given[1]]
