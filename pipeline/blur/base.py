"""What every blur estimator takes and answers: patches in, an MTF per patch out, or an abstention with its reason.

A blur estimator measures the modulation transfer function (MTF) of lens, motion and sensor together from image
content alone, at the eight spatial frequencies of the paper, horizontally and vertically. Where a patch cannot
tell (no structure, clipped), the answer is an abstention that is counted, never a silent zero.
"""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pipeline.answers import (
    Answer,
    WrongAnswer,
    check_abstained,
    check_answer,
    check_array,
    check_count,
    check_interval,
    check_range,
)
from pipeline.arrays import as_array
from pipeline.camera.constants import FULL_SCALE_DN, RANGE_SLACK
from pipeline.camera.mtf import BINS, CAMERA, SYSTEM
from pipeline.camera.saturation import SATURATED, is_saturated
from pipeline.errors import InputError
from pipeline.statistics import inliers

PATCH_PX = 192
FREQUENCIES = len(BINS)

FLAT_DN = 1.0  # standard deviation, on the 0..255 scale, under which a patch shows no structure
SHARP_FLOOR = 0.05  # below this the camera's own MTF is noise and is not divided by (the paper's epsilon)

Floats = NDArray[np.float32] | NDArray[np.float64]


@dataclass(frozen=True)
class HiddenUnits:
    """What the E networks of an estimator saw of N patches: what a calibration to a camera may start from.

    Attributes:
        units: (N, E, F) of the layer below the last two of each network.
        second_share: (N,) share of the second network in the joint estimate.
        sigma_dn: (N,) noise that they see, DN.
    """

    units: Floats
    second_share: Floats
    sigma_dn: Floats

    def part(self, kept: NDArray[np.bool_]) -> HiddenUnits:
        """Those of some patches."""
        return HiddenUnits(self.units[kept], self.second_share[kept], self.sigma_dn[kept])


@dataclass(frozen=True)
class BlurEstimate(Answer):
    """The answer for N patches.

    Attributes:
        mtf: (N, 2, 8) in [0, 1]: horizontal then vertical, at the eight frequencies; NaN where abstained, and at a
            frequency that is left out.
        abstained: (N,) bool.
        reason: (N,) str: why, "" where not abstained.
        kernel: (N, k, k) blur kernels with unit sum (NaN where abstained), for estimators that have one.
        low, high: (N, 2, 8) 95 % interval of ``mtf``, for estimators that have one.
        half: (N, 2, 8) half its width before it was cut off at 0 and 1, for estimators that know.
        members: (N, E, 2, 8) MTFs by the E networks that an ensemble joins, ``mtf`` first; NaN where abstained. A
            calibration to a camera weights them anew.
        hidden: hidden units, for estimators that pass them on (`pipeline.blur.calibration.output_layers`).
    """

    mtf: Floats
    abstained: NDArray[np.bool_]
    reason: NDArray[np.str_]
    kernel: Floats | None = None
    low: Floats | None = None
    high: Floats | None = None
    half: Floats | None = None
    members: Floats | None = None
    hidden: HiddenUnits | None = None

    quantity: ClassVar[str] = "mtf"

    def __post_init__(self) -> None:
        count = np.shape(self.mtf)[0] if np.ndim(self.mtf) else 0
        curves = (count, 2, FREQUENCIES)
        check_array("mtf", self.mtf, curves)
        check_array("abstained", self.abstained, (count,), "b")
        check_array("reason", self.reason, (count,), "OU")
        for name in ("low", "high", "half"):
            if (value := getattr(self, name)) is not None:
                check_array(name, value, curves)
        if self.kernel is not None and (self.kernel.ndim != 3 or len(self.kernel) != count):
            raise WrongAnswer(f"kernel has shape {self.kernel.shape}, expected ({count}, k, k)")
        if self.members is not None and (self.members.shape[0] != count or self.members.shape[2:] != (2, FREQUENCIES)):
            raise WrongAnswer(f"members has shape {self.members.shape}, expected ({count}, E, 2, {FREQUENCIES})")
        if self.hidden is not None and (self.hidden.units.ndim != 3 or len(self.hidden.units) != count):
            raise WrongAnswer(f"hidden.units has shape {self.hidden.units.shape}, expected ({count}, E, F)")
        check_abstained("mtf", np.asarray(np.isnan(self.mtf).all(axis=(1, 2))), self.abstained)

    def __len__(self) -> int:
        return len(self.mtf)

    def check(self, count: int) -> None:
        """See `pipeline.answers.Answer.check`; shapes and abstentions are checked when it is made."""
        check_count(len(self), count)
        check_range("mtf", self.mtf, 1.0)
        check_interval("mtf", self.mtf, self.low, self.high)

    def half_width(self) -> NDArray[np.float64] | None:
        """`half`, or the larger side of the intervals where it is unknown; (N, 2, 8). None without intervals.

        Of 0 to 1 around 0.8, which tells that the estimator knows nothing, the half 0.5 would be too little.
        """
        if self.half is not None or self.low is None or self.high is None:
            return None if self.half is None else np.array(self.half, np.float64)
        mtf, low, high = (np.asarray(values, np.float64) for values in (self.mtf, self.low, self.high))
        return np.maximum(high - mtf, mtf - low)


@runtime_checkable
class BlurEstimator(Protocol):
    """What `pipeline.blur.create` returns."""

    def estimate(self, patches: Any) -> BlurEstimate:
        """The MTF of each patch: (N, 1, 192, 192) float in [0, 1], as encoded, NumPy or torch."""
        ...

    def calibrated(self, sharp_patches: Any) -> BlurEstimator:
        """The same estimator, relative to this camera's own sharp frames."""
        ...


def as_patches(patches: Any, name: str = "patches", size_px: int = PATCH_PX) -> NDArray[np.float32]:
    """Check a batch of patches and give it as a NumPy array.

    Args:
        patches: (N, 1, size, size) float in [0, 1], NumPy or torch (any device).
        name: what error messages call it.
        size_px: expected height and width.

    Returns:
        (N, 1, size, size) float32, C-contiguous.

    Raises:
        InputError: not such an array, of mixed sizes, masked, not floats, not finite, or outside [0, 1].
    """
    patches = as_array(patches)
    if isinstance(patches, np.ma.MaskedArray):
        raise InputError(f"{name}: masked arrays are not estimated; cut patches without masked pixels")
    expected = f"expected (N, 1, {size_px}, {size_px}) floats in [0, 1]"
    try:
        array = np.asarray(patches)
    except ValueError:
        raise InputError(f"{name}: of more than one shape, {expected}; cut all to {size_px} px") from None
    if array.ndim != 4 or array.shape[1:] != (1, size_px, size_px):
        raise InputError(f"{name}: shape {array.shape}, {expected}; cut the frame into {size_px} px grey patches")
    if not np.issubdtype(array.dtype, np.floating):
        raise InputError(f"{name}: {array.dtype}, {expected}; divide 8-bit images by 255")
    array = np.ascontiguousarray(array, dtype=np.float32)
    if not np.isfinite(array).all():
        raise InputError(f"{name}: holds NaN or infinity, {expected}")
    if array.size and (array.min() < -RANGE_SLACK or array.max() > 1.0 + RANGE_SLACK):
        raise InputError(f"{name}: values {array.min():.9g}..{array.max():.9g}, {expected}; scale or clip them")
    return array


def unusable(patches: NDArray[np.float32]) -> NDArray[np.str_]:
    """Why a patch can tell nothing about blur: "flat", "saturated", or "" where it can.

    Args:
        patches: (N, 1, h, w) in [0, 1].
    """
    if len(patches) == 0:
        return np.empty(0, dtype=np.str_)
    pixels = patches.reshape(len(patches), -1)
    # One patch at a time stays in the processor's cache.
    flat = np.array([patch.std(dtype=np.float64) for patch in pixels]) * FULL_SCALE_DN < FLAT_DN
    return np.select([is_saturated(pixels) & ~flat, flat], [SATURATED, "flat"], default="")


class Estimator(ABC):
    """Shared parts of the estimators: check the input, abstain, calibrate. Subclasses measure.

    Attributes:
        sharp_mtf: (2, 8) this camera's own MTF that estimates are divided by, or None.
        relative_to: what the MTF is relative to: `SYSTEM` (lens, sensor and blur together), `CAMERA` (its sharp
            frames) or `GENERIC_LENS`.
    """

    sharp_mtf: NDArray[np.float64] | None = None
    relative_to: str = SYSTEM

    @abstractmethod
    def measure(self, patches: NDArray[np.float32], reason: NDArray[np.str_]) -> BlurEstimate:
        """The uncalibrated answer.

        Args:
            patches: (N, 1, 192, 192) float32 in [0, 1], checked; often the caller's own pixels.
            reason: (N,) "" or why a patch must be abstained from; the answer may add abstentions.
        """

    def estimate(self, patches: Any) -> BlurEstimate:
        """The MTF of each patch.

        Args:
            patches: (N, 1, 192, 192) float in [0, 1], grey levels as encoded, NumPy or torch; N may be 0.

        Returns:
            the answer; flat and saturated patches are abstained from.

        Raises:
            InputError: the patches are not as expected, or `measure` does not answer for them (`BlurEstimate.check`).
        """
        batch = as_patches(patches)
        result = self.measure(batch, unusable(batch))
        check_answer(result, BlurEstimate.quantity, len(batch))
        if self.sharp_mtf is None:
            return result
        relative = {
            name: np.clip(value / np.maximum(self.sharp_mtf, SHARP_FLOOR), 0.0, 1.0)
            for name in ("mtf", "low", "high")
            if (value := getattr(result, name)) is not None
        }
        return replace(result, kernel=None, half=None, members=None, hidden=None, **relative)

    def calibrated(self, sharp_patches: Any) -> Self:
        """The same estimator, calibrated to this camera: by division, unless a subclass knows better; see `divided`."""
        return self.divided(sharp_patches)

    def divided(self, sharp_patches: Any) -> Self:
        """The same estimator, its MTF divided by that of this camera's sharp frames, clipped to [0, 1].

        What an estimator reads from an uncorrupted frame is the lens, the sensor and its own bias. Dividing
        by it, per direction and frequency, leaves the blur that was added (MTFs of serial stages multiply).

        Args:
            sharp_patches: (N, 1, 192, 192) float in [0, 1] from frames known to be sharp.

        Raises:
            InputError: not as expected, or none of them can be measured.
        """
        plain = copy.copy(self)
        plain.sharp_mtf = None
        mtf = plain.estimate(as_patches(sharp_patches, "sharp_patches")).mtf
        kept = mtf[~np.isnan(mtf).any(axis=(1, 2))]
        if len(kept) == 0:
            raise InputError(
                f"sharp_patches: none of the {len(mtf)} can be measured (flat or saturated); "
                "give patches with structure, from sharp frames"
            )
        made = copy.copy(self)
        made.relative_to = CAMERA
        made.sharp_mtf = np.empty((2, FREQUENCIES))
        for index in np.ndindex(2, FREQUENCIES):
            values = kept[(slice(None), *index)]
            made.sharp_mtf[index] = np.median(values[inliers(values)])
        return made


class WithoutEmptyFrequencies:
    """An estimator divided by a camera's MTF, which is not divided where the camera has no contrast left.

    At a frequency where the camera's MTF is at most `SHARP_FLOOR`, division by that floor would
    report blur of the camera's own sharp frames. The relative MTF there is that at the nearest lower frequency with
    contrast, on the same axis: an upper bound where blur lowers the MTF from frequency to frequency.

    Args:
        divided: an estimator with `sharp_mtf`; the lowest frequency of both axes has contrast.
    """

    def __init__(self, divided: Estimator) -> None:
        assert divided.sharp_mtf is not None
        self.divided, self.relative_to = divided, divided.relative_to
        index = np.arange(divided.sharp_mtf.shape[1])
        self._source = np.maximum.accumulate(np.where(divided.sharp_mtf > SHARP_FLOOR, index, 0), axis=1)  # (2, 8)

    def estimate(self, patches: Any) -> BlurEstimate:
        """The MTF relative to the camera, per patch; see `Estimator.estimate`."""
        result = self.divided.estimate(patches)
        relative: dict[str, Any] = {
            name: np.take_along_axis(value, np.broadcast_to(self._source, value.shape), axis=2)
            for name in ("mtf", "low", "high")
            if (value := getattr(result, name)) is not None
        }
        return replace(result, **relative)

    def calibrated(self, sharp_patches: Any) -> BlurEstimator:
        """The estimator inside, calibrated anew to these sharp patches."""
        return self.divided.calibrated(sharp_patches)
