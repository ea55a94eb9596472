"""Any blur estimator, corrected for one camera by what it makes of that camera's own sharp frames, blurred on purpose.

A camera's sharp frames are blurred by kernels whose MTF M is known, the estimator reads m from them, and an affine map
of logits is fitted that brings its answers to the truth:

    logit(M) ~ A logit(m) + b,        A: 16 x 16, b: 16   (two directions x eight frequencies)

by least absolute error, with A drawn towards the identity. Division by the sharp frames' own MTF
(`Estimator.calibrated`) is right where an estimator errs by a factor; this also mends errors that grow with blur, leak
from one frequency into another, or take the camera's sharpening for sharpness. The answer is the MTF *added* to the
camera's sharp frames.

Kernels are of the family that networks are trained on (`pipeline.learning.kernels`), none of the study's own. Ours; the
paper reads an estimator's answers as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pipeline.blur.base import FREQUENCIES, BlurEstimate, BlurEstimator, as_patches
from pipeline.errors import InputError

VALUES = 2 * FREQUENCIES
NEAREST = 0.004  # to 0 and 1 that a logit is taken of
SAMPLES = 1200
AT_ONCE = 64
ROUNDS = 600
BATCH = 256
RATE = 3e-3
TOWARDS_IDENTITY = 1e-3
COVERAGE = 0.95
LEAST_SAMPLES = 100


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
        """The MTF added to the camera's sharp frames, by an estimator of the kind it was fitted to."""
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
        matrix: (16, 16) A, horizontal frequencies first.
        offset: (16,) b.
        widening: factor on half the estimator's interval, so that 95 % of the fitting samples lie within it; NaN for an
            estimator without intervals.
        samples: how many blurred patches it was fitted on.
        error_percent: mean absolute error on them before and after.
    """

    matrix: NDArray[np.float64]
    offset: NDArray[np.float64]
    widening: float
    samples: int
    error_percent: tuple[float, float]

    def __call__(self, mtf: NDArray[np.floating]) -> NDArray[np.float64]:
        """Corrected MTFs: (N, 2, 8) in (0, 1), of those read; NaN stays."""
        mapped = _logit(mtf.reshape(len(mtf), VALUES)) @ self.matrix.T + self.offset
        return np.asarray(1 / (1 + np.exp(-mapped))).reshape(len(mtf), 2, FREQUENCIES)

    def answer(self, estimator: BlurEstimator, patches: Any) -> BlurEstimate:
        """The MTF added to the camera's sharp frames; see `corrected`."""
        return corrected(estimator.estimate(patches), self)

    def content(self) -> dict[str, Any]:
        """Everything in it, as JSON can hold it."""
        content = {"matrix": self.matrix.tolist(), "offset": self.offset.tolist(), "samples": self.samples}
        content["widening"] = None if np.isnan(self.widening) else self.widening
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
        if matrix.shape != (VALUES, VALUES) or offset.shape != (VALUES,):
            raise ValueError(f"matrix {matrix.shape}, offset {offset.shape}")
        if not (np.isfinite(matrix).all() and np.isfinite(offset).all()):
            raise ValueError("values that are not finite")
        widening = float("nan") if content["widening"] is None else float(content["widening"])
        before, after = content["error_percent"]
        return cls(matrix, offset, widening, int(content["samples"]), (float(before), float(after)))

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
                f"{path}: not the fit of a camera ({error}); make one with "
                f"pipeline.blur.camera_calibration.calibrate(...).save(path)"
            ) from None


class CalibratedEstimator:
    """An estimator with a camera's fit behind it: a `pipeline.blur.base.BlurEstimator`.

    Args:
        inner: the estimator that was fitted.
        calibrate: from `calibrate`.
    """

    def __init__(self, inner: BlurEstimator, calibration: CameraMap) -> None:
        self.inner, self.calibration = inner, calibration

    def estimate(self, patches: Any) -> BlurEstimate:
        """The MTF added to the camera's sharp frames, per patch; see `pipeline.blur.base.BlurEstimator`.

        A kernel that the estimator found is that of camera and blur together, so it is not passed on.
        """
        return self.calibration.answer(self.inner, patches)

    def calibrated(self, sharp_patches: Any) -> Self:
        """The same estimator, fitted anew to these sharp patches."""
        return type(self)(self.inner, calibrate(self.inner, sharp_patches))


def corrected(found: BlurEstimate, camera: Calibration) -> BlurEstimate:
    """An estimator's answer with a camera's fit applied; intervals keep their width, widened."""
    mtf = camera(found.mtf)
    ends: dict[str, Any] = {"low": None, "high": None}
    if found.low is not None and found.high is not None and not np.isnan(camera.widening):
        half = (np.asarray(found.high, float) - np.asarray(found.low, float)) / 2 * camera.widening
        ends = {"low": np.clip(mtf - half, 0, 1), "high": np.clip(mtf + half, 0, 1)}
    return replace(found, mtf=mtf, kernel=None, **ends)


def calibrate(estimator: BlurEstimator, sharp_patches: Any, *, samples: int = SAMPLES, seed: int = 1) -> CameraMap:
    """Calibrate an estimator to a camera: by its own `CameraFittable.fit_camera` if it has one, else
    `affine_calibration`.

    Arguments and errors are those of `affine_calibration`.
    """
    if isinstance(estimator, CameraFittable):
        return estimator.fit_camera(sharp_patches, samples=samples, seed=seed)
    return affine_calibration(estimator, sharp_patches, samples=samples, seed=seed)


def affine_calibration(
    estimator: BlurEstimator, sharp_patches: Any, *, samples: int = SAMPLES, seed: int = 1
) -> Calibration:
    """Fit the affine map of logits that brings an estimator's answers to the truth.

    Args:
        estimator: takes (N, 1, 192, 192); not calibrated.
        sharp_patches: (N, 1, 192, 192) float in [0, 1] of the camera's sharp frames, like those it will be asked about;
            some tens, of different scenes, are enough.
        samples: blurred patches to fit on; every sharp patch is used about equally often.
        seed: of kernels and of the fit's order.

    Raises:
        InputError: not such patches, fewer than 100 samples, or hardly any that the estimator can measure.
    """
    from pipeline.camera import mtf
    from pipeline.camera.blur import blur
    from pipeline.executor import one_thread
    from pipeline.learning.kernels import BLOCK, block

    one_thread()
    sharp = as_patches(sharp_patches, "sharp_patches")
    if samples < LEAST_SAMPLES:
        raise InputError(f"samples={samples}; expected at least {LEAST_SAMPLES} to fit a camera on")
    if len(sharp) == 0:
        raise InputError("sharp_patches: none given; cut some from frames known to be sharp")
    bank = np.concatenate([block(index, seed, "camera fit kernels") for index in range(-(-samples // BLOCK))])[:samples]
    results: list[BlurEstimate] = []
    for first in range(0, samples, AT_ONCE):
        kernels = bank[first : first + AT_ONCE]
        picked = sharp[np.arange(first, first + len(kernels)) % len(sharp)]
        results.append(
            estimator.estimate(np.rint(blur(picked, kernels / kernels.sum((1, 2), keepdims=True)) * 255) / 255)
        )
    read = np.concatenate([np.asarray(item.mtf, float) for item in results]).reshape(samples, VALUES)
    truth = np.asarray(mtf.sample(bank), float).reshape(samples, VALUES)
    usable = ~np.isnan(read).any(axis=1)
    if usable.sum() < LEAST_SAMPLES:
        raise InputError(
            f"sharp_patches: only {usable.sum()} of {samples} blurred samples can be measured (flat or saturated); "
            "give patches with structure, from sharp frames"
        )
    matrix, offset = _affine(_logit(read[usable]), truth[usable], seed)
    plain = Calibration(matrix, offset, float("nan"), int(usable.sum()), (0.0, 0.0))
    error = np.abs(plain(read[usable].reshape(-1, 2, FREQUENCIES)).reshape(-1, VALUES) - truth[usable])
    before = np.abs(read[usable] - truth[usable])
    percent = (100 * float(before.mean()), 100 * float(error.mean()))
    return replace(plain, widening=_widening(results, usable, error), error_percent=percent)


def _widening(found: Sequence[BlurEstimate], usable: NDArray[np.bool_], error: NDArray[np.float64]) -> float:
    """Factor on the half width of intervals by which they hold 95 % of the errors."""
    if any(item.low is None or item.high is None for item in found):
        return float("nan")
    half = np.concatenate([(np.asarray(item.high) - np.asarray(item.low)) / 2 for item in found]).reshape(-1, VALUES)
    return float(np.quantile(error / np.maximum(half[usable], 1e-3), COVERAGE))


def _logit(mtf: NDArray[np.floating]) -> NDArray[np.float64]:
    """log(m / (1 - m)), away from 0 and 1."""
    inside = np.clip(np.asarray(mtf, np.float64), NEAREST, 1 - NEAREST)
    return np.asarray(np.log(inside / (1 - inside)))


def _affine(
    read: NDArray[np.float64], truth: NDArray[np.float64], seed: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A and b that minimise mean |sigmoid(A read + b) - truth| + a little |A - I|^2, by Adam from the identity."""
    import torch

    from pipeline.streams import stream

    generator = stream(seed, "camera fit order")
    inputs, targets = torch.from_numpy(read), torch.from_numpy(truth)
    identity = torch.eye(VALUES, dtype=torch.float64)
    matrix, offset = identity.clone().requires_grad_(), torch.zeros(VALUES, dtype=torch.float64).requires_grad_()
    optimiser = torch.optim.Adam([matrix, offset], lr=RATE)
    for turn in range(ROUNDS):
        for group in optimiser.param_groups:
            group["lr"] = RATE * (1 - turn / ROUNDS)
        batch = torch.from_numpy(generator.integers(len(inputs), size=BATCH))
        error = (torch.sigmoid(inputs[batch] @ matrix.T + offset) - targets[batch]).abs().mean()
        loss = error + TOWARDS_IDENTITY * (matrix - identity).square().sum() / VALUES
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    return matrix.detach().numpy(), offset.detach().numpy()
