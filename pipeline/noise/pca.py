"""Noise level from the smallest principal components of small windows (Chen, Zhu, Heng; ICCV 2015).

Windows of 8 x 8 px cut every 3 px are vectors x of dimension d = 64. Texture lives in few directions, white noise in
all of them alike, so the noise variance is the mean of those eigenvalues of cov(x) that are noise alone. They are found
by dropping the largest eigenvalues one by one until the mean of the rest equals its median::

    tau_m = mean(l_1 .. l_(d-m)),   m = first with  #(l_i > tau_m) = #(l_i < tau_m),   sigma = sqrt(tau_m)

Chen et al. begin at m = 0. Wischow et al. (T-ITS 2023) ran a variant that begins at m = 1, so it always drops the
largest eigenvalue, on 8-bit tiles of 128 x 128 px, and stored whole DN (``rule="paper"``, ``quantise_like_paper``).

Noise that demosaicing, denoising or a codec has correlated between neighbours has its power in the large eigenvalues,
and the estimate is low by a factor of two or more. With ``stride=2`` windows take every second pixel (all four phases
count), where neighbours are nearly independent; texture then counts more, so 1 stays right for white noise.

A sampling interval is not given: on real patches the error is the texture left in tau, not the finite sample.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.camera.saturation import SATURATED_FRACTION
from pipeline.errors import InputError
from pipeline.noise.base import Estimator, Measured

WINDOW_PX = 8
STEP_PX = 3
MIN_SIZE_PX = 32
"""Smallest patch: 81 windows, more than the 64 dimensions."""

_EXACT_WINDOWS = 1024  # so many products of numbers below 128 add up to at most 2**24, exact in float32
_GRID_TOLERANCE_DN = 1e-4  # float32 pictures made from 8 bit are whole DN within 1.5e-5


class PrincipalComponents(Estimator):
    """PCA noise estimator.

    Args:
        rule: ``"chen"`` starts with all eigenvalues, ``"paper"`` always drops the largest.
        quantise_like_paper: round patches to 8 bit, answer in whole DN (truncated), never abstain (0 instead).
        saturated_fraction: of saturated pixels, (0, 1], from which a patch is refused.
        stride: pixels between neighbours in a window, at least 1; patches have 32 * stride px or more.

    Raises:
        InputError: unknown rule, or a fraction or a stride out of range.
    """

    min_size_px = MIN_SIZE_PX

    def __init__(
        self,
        rule: Literal["chen", "paper"] = "paper",
        quantise_like_paper: bool = False,
        saturated_fraction: float = SATURATED_FRACTION,
        stride: int = 1,
    ) -> None:
        if rule not in ("chen", "paper"):
            raise InputError(f"rule: expected 'chen' or 'paper', not {rule!r}")
        super().__init__(saturated_fraction, quantise_like_paper=quantise_like_paper)
        if not (isinstance(stride, int) and stride >= 1):
            raise InputError(f"stride: expected a whole number of pixels, 1 or more, not {stride!r}")
        self.rule, self.stride = rule, stride
        self.min_size_px = MIN_SIZE_PX * stride  # type: ignore[misc]

    def measure(self, stack: NDArray[np.floating], reason: NDArray[np.object_]) -> Measured:
        """See `pipeline.noise.base.Estimator.measure`."""
        start = 0 if self.rule == "chen" else 1
        eigenvalues = np.empty((len(stack), WINDOW_PX * WINDOW_PX))
        for index, patch in enumerate(stack):
            phases = [patch[y :: self.stride, x :: self.stride] for y in range(self.stride) for x in range(self.stride)]
            covariance = sum(_covariance(phase, self.quantise_like_paper) for phase in phases) / len(phases)
            eigenvalues[index] = np.linalg.eigvalsh(covariance)
        variance = noise_variance(eigenvalues, start)
        return Measured(np.sqrt(np.where(variance >= 0.0, variance, np.nan)))


def noise_variance(eigenvalues: NDArray[np.floating], start: int = 0) -> NDArray[np.floating]:
    """Mean of the eigenvalues that are noise alone.

    Args:
        eigenvalues: (N, d), ascending, in any squared unit.
        start: how many of the largest are dropped before the first comparison (0 Chen, 1 the paper).

    Returns:
        (N,) tau in the same unit; slightly negative where rounding makes the smallest eigenvalues so.
    """
    count, d = eigenvalues.shape
    kept = np.arange(d - start, 0, -1)  # one eigenvalue left always stops: none above, none below
    tau = np.cumsum(eigenvalues, axis=1)[:, kept - 1] / kept
    tau[:, -1] = eigenvalues[:, 0]  # exactly, so that the last comparison is a tie
    inside = np.arange(d) < kept[:, None]
    values = eigenvalues[:, None, :]
    above = np.count_nonzero((values > tau[:, :, None]) & inside, axis=2)
    below = np.count_nonzero((values < tau[:, :, None]) & inside, axis=2)
    stop = np.argmax(above == below, axis=1)
    return tau[np.arange(count), stop]


def _covariance(patch: NDArray[np.floating], eight_bit: bool) -> NDArray[np.float64]:
    """Covariance (normalised by their number) of the windows of a patch (H, W) in [0, 1]: (64, 64), DN squared."""
    picture = patch.astype(np.float64) * FULL_SCALE_DN
    whole = np.rint(picture)
    if eight_bit or np.abs(picture - whole).max() < _GRID_TOLERANCE_DN:
        # Products of 8-bit numbers, added in float32 in groups small enough to be exact: twice as fast as float64 and
        # free of rounding.
        vectors = _windows((whole - 128.0).astype(np.float32))
        groups = -(-vectors.shape[1] // _EXACT_WINDOWS)
        moments = sum((part @ part.T).astype(np.float64) for part in np.array_split(vectors, groups, axis=1))
        sums = vectors.sum(axis=1, dtype=np.float64)
    else:
        vectors = _windows(picture - picture.mean())
        moments = vectors @ vectors.T
        sums = vectors @ np.ones(vectors.shape[1])
    count = vectors.shape[1]
    mean = sums / count
    covariance: NDArray[np.float64] = moments / count - mean[:, None] * mean[None, :]
    return covariance


def _windows(picture: NDArray[np.floating]) -> NDArray[np.floating]:
    """All windows of a picture (H, W) as columns, (64, count)."""
    windows = sliding_window_view(picture, (WINDOW_PX, WINDOW_PX))[::STEP_PX, ::STEP_PX]
    # The long axis last: copying a run of one row of windows is faster than copying runs of eight pixels.
    return np.ascontiguousarray(windows.transpose(2, 3, 0, 1)).reshape(WINDOW_PX * WINDOW_PX, -1)
