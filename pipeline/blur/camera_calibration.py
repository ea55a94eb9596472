"""Any blur estimator, corrected for one camera by its estimates of that camera's sharp frames, blurred synthetically.

Sharp patches are blurred by kernels whose MTF M is known, the estimator reads m from them, and an affine map of logits
is fitted that brings its estimates to the truth:

    logit(M) ~ A logit(m) + b,        A: 16 x 16 E, b: 16   (two directions x eight frequencies, E networks)

by least absolute error, with A drawn towards the mean of the E networks that an ensemble joins (the identity where
E = 1). Division by the sharp frames' own MTF (`Estimator.divided`) is right where an estimator errs by a factor; this
also mends errors that grow with blur, leak from one frequency into another, or take the camera's sharpening for
sharpness, and it weights the networks by how well they do on this camera. The result is the MTF relative to the
camera's sharp frames.

A map is only as good as the scenes that it was fitted on. It is cross-validated over groups of sharp patches, and drawn
back to the estimator's uncalibrated output x0 as far as the held-out scenes demand,

    logit(M) = w (A logit(m) + b) + (1 - w) x0,        w in {0, 1/4, 1/2, 3/4, 1} of least held-out error,

so that a calibration which does not carry over to other scenes is none. Intervals are widened by the held-out errors.

Kernels are of the family that networks are trained on (`pipeline.learning.kernels`, with irises, halos and rendered
lenses; without those, kernels with a halo were read 40 % worse calibrated than not), none of the study's own. Ours; the
paper reads an estimator's answers as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pipeline.blur.base import FREQUENCIES, BlurEstimate, BlurEstimator, as_patches
from pipeline.camera.mtf import CAMERA
from pipeline.errors import InputError

VALUES = 2 * FREQUENCIES
KERNELS = "with_optics"
MOST_MEMBERS = 8
NEAREST = 0.004  # to 0 and 1 that a logit is taken of
SAMPLES = 1200
AT_ONCE = 64
ROUNDS = 600
BATCH = 256
RATE = 3e-3
TOWARDS_START = 1e-3
COVERAGE = 0.95
LEAST_SAMPLES = 100
FOLDS = 4
WEIGHTS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Weights of the map beside the uncalibrated output, of which cross-validation takes one."""


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
    """

    matrix: NDArray[np.float64]
    offset: NDArray[np.float64]
    widening: float
    samples: int
    error_percent: tuple[float, float]

    @property
    def members(self) -> int:
        """Networks that the map takes the MTFs of."""
        return self.matrix.shape[1] // VALUES

    def __call__(self, mtf: NDArray[np.floating]) -> NDArray[np.float64]:
        """Corrected MTFs: (N, 2, 8) in (0, 1), of those estimated, (N, 2, 8) or (N, E, 2, 8); NaN stays."""
        mapped = _logit(mtf.reshape(len(mtf), -1)) @ self.matrix.T + self.offset
        return _sigmoid(mapped).reshape(len(mtf), 2, FREQUENCIES)

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
        shapes = [(VALUES, VALUES * count) for count in range(1, MOST_MEMBERS + 1)]
        if matrix.shape not in shapes or offset.shape != (VALUES,):
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
                f"{path}: not the calibration of a camera ({error}); make one with "
                f"pipeline.blur.camera_calibration.calibrate(...).save(path)"
            ) from None


class CalibratedEstimator:
    """An estimator calibrated to a camera: a `pipeline.blur.base.BlurEstimator`.

    Args:
        inner: the estimator that was calibrated.
        calibration: from `calibrate`.
    """

    relative_to = CAMERA

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


def corrected(estimate: BlurEstimate, camera: Calibration) -> BlurEstimate:
    """An estimator's result with a camera's calibration applied; intervals keep their width, widened.

    Raises:
        InputError: the calibration is of an ensemble of other networks.
    """
    members = _members(estimate)[:, : camera.members]  # a map of one network alone takes the joint output
    if members.shape[1] != camera.members:
        raise InputError(
            f"calibration of an ensemble of {camera.members} networks, estimator of {members.shape[1]}; calibrate anew"
        )
    mtf = camera(members)
    ends: dict[str, Any] = {"low": None, "high": None}
    if estimate.low is not None and estimate.high is not None and not np.isnan(camera.widening):
        half = (np.asarray(estimate.high, float) - np.asarray(estimate.low, float)) / 2 * camera.widening
        ends = {"low": np.clip(mtf - half, 0, 1), "high": np.clip(mtf + half, 0, 1)}
    return replace(estimate, mtf=mtf, kernel=None, members=None, **ends)


def _members(estimate: BlurEstimate) -> NDArray[np.float64]:
    """(N, E, 2, 8) MTFs by the networks of an ensemble, its joint output first; E = 1 for a single one."""
    return np.asarray(estimate.mtf[:, None] if estimate.members is None else estimate.members, float)


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

    one_thread()
    sharp = as_patches(sharp_patches, "sharp_patches")
    if samples < LEAST_SAMPLES:
        raise InputError(f"samples={samples}; expected at least {LEAST_SAMPLES} to fit a camera on")
    if len(sharp) == 0:
        raise InputError("sharp_patches: none given; cut some from frames known to be sharp")
    bank = _kernels(samples, seed)
    results: list[BlurEstimate] = []
    for first in range(0, samples, AT_ONCE):
        kernels = bank[first : first + AT_ONCE]
        picked = sharp[np.arange(first, first + len(kernels)) % len(sharp)]
        results.append(
            estimator.estimate(np.rint(blur(picked, kernels / kernels.sum((1, 2), keepdims=True)) * 255) / 255)
        )
    read = np.concatenate([_members(item) for item in results]).reshape(samples, -1)
    truth = np.asarray(mtf.sample(bank), float).reshape(samples, VALUES)
    usable = ~np.isnan(read).any(axis=1)
    if usable.sum() < LEAST_SAMPLES:
        raise InputError(
            f"sharp_patches: only {usable.sum()} of {samples} blurred samples can be measured (flat or saturated); "
            "give patches with structure, from sharp frames"
        )
    logits, known = _logit(read[usable]), truth[usable]
    patch = (np.arange(samples) % len(sharp))[usable]
    held_out = _held_out(logits, known, _groups(patch, len(sharp)), seed)
    plain = logits[:, :VALUES]
    errors = [np.abs(_sigmoid(weight * held_out + (1 - weight) * plain) - known) for weight in WEIGHTS]
    best = int(np.argmin([error.mean() for error in errors]))
    matrix, offset = _affine(logits, known, seed)
    identity = np.eye(VALUES, logits.shape[1])
    matrix, offset = WEIGHTS[best] * matrix + (1 - WEIGHTS[best]) * identity, WEIGHTS[best] * offset
    percent = (100 * float(errors[0].mean()), 100 * float(errors[best].mean()))
    return Calibration(matrix, offset, _widening(results, usable, errors[best]), int(usable.sum()), percent)


@lru_cache(maxsize=2)
def _kernels(count: int, seed: int) -> NDArray[np.float32]:
    """(count, 49, 49) kernels to calibrate with; rendered lenses take seconds, so the last are kept."""
    from pipeline.learning.kernels import BLOCK, block

    blocks = range(-(-count // BLOCK))
    return np.concatenate([block(index, seed, "camera fit kernels", distribution=KERNELS) for index in blocks])[:count]


def _groups(patch: NDArray[np.int_], count: int) -> NDArray[np.int_]:
    """The fold of each sample: neighbouring sharp patches, which may show the same scene, are in one fold.

    Args:
        patch: (N,) index of the sharp patch that a sample was made of.
        count: of sharp patches; with a single one, folds differ in kernels only.
    """
    return np.arange(len(patch)) % FOLDS if count == 1 else patch * min(FOLDS, count) // count


def _held_out(
    read: NDArray[np.float64], truth: NDArray[np.float64], groups: NDArray[np.int_], seed: int
) -> NDArray[np.float64]:
    """(N, 16) logits of every sample by the map calibrated on the other groups."""
    result = np.empty_like(truth)
    for group in np.unique(groups):
        out = groups == group
        matrix, offset = _affine(read[~out], truth[~out], seed)
        result[out] = read[out] @ matrix.T + offset
    return result


def _widening(found: Sequence[BlurEstimate], usable: NDArray[np.bool_], error: NDArray[np.float64]) -> float:
    """Factor on the half width of intervals by which they hold 95 % of the errors."""
    if any(item.low is None or item.high is None for item in found):
        return float("nan")
    half = np.concatenate([(np.asarray(item.high) - np.asarray(item.low)) / 2 for item in found]).reshape(-1, VALUES)
    return float(np.quantile(error / np.maximum(half[usable], 1e-3), COVERAGE))


def _sigmoid(logits: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(1 / (1 + np.exp(-logits)))


def _logit(mtf: NDArray[np.floating]) -> NDArray[np.float64]:
    """log(m / (1 - m)), away from 0 and 1."""
    inside = np.clip(np.asarray(mtf, np.float64), NEAREST, 1 - NEAREST)
    return np.asarray(np.log(inside / (1 - inside)))


def _affine(
    read: NDArray[np.float64], truth: NDArray[np.float64], seed: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A and b that minimise mean |sigmoid(A read + b) - truth| + a little |A - A0|^2, by Adam from A0.

    A0 is the mean of the networks, [I / E, ..., I / E].
    """
    import torch

    from pipeline.streams import stream

    generator = stream(seed, "camera fit order")
    inputs, targets = torch.from_numpy(read), torch.from_numpy(truth)
    members = read.shape[1] // VALUES
    start = (torch.eye(VALUES, dtype=torch.float64) / members).repeat(1, members)
    matrix, offset = start.clone().requires_grad_(), torch.zeros(VALUES, dtype=torch.float64).requires_grad_()
    optimiser = torch.optim.Adam([matrix, offset], lr=RATE)
    for turn in range(ROUNDS):
        for group in optimiser.param_groups:
            group["lr"] = RATE * (1 - turn / ROUNDS)
        batch = torch.from_numpy(generator.integers(len(inputs), size=BATCH))
        error = (torch.sigmoid(inputs[batch] @ matrix.T + offset) - targets[batch]).abs().mean()
        loss = error + TOWARDS_START * (matrix - start).square().sum() / VALUES
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    return matrix.detach().numpy(), offset.detach().numpy()
