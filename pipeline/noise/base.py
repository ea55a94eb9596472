"""Interface and base class of the noise estimators: patches in, a noise level per patch out, or an abstention.

A noise level is a standard deviation in digital numbers (DN), on a scale where white is 255. An estimator abstains
where it cannot measure the noise: a *saturated* patch has lost it to clipping, a *flat* one never showed any (a lens
cap, a masked area, an area that the camera has smoothed away). Neither is a zero, and both are counted.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.answers import (
    Answer,
    WrongAnswer,
    check_abstained,
    check_array,
    check_count,
    check_interval,
    check_range,
)
from pipeline.arrays import as_array
from pipeline.camera.constants import FULL_SCALE_DN, RANGE_SLACK
from pipeline.camera.saturation import SATURATED, SATURATED_FRACTION, is_saturated
from pipeline.errors import InputError

if TYPE_CHECKING:
    import torch

WHITE_DN = FULL_SCALE_DN

FLAT = "flat"
"""Reason: the patch, or the part of it that the estimator relies on, does not vary."""

COMPRESSED = "compressed"
"""Reason: a codec may have removed the noise, or left its own."""

UNCERTAIN = "uncertain"
"""Reason: the patch does not tell noise from the scene's own grain."""

BEYOND = "beyond"
"""Reason: more noise than estimators have seen the like of, for certain."""

ALTERNATING = "alternating"
"""Reason: the patch alternates from pixel to pixel, as a raw colour mosaic or interlaced fields do."""

STREAKED = "streaked"
"""Reason: neighbouring pixels are equal far more often than noise leaves them, as behind a median filter."""

SMALLEST_PATCH_PX = 16
"""Smallest height and width of a patch for estimators that state none."""

REQUIRED = ("sigma_dn", "low_dn", "high_dn", "abstained", "reason")
"""Parts that every `NoiseEstimate` has."""

LEAST_SIGMA_DN = 1e-3
"""Smaller estimates are rounding of float32 images (1.5e-5 DN at white), not noise; they count as flat."""


@dataclass(frozen=True)
class NoiseEstimate(Answer):
    """Noise level of N patches.

    Attributes:
        sigma_dn: (N,) standard deviation, DN; NaN where abstained.
        low_dn, high_dn: (N,) ends of a 95 % interval, DN; NaN where abstained or where the method has none.
        abstained: (N,) bool.
        reason: (N,) words for the abstention (``"saturated"``, ``"flat"``, ``"compressed"``, ``"uncertain"``,
            ``"beyond"``, ``"alternating"``, ``"streaked"``); empty where there is an estimate.
        white_sigma_dn: (N,) the part of sigma that is white, as the sensor's is before processing smooths it, DN; None
            from methods that do not separate it.
        correlation: (N,) correlation of the noise of adjacent pixels, -1 to 1; None likewise.
        at_most_dn: (N,) upper end of the interval, DN, known too where there is no estimate because a codec may have
            removed noise (``"compressed"``); NaN elsewhere; None from methods without intervals.
    """

    sigma_dn: NDArray[np.float64]
    low_dn: NDArray[np.float64]
    high_dn: NDArray[np.float64]
    abstained: NDArray[np.bool_]
    reason: NDArray[np.object_]
    white_sigma_dn: NDArray[np.float64] | None = None
    correlation: NDArray[np.float64] | None = None
    at_most_dn: NDArray[np.float64] | None = None

    quantity: ClassVar[str] = "sigma_dn"

    def __len__(self) -> int:
        return len(self.sigma_dn)

    def check(self, count: int) -> None:
        """See `pipeline.answers.Answer.check`; sigma is a finite number of at least 0, or abstained from."""
        check_count(np.size(self.sigma_dn), count)
        kinds = {"abstained": "b", "reason": "OU"}
        for part in fields(self):
            value = getattr(self, part.name)
            if value is not None or part.name in REQUIRED:
                check_array(part.name, value, (count,), kinds.get(part.name, "fiu"))
        check_abstained("sigma_dn", np.isnan(self.sigma_dn), self.abstained)
        check_range("sigma_dn", self.sigma_dn, np.inf)
        check_interval("sigma_dn", self.sigma_dn, self.low_dn, self.high_dn)


@dataclass(frozen=True)
class Measured:
    """Raw noise levels of N patches, before abstentions.

    Attributes:
        sigma_dn: (N,) standard deviation, DN; NaN where there is none.
        low_dn, high_dn: (N,) ends of a 95 % interval, DN, NaN where there is none; None if the method has no interval.
        white_sigma_dn, correlation: (N,) see `NoiseEstimate`; None if the method does not separate them.
    """

    sigma_dn: NDArray[np.float64]
    low_dn: NDArray[np.float64] | None = None
    high_dn: NDArray[np.float64] | None = None
    white_sigma_dn: NDArray[np.float64] | None = None
    correlation: NDArray[np.float64] | None = None


class NoiseEstimator(Protocol):
    """Anything that estimates the noise level of patches."""

    def estimate(self, patches: NDArray[np.floating] | torch.Tensor) -> NoiseEstimate:
        """Estimate the noise level of each patch on its own.

        Args:
            patches: (N, 1, H, W) float, [0, 1], NumPy or torch (any device).

        Raises:
            InputError: wrong shape, size, type or range, or a NaN.
        """
        ...


def smallest_patch_px(estimator: object) -> int:
    """Smallest height and width, px, of a patch for a noise estimator; a plug-in may not state one."""
    return int(getattr(estimator, "min_size_px", SMALLEST_PATCH_PX))


def as_stack(patches: NDArray[np.floating] | torch.Tensor, least_px: int) -> NDArray[np.floating]:
    """Check patches and drop their channel axis.

    Args:
        patches: (N, 1, H, W) float, [0, 1], NumPy or torch; N may be 0.
        least_px: smallest height and width the estimator works on.

    Returns:
        (N, H, W) float32 or float64 in [0, 1], not copied where that is possible.

    Raises:
        InputError: with the cause and the index of the first offending patch.
    """
    patches = as_array(patches)
    if isinstance(patches, np.ma.MaskedArray):
        raise InputError("patches: masked arrays are not estimated; cut patches without masked pixels")
    if not isinstance(patches, np.ndarray):
        raise InputError(f"patches: expected a NumPy array or torch tensor, not {type(patches).__name__}")
    if patches.ndim != 4 or patches.shape[1] != 1:
        raise InputError(
            f"patches: expected shape (N, 1, H, W), not {patches.shape}; for one picture use picture[None, None]"
        )
    patches = patches.astype(patches.dtype.newbyteorder("="), copy=False)
    if patches.dtype == np.float16:
        patches = patches.astype(np.float32)
    if patches.dtype not in (np.float32, np.float64):
        raise InputError(f"patches: expected floats in [0, 1], not {patches.dtype}; divide 8-bit pictures by 255")
    stack = patches[:, 0]
    if min(stack.shape[1:]) < least_px:
        raise InputError(
            f"patches: expected at least {least_px} x {least_px} px, not {stack.shape[1]} x {stack.shape[2]}"
        )
    if len(stack):
        lowest, highest = stack.min(axis=(1, 2)), stack.max(axis=(1, 2))  # both carry NaN on
        wrong = ~((lowest >= -RANGE_SLACK) & (highest <= 1.0 + RANGE_SLACK))
        if wrong.any():
            first = int(np.argmax(wrong))
            raise InputError(
                f"patches: patch {first} spans {lowest[first]:g} .. {highest[first]:g}; expected numbers in [0, 1]"
                " (divide 8-bit pictures by 255; clip after filtering)"
            )
    return stack


def check_fraction(name: str, value: float) -> float:
    """An option that is a share in (0, 1].

    Raises:
        InputError: it is not.
    """
    if not 0.0 < value <= 1.0:
        raise InputError(f"{name}: expected a share in (0, 1], not {value!r}")
    return float(value)


def screen(stack: NDArray[np.floating], saturated_fraction: float = SATURATED_FRACTION) -> NDArray[np.object_]:
    """Reasons to abstain that hold for every estimator.

    Args:
        stack: (N, H, W) in [0, 1].
        saturated_fraction: of saturated pixels from which a patch is saturated (`pipeline.camera.saturation`).

    Returns:
        (N,) reasons, empty where the patch can be judged.
    """
    reason = np.full(len(stack), "", dtype=object)
    if len(stack):
        reason[stack.min(axis=(1, 2)) == stack.max(axis=(1, 2))] = FLAT
        reason[is_saturated(stack, saturated_fraction)] = SATURATED
    return reason


def check_measured(measured: Measured, count: int) -> None:
    """Check that an estimator has measured every patch; NumPy would give all patches the value of a single one.

    Args:
        measured: what an estimator returned.
        count: of the patches that it was given.

    Raises:
        WrongAnswer: it is no `Measured`, or a field is no array of (count,) numbers.
    """
    if not isinstance(measured, Measured):
        raise WrongAnswer(f"measure returned {type(measured).__name__}, expected pipeline.noise.base.Measured")
    for part in fields(measured):
        value = getattr(measured, part.name)
        if value is not None or part.name == "sigma_dn":
            check_array(part.name, value, (count,))


def assemble(measured: Measured, reason: NDArray[np.object_]) -> NoiseEstimate:
    """Join numbers and reasons; what is no finite number of at least `LEAST_SIGMA_DN` becomes an abstention, `FLAT`.

    Args:
        measured: raw estimates, anything where there is a reason. A patch whose interval reaches above `LEAST_SIGMA_DN`
            may have any estimate from 0 on.
        reason: (N,) reasons, empty where there is none.

    Returns:
        the estimate, NaN wherever it abstains.

    Raises:
        InputError: not one number for each patch; see `check_measured`.
    """
    check_measured(measured, len(reason))
    nothing = np.full(len(measured.sigma_dn), np.nan)
    low_dn = nothing if measured.low_dn is None else measured.low_dn
    high_dn = nothing if measured.high_dn is None else measured.high_dn
    reason = reason.copy()
    a_number = np.isfinite(measured.sigma_dn) & (measured.sigma_dn >= 0)
    seen = a_number & ((measured.sigma_dn >= LEAST_SIGMA_DN) | (high_dn >= LEAST_SIGMA_DN))
    reason[(reason == "") & ~seen] = FLAT
    abstained = reason != ""

    def kept(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.where(abstained, np.nan, values)

    return NoiseEstimate(
        sigma_dn=kept(measured.sigma_dn),
        low_dn=kept(low_dn),
        high_dn=kept(high_dn),
        abstained=abstained,
        reason=reason,
        white_sigma_dn=None if measured.white_sigma_dn is None else kept(measured.white_sigma_dn),
        correlation=None if measured.correlation is None else kept(measured.correlation),
        at_most_dn=None if measured.high_dn is None else np.where(np.isin(reason, ("", COMPRESSED)), high_dn, np.nan),
    )


def as_published(sigma_dn: NDArray[np.float64]) -> NoiseEstimate:
    """The numbers that the authors' programs store: whole DN, truncated, and 0 where there is no estimate.

    Their maps are 8-bit integers without a value for "unknown", so nothing abstains. This moves an isolated-noise table
    by up to 1 DN and exists to compare with published numbers only.

    Args:
        sigma_dn: (N,) raw estimates, DN; NaN where there is none.
    """
    stored = np.trunc(np.nan_to_num(sigma_dn, nan=0.0))
    nothing = np.full(len(stored), np.nan)
    return NoiseEstimate(
        sigma_dn=stored,
        low_dn=nothing,
        high_dn=nothing.copy(),
        abstained=np.zeros(len(stored), dtype=bool),
        reason=np.full(len(stored), "", dtype=object),
    )


class Estimator(ABC):
    """Base class of the noise estimators: checks the patches, screens them, joins estimates and abstentions.

    Subclasses implement `measure`.

    Args:
        saturated_fraction: of saturated pixels, (0, 1], from which a patch is refused.
        quantise_like_paper: report whole DN (truncated) and never abstain (0 instead), as the authors' programs do.

    Attributes:
        min_size_px: smallest height and width of a patch; of a subclass that states none, 16.

    Raises:
        InputError: a fraction out of range.
    """

    min_size_px: ClassVar[int] = SMALLEST_PATCH_PX

    def __init__(self, saturated_fraction: float = SATURATED_FRACTION, *, quantise_like_paper: bool = False) -> None:
        self.saturated_fraction = check_fraction("saturated_fraction", saturated_fraction)
        self.quantise_like_paper = quantise_like_paper

    @abstractmethod
    def measure(self, stack: NDArray[np.floating], reason: NDArray[np.object_]) -> Measured:
        """Raw noise levels.

        Args:
            stack: (N, H, W) float32 or float64 in [0, 1], checked, at least `min_size_px` high and wide; often a view
                of the caller's pixels.
            reason: (N,) why a patch is abstained from whatever its estimate, "" where there is no reason; the
                estimator may write reasons of its own into it.

        Returns:
            raw estimates, anything where there is a reason.
        """

    def estimate(self, patches: NDArray[np.floating] | torch.Tensor) -> NoiseEstimate:
        """Estimate the noise level of each patch on its own.

        Args:
            patches: (N, 1, H, W) float, [0, 1], NumPy or torch (any device); N may be 0.

        Returns:
            the estimates; flat and saturated patches are abstained from.

        Raises:
            InputError: wrong shape, size, type or range, a NaN, or `measure` has not one number for each patch.
        """
        stack = as_stack(patches, self.min_size_px)
        reason = screen(stack, self.saturated_fraction)
        measured = self.measure(stack, reason)
        check_measured(measured, len(reason))
        if self.quantise_like_paper:
            return as_published(measured.sigma_dn)
        return assemble(measured, reason)
