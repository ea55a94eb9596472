"""The kernel that blurs sharp gradients into blurred ones: regularised least squares on a small support.

    k = argmin_k  w (||k * px - bx||^2 + ||k * py - by||^2) + ridge ||k||^2

with circular or zero-padded convolution. The normal equations restricted to the kernel's box need only the
autocorrelation of the gradients at lags within +-(n - 1): the matrix is Toeplitz by blocks. So conjugate
gradients run on a transform of about 2n points, not on the image's, with the same result to rounding.
Stopping after 20 steps from the uniform kernel is part of the regularisation and not an approximation of the
exact minimum.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft

STEPS = 20
TOLERANCE = 1e-5  # of the residual's norm
_DENSE_UP_TO = 17  # kernels this small multiply faster as a dense matrix than through transforms


def _toeplitz(window: NDArray, size: int) -> NDArray:
    """(n^2, n^2) matrix A[i - j] of a (2n - 1)^2 window of lags."""
    down, across = window.strides
    corner = window[size - 1 :, size - 1 :]
    view = np.lib.stride_tricks.as_strided(corner, (size,) * 4, (down, across, -down, -across), writeable=False)
    return view.reshape(size * size, size * size)


class _Operator:
    """x -> (A * x) on the kernel's box, A the window of autocorrelations."""

    def __init__(self, window: NDArray, size: int) -> None:
        self.size = size
        if size <= _DENSE_UP_TO:
            self.matrix = _toeplitz(window, size)
            return
        self.points = fft.next_fast_len(2 * size - 1, real=True)
        around = np.zeros((self.points, self.points), window.dtype)
        around[: 2 * size - 1, : 2 * size - 1] = window
        self.spectrum = fft.rfft2(np.roll(around, (1 - size, 1 - size), axis=(0, 1)))

    def __call__(self, kernel: NDArray) -> NDArray:
        if self.size <= _DENSE_UP_TO:
            return (self.matrix @ kernel.ravel()).reshape(kernel.shape)
        spectrum = fft.rfft2(kernel, s=(self.points, self.points))
        spectrum *= self.spectrum
        return fft.irfft2(spectrum, s=(self.points, self.points), overwrite_x=True)[: self.size, : self.size]


def conjugate_gradients(operator: _Operator, ridge: float, right: NDArray, start: NDArray, steps: int) -> NDArray:
    """Conjugate gradients on (A + ridge) x = right, stopped early.

    Args:
        operator: x -> A x, symmetric and positive semi-definite.
        ridge: added to the diagonal.
        right: right-hand side.
        start: first x.
        steps: at most so many.
    """
    x = start.copy()
    residual = right - operator(x) - ridge * x
    direction = residual.copy()
    power = float(np.vdot(residual, residual))
    for _ in range(steps):
        moved = operator(direction) + ridge * direction
        curvature = float(np.vdot(direction, moved))
        if power <= 0.0 or curvature <= 0.0:  # converged exactly, as coarse levels in float32 do
            break
        length = power / curvature
        x += length * direction
        residual -= length * moved
        before, power = power, float(np.vdot(residual, residual))
        if power**0.5 < TOLERANCE:
            break
        direction *= power / before
        direction += residual
    return x


def _lags(correlation: NDArray, reach: int) -> NDArray:
    """The window of lags -reach..reach of a circular correlation whose lag 0 is at [0, 0]."""
    index = np.arange(-reach, reach + 1)
    return correlation[np.ix_(index % correlation.shape[0], index % correlation.shape[1])]


def solve(
    sharp: NDArray,
    blurred: NDArray,
    size: int,
    *,
    weight: float = 1.0,
    ridge: float,
    pad: int = 0,
    steps: int = STEPS,
) -> NDArray:
    """The kernel, neither clipped nor normalised.

    Args:
        sharp: (2, h, w) horizontal and vertical gradients of the latent image.
        blurred: (2, h, w) those of the blurred image.
        size: n, odd: the kernel is n x n and centred.
        weight: of the data term.
        ridge: of ||k||^2.
        pad: zeros around the gradients, pixels per axis in all; 0 is circular convolution.
        steps: conjugate gradient steps.
    """
    shape = (sharp.shape[1] + pad, sharp.shape[2] + pad)
    latent, observed = fft.rfft2(sharp, s=shape), fft.rfft2(blurred, s=shape)
    power = (latent.real**2 + latent.imag**2).sum(axis=0)
    cross = (latent.conj() * observed).sum(axis=0)
    window = _lags(fft.irfft2(power, s=shape), size - 1) * sharp.dtype.type(weight)
    right = _lags(fft.irfft2(cross, s=shape), size // 2) * sharp.dtype.type(weight)
    start = np.full((size, size), 1.0 / size**2, sharp.dtype)
    return conjugate_gradients(_Operator(window, size), ridge, right, start, steps)
