"""Blur under noise: smooth a noisy patch by a known defocus, estimate, and divide the known blur out again.

Supplement of Wischow et al. 2023: above about 10 DN noise prevents blur estimation. A defocus disc of diameter d2
removes most of it; MTFs of serial blurs multiply, so with the estimate MTF12 of the smoothed patch and the disc's own
MTF2

    MTF1(f) = MTF12(f) / MTF2(f)    where MTF12 <= MTF2, MTF2 > epsilon and MTF12 > epsilon,   epsilon = 0.05.

Frequencies that fail one of these conditions are left out (NaN). MTF2 is exact, so an error of MTF12 reaches MTF1
divided by MTF2, and an interval is divided alike.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.blur.base import BlurEstimate, BlurEstimator, as_patches
from pipeline.camera import mtf
from pipeline.camera.blur import blur
from pipeline.camera.psf.defocus import create as defocus
from pipeline.errors import InputError

EPSILON = 0.05
FROM_SIGMA_DN = 10.0
FILTER_PX = 7.0


def divided(combined: NDArray[np.floating], known: NDArray[np.floating], epsilon: float = EPSILON) -> NDArray[Any]:
    """MTF1 from MTF12 and MTF2.

    Args:
        combined: (..., 2, 8) MTF of both blurs.
        known: (2, 8) MTF of the known one.
        epsilon: below it an MTF is taken for noise.

    Returns:
        (..., 2, 8); NaN where a condition fails.
    """
    usable = (combined <= known) & (known > epsilon) & (combined > epsilon)
    return np.where(usable, combined / np.where(known > epsilon, known, 1.0), np.nan)


def divided_end(
    end: NDArray[np.floating], known: NDArray[np.floating], epsilon: float = EPSILON
) -> NDArray[np.float64]:
    """An end of the interval of MTF12 as one of MTF1, clipped to [0, 1].

    Args:
        end: (..., 2, 8).
        known: (2, 8) MTF2.
        epsilon: see `divided`.
    """
    return np.clip(end / np.maximum(known, epsilon), 0.0, 1.0)


def expected_amae(first_percent: ArrayLike, second_percent: ArrayLike) -> NDArray[np.float64]:
    """The error to be expected of a quotient: sqrt(a1^2 + a2^2).

    Args:
        first_percent: AMAE of the estimator for the blur looked for, percent.
        second_percent: its AMAE for the known defocus, percent.
    """
    return np.hypot(np.asarray(first_percent, dtype=np.float64), np.asarray(second_percent, dtype=np.float64))


class Denoised:
    """Any blur estimator, with noisy patches smoothed before it and their known blur divided out after it.

    Args:
        inner: the estimator.
        sigma_dn: (N, 1, 192, 192) patches -> (N,) noise, DN; for instance a noise estimator's answer. NaN, where it
            has none, counts as no noise.
        filter_px: diameter d2 of the disc, pixels (the paper: 7 or 11).
        from_sigma_dn: noise from which patches are smoothed, DN.
        epsilon: see `divided`.

    Raises:
        InputError: a diameter of at most 1 px, which smooths nothing.
    """

    def __init__(
        self,
        inner: BlurEstimator,
        sigma_dn: Callable[[NDArray[np.float32]], NDArray[np.floating]],
        *,
        filter_px: float = FILTER_PX,
        from_sigma_dn: float = FROM_SIGMA_DN,
        epsilon: float = EPSILON,
    ) -> None:
        if not filter_px > 1:
            raise InputError(f"filter_px is {filter_px}; expected a diameter of more than 1 px, e.g. {FILTER_PX:g}")
        self.inner, self.sigma_dn = inner, sigma_dn
        self.from_sigma_dn, self.epsilon = from_sigma_dn, epsilon
        self.psf = defocus(filter_px)
        self.known = mtf.sample(self.psf)

    def estimate(self, patches: Any) -> BlurEstimate:
        """The MTF of each patch; see `pipeline.blur.base.BlurEstimator`.

        Frequencies left out are NaN. A patch of which none remains is abstained from, reason ``"noise"``.

        Raises:
            InputError: the patches are not as expected.
        """
        batch = as_patches(patches)
        noisy = np.asarray(self.sigma_dn(batch)) >= self.from_sigma_dn
        # Of smoothed patches kernels and the networks' outputs are of both blurs; no answer depends on its batch.
        if not noisy.any():
            return replace(self.inner.estimate(batch), kernel=None, half=None, members=None, hidden=None)
        shown = batch.copy()
        shown[noisy] = blur(batch[noisy], self.psf)
        result = self.inner.estimate(shown)
        combined = np.asarray(result.mtf, dtype=np.float64)
        clear = np.where(noisy[:, None, None], divided(combined, self.known, self.epsilon), combined)
        lost = np.isnan(clear).all(axis=(1, 2)) & ~result.abstained
        clear = clear.astype(result.mtf.dtype)
        ends: dict[str, Any] = {
            name: np.where(noisy[:, None, None] & ~np.isnan(clear), divided_end(end, self.known, self.epsilon), end)
            for name in ("low", "high")
            if (end := getattr(result, name)) is not None
        }
        ends = {name: np.where(np.isnan(clear), np.nan, end) for name, end in ends.items()}
        reason = np.where(lost, "noise", result.reason)
        # What is known of a smoothed patch is of both blurs, so it is not passed on.
        abstained = result.abstained | lost
        return replace(
            result, mtf=clear, abstained=abstained, reason=reason, kernel=None, half=None, members=None, hidden=None,
            **ends,
        )  # fmt: skip

    @property
    def relative_to(self) -> str:
        """What the MTF is relative to: see `pipeline.blur.base.Estimator`."""
        return str(getattr(self.inner, "relative_to", mtf.SYSTEM))

    def calibrated(self, sharp_patches: Any) -> Self:
        """The same, with the inner estimator relative to this camera's own sharp frames."""
        made = type(self).__new__(type(self))
        made.__dict__.update(self.__dict__)
        made.inner = self.inner.calibrated(sharp_patches)
        return made
