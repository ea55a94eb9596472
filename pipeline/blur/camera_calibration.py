"""Any blur estimator, corrected for one camera by its estimates of that camera's sharp frames, blurred synthetically.

Sharp patches are blurred by kernels whose MTF M is known, the estimator reads m from them, and an affine map of logits
is fitted that brings its estimates to the truth:

    logit(M) ~ A logit(m) + b,        A: 16 x 16 E, b: 16   (two directions x eight frequencies, E networks)

by least absolute error, with A drawn towards the mean of the E networks that an ensemble joins, the identity where
E = 1 (`pipeline.blur.calibration.affine_logits`). Division by the sharp frames' own MTF (`Estimator.divided`) is right
where an estimator errs by a factor; this also mends errors that grow with blur, leak from one frequency into another,
or take the camera's sharpening for sharpness, and it weights the networks by how well they do on this camera. The
result is the MTF relative to the camera's sharp frames.

How strongly A is drawn to its start, and how much the map counts beside the uncalibrated output, is cross-validated
over scenes (`pipeline.blur.calibration.fit`). Intervals are widened by the held-out errors.

Beside the map of all networks, the last one, which alone was trained on kernels with wide halos, gets a map to itself
where that costs little; it takes over where it sees a halo (`pipeline.blur.calibration.halo`).

An estimator of networks gets a correction beside the map of all, its output layers trained further on this camera and
under noise (`pipeline.blur.calibration.output_layers`); where it sees a halo, the last network's map takes over from
both. Ours; the paper reads an estimator's answers as they are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pipeline.blur.base import FREQUENCIES, BlurEstimate, BlurEstimator, HiddenUnits, as_patches
from pipeline.blur.calibration import fit as camera_fit
from pipeline.blur.calibration import halo
from pipeline.blur.calibration.affine_logits import logit, sigmoid
from pipeline.blur.calibration.output_layers import Correction
from pipeline.blur.calibration.samples import LEAST_SAMPLES, VALUES, HasOutputLayers, blurred, members
from pipeline.blur.estimator_identity import EstimatorIdentity
from pipeline.camera.mtf import CAMERA, SYSTEM
from pipeline.errors import InputError

MOST_MEMBERS = 8
SAMPLES = 2400
COVERAGE = 0.95
INCOMPLETE = "incomplete"
"""Why a patch is abstained from whose MTF is not known at every frequency."""


class CameraMap(Protocol):
    """The calibration of an estimator to one camera: `Calibration`, or what an estimator makes in place of it.

    Attributes:
        samples: how many blurred patches it was fitted on.
        error_percent: mean absolute error on them before and after.
    """

    @property
    def samples(self) -> int: ...

    @property
    def error_percent(self) -> tuple[float, float]: ...

    def answer(self, estimator: Any, patches: Any) -> BlurEstimate:
        """The MTF added to the camera's sharp frames, by an estimator of the kind it was calibrated for."""
        ...

    def save(self, path: str | Path) -> None:
        """Write it as JSON."""
        ...


@runtime_checkable
class CameraFittable(Protocol):
    """An estimator that has its own way of calibrating to a camera."""

    def fit_camera(self, sharp_patches: Any, *, samples: int, seed: int) -> CameraMap:
        """See `calibrate`."""
        ...


@dataclass(frozen=True)
class Calibration:
    """The map of one camera and estimator.

    Attributes:
        matrix: (16, 16 E) A, horizontal frequencies first, network after network; drawn back already.
        offset: (16,) b.
        widening: factor on half the estimator's interval, so that 95 % of the held-out samples lie within it; NaN for
            an estimator without intervals.
        samples: how many blurred patches it was fitted on.
        error_percent: mean absolute error on them before, and after where they were held out.
        alone: (16, 17) matrix and offset of the last network alone (`pipeline.blur.calibration.halo`), or None.
        correction: beside the map, or None.
        made_for: the estimator that it was fitted to; None where that is not known, as in files of earlier versions.
    """

    matrix: NDArray[np.float64]
    offset: NDArray[np.float64]
    widening: float
    samples: int
    error_percent: tuple[float, float]
    alone: NDArray[np.float64] | None = None
    correction: Correction | None = None
    made_for: EstimatorIdentity | None = None

    @property
    def members(self) -> int:
        """Networks that the map takes the MTFs of."""
        return self.matrix.shape[1] // VALUES

    def __call__(self, mtf: NDArray[np.floating], hidden: HiddenUnits | None = None) -> NDArray[np.float64]:
        """Corrected MTFs: (N, 2, 8) in (0, 1).

        Args:
            mtf: (N, 2, 8) or (N, E, 2, 8), as estimated; NaN stays.
            hidden: of the same patches; needed where there is a correction.

        Raises:
            InputError: there is a correction, and the hidden units are absent or of other networks.
        """
        logits = logit(mtf.reshape(len(mtf), -1))
        mapped = logits @ self.matrix.T + self.offset
        if self.correction is not None:
            if hidden is None or hidden.units.shape[1:] != self.correction.first.shape[::2]:
                raise InputError(
                    "calibration with a correction from hidden units, of other networks than the estimator's; "
                    "calibrate anew"
                )
            mapped = self.correction(mapped, hidden)
        answer = sigmoid(mapped)
        if self.alone is not None:
            last = logits[:, -VALUES:] @ self.alone[:, :-1].T + self.alone[:, -1]
            answer = halo.mixed(answer, sigmoid(last), None if hidden is None else hidden.sigma_dn)
        return answer.reshape(len(mtf), 2, FREQUENCIES)

    def answer(self, estimator: BlurEstimator, patches: Any) -> BlurEstimate:
        """The MTF added to the camera's sharp frames; see `corrected`."""
        return corrected(estimator.estimate(patches), self)

    def content(self) -> dict[str, Any]:
        """Everything in it, as JSON can hold it."""
        content = {"matrix": self.matrix.tolist(), "offset": self.offset.tolist(), "samples": self.samples}
        content["widening"] = None if np.isnan(self.widening) else self.widening
        if self.alone is not None:
            content["alone"] = self.alone.tolist()
        if self.correction is not None:
            content["correction"] = self.correction.content()
        if self.made_for is not None:
            content["made_for"] = self.made_for.content()
        return {**content, "error_percent": list(self.error_percent)}

    def save(self, path: str | Path) -> None:
        """Write it as JSON."""
        from pipeline.store import write_json

        write_json(Path(path), self.content())

    @classmethod
    def from_content(cls, content: Any) -> Self:
        """The fit that `content` gave.

        Raises:
            KeyError, TypeError, ValueError: not such a content.
        """
        matrix, offset = np.array(content["matrix"], float), np.array(content["offset"], float)
        shapes = [(VALUES, VALUES * count) for count in range(1, MOST_MEMBERS + 1)]
        if matrix.shape not in shapes or offset.shape != (VALUES,):
            raise ValueError(f"matrix {matrix.shape}, offset {offset.shape}")
        alone = np.array(content["alone"], float) if "alone" in content else None
        if alone is not None and alone.shape != (VALUES, VALUES + 1):
            raise ValueError(f"alone {alone.shape}, expected {(VALUES, VALUES + 1)}")
        if not all(np.isfinite(part).all() for part in (matrix, offset, alone) if part is not None):
            raise ValueError("values that are not finite")
        widening = float("nan") if content["widening"] is None else float(content["widening"])
        if widening < 0 or np.isinf(widening):
            raise ValueError(f"widening {widening:g}, expected a finite number, 0 or more, or null")
        correction = Correction.from_content(content["correction"], VALUES) if "correction" in content else None
        before, after = content["error_percent"]
        errors = (float(before), float(after))
        made_for = EstimatorIdentity.from_content(content["made_for"]) if "made_for" in content else None
        return cls(matrix, offset, widening, int(content["samples"]), errors, alone, correction, made_for)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read what `save` wrote.

        Raises:
            InputError: no such file, or not such a file.
        """
        import json

        try:
            return cls.from_content(json.loads(Path(path).read_text()))
        except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
            raise InputError(
                f"{path}: not the calibration of a camera ({error}); make one with "
                f"pipeline.blur.camera_calibration.calibrate(...).save(path)"
            ) from None


class CalibratedEstimator:
    """An estimator calibrated to a camera: a `pipeline.blur.base.BlurEstimator`.

    Args:
        inner: the estimator that was calibrated.
        calibration: from `calibrate`.

    Raises:
        InputError: the estimator's answers are relative to something already, or the calibration was made with another
            estimator or other weights. Those stored by earlier versions do not say with which they were made.
    """

    relative_to = CAMERA

    def __init__(self, inner: BlurEstimator, calibration: CameraMap) -> None:
        refuse_relative(inner)
        made_for = getattr(calibration, "made_for", None)
        if made_for is not None:
            made_for.refuse_other(inner)
        self.inner, self.calibration = inner, calibration

    def estimate(self, patches: Any) -> BlurEstimate:
        """The MTF added to the camera's sharp frames, per patch; see `pipeline.blur.base.BlurEstimator`.

        A kernel that the estimator found is that of camera and blur together, so it is not passed on.
        """
        return self.calibration.answer(self.inner, patches)

    def calibrated(self, sharp_patches: Any) -> Self:
        """The same estimator, fitted anew to these sharp patches."""
        return type(self)(self.inner, calibrate(self.inner, sharp_patches))


def corrected(estimate: BlurEstimate, camera: Calibration) -> BlurEstimate:
    """An estimator's result with a camera's calibration applied; intervals keep their width, widened.

    Every corrected value rests on all frequencies: a patch of which some are unknown is abstained from, `INCOMPLETE`.

    Raises:
        InputError: the calibration is of an ensemble of other networks; or it does not say of which estimator it is,
            and of this one and that only one has intervals.
    """
    known = members(estimate)[:, : camera.members]  # a map of one network alone takes the joint output
    if known.shape[1] != camera.members:
        raise InputError(
            f"calibration of an ensemble of {camera.members} networks, estimator of {known.shape[1]}; calibrate anew"
        )
    half = estimate.half_width()
    if camera.made_for is None and (half is None) != np.isnan(camera.widening):  # all that is known of it
        fitted, given = ("with", "without") if half is None else ("without", "with")
        raise InputError(f"calibration of an estimator {fitted} intervals, given one {given}; calibrate anew")
    mtf = camera(known, estimate.hidden)
    incomplete = np.isnan(mtf).any(axis=(1, 2)) & ~estimate.abstained
    mtf[incomplete] = np.nan
    reason = np.where(incomplete, INCOMPLETE, estimate.reason)
    ends: dict[str, Any] = {"low": None, "high": None}
    if half is not None and not np.isnan(camera.widening):
        half *= camera.widening
        ends = {"low": np.clip(mtf - half, 0, 1), "high": np.clip(mtf + half, 0, 1)}
    return replace(
        estimate, mtf=mtf, abstained=estimate.abstained | incomplete, reason=reason,
        kernel=None, half=None, members=None, hidden=None, **ends,
    )  # fmt: skip


def refuse_relative(estimator: BlurEstimator) -> None:
    """Check that an estimator can be calibrated.

    Raises:
        InputError: its answers are relative to something already: to a camera's sharp frames, or to a generic lens.
    """
    relative_to = getattr(estimator, "relative_to", SYSTEM)
    if relative_to != SYSTEM:
        raise InputError(
            f"{type(estimator).__name__}: answers relative to the {relative_to}; expected an estimator of the whole "
            "system's MTF to calibrate"
        )


def calibrate(estimator: BlurEstimator, sharp_patches: Any, *, samples: int = SAMPLES, seed: int = 1) -> CameraMap:
    """Calibrate an estimator to a camera: by its own `CameraFittable.fit_camera` if it has one, else `fit_map`.

    Arguments and errors are those of `fit_map`; an estimator that is calibrated already is one too. The result keeps
    which estimator it was made with (`pipeline.blur.estimator_identity`).
    """
    refuse_relative(estimator)
    if isinstance(estimator, CameraFittable):
        return estimator.fit_camera(sharp_patches, samples=samples, seed=seed)
    fitted = fit_map(estimator, sharp_patches, samples=samples, seed=seed)
    return replace(fitted, made_for=EstimatorIdentity.of(estimator))


def fit_map(
    estimator: BlurEstimator, sharp_patches: Any, *, samples: int = SAMPLES, seed: int = 1, correction: bool = True
) -> Calibration:
    """Fit the map of logits that brings an estimator's answers to the truth.

    Args:
        estimator: takes (N, 1, 192, 192); not calibrated.
        sharp_patches: (N, 1, 192, 192) float in [0, 1] of the camera's sharp frames, like those it will be asked about;
            some tens, of different scenes, are enough.
        samples: blurred patches to fit on; every sharp patch is used about equally often.
        seed: of the kernels, of the noise and of the correction.
        correction: whether an estimator of networks (`HasOutputLayers`) gets one where scenes held out allow it.

    Raises:
        InputError: not such patches, fewer than 100 samples, or hardly any that the estimator can measure.
    """
    from pipeline.executor import one_thread_meanwhile

    sharp = as_patches(sharp_patches, "sharp_patches")
    if samples < LEAST_SAMPLES:
        raise InputError(f"samples={samples}; expected at least {LEAST_SAMPLES} to fit a camera on")
    if len(sharp) == 0:
        raise InputError("sharp_patches: none given; cut some from frames known to be sharp")
    layers = estimator.output_layers() if correction and isinstance(estimator, HasOutputLayers) else None
    with one_thread_meanwhile():
        read = blurred(estimator, sharp, samples, seed, noisy=layers is not None)
        fitted = camera_fit.fit(read, layers, seed)
    before = 100 * float(np.abs(sigmoid(read.logits[:, :VALUES]) - read.known).mean())
    return Calibration(
        fitted.matrix, fitted.offset, _widening(read.half_width, fitted.error), len(read.known),
        (before, 100 * float(fitted.error.mean())), fitted.alone, fitted.correction,
    )  # fmt: skip


def _widening(half_width: NDArray[np.float64] | None, error: NDArray[np.float64]) -> float:
    """Factor on the half width of intervals by which they hold 95 % of the errors; NaN without intervals."""
    if half_width is None:
        return float("nan")
    return float(np.quantile(error / np.maximum(half_width, 1e-3), COVERAGE))
