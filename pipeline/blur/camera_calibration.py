"""Any blur estimator, corrected for one camera by its estimates of that camera's sharp frames, blurred synthetically.

Sharp patches are blurred by kernels whose MTF M is known, the estimator reads m from them, and an affine map of logits
is fitted that brings its estimates to the truth:

    logit(M) ~ A logit(m) + b,        A: 16 x 16 E, b: 16   (two directions x eight frequencies, E networks)

by least absolute error, with A drawn towards the mean of the E networks that an ensemble joins, the identity where
E = 1 (`pipeline.blur.affine_logits`). Division by the sharp frames' own MTF (`Estimator.divided`) is right where an
estimator errs by a factor; this also mends errors that grow with blur, leak from one frequency into another, or take
the camera's sharpening for sharpness, and it weights the networks by how well they do on this camera. The result is the
MTF relative to the camera's sharp frames.

A map is only as good as the scenes that it was fitted on. It is cross-validated over groups of sharp patches: how
strongly A is drawn to its start, and how far the map is drawn back to the estimator's uncalibrated output x0,

    logit(M) = w (A logit(m) + b) + (1 - w) x0,        w in {0, 1/4, 1/2, 3/4, 1}.

Of all whose held-out error exceeds the least by no more than one standard error of the difference (over sharp patches)
the strongest draw is taken, and of those the greatest w; so a calibration which does not carry over to other scenes is
none. Some cameras need much of A off the diagonal, for others most of that is the scenes': one strength for all was up
to a tenth worse on either. Sharp patches that overlap (`pipeline.blur.overlap`) are one scene and held out together.
Where all are one scene there is none to hold out, and strength and weight are fixed (`ONE_SCENE`): one scene's map,
trusted whole, was up to a fifth worse on other scenes of real cameras. Intervals are widened by the held-out errors.

Beside the map of all networks, the last one, which alone was trained on kernels with wide halos, gets a map to itself,
of the same strength and weight; it takes over where it sees a halo (`pipeline.blur.halo`), unless held-out errors rise
by more than 1 % in the median scene: by 2 to 42 % with a camera that sharpens strongly, with none of eight others at
all. Their mean would not do: on a few scenes the network fails whatever the camera.

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

from pipeline.blur import affine_logits, halo, overlap
from pipeline.blur.affine_logits import logit, sigmoid
from pipeline.blur.base import FREQUENCIES, BlurEstimate, BlurEstimator, as_patches
from pipeline.camera.mtf import CAMERA
from pipeline.errors import InputError

VALUES = 2 * FREQUENCIES
KERNELS = "with_optics"
MOST_MEMBERS = 8
SAMPLES = 1200
AT_ONCE = 64
COVERAGE = 0.95
LEAST_SAMPLES = 100
FOLDS = 4
STRENGTHS = (1.0, 0.1, 0.01, 0.001)
"""Of the draw of A towards its start, strongest first; cross-validation takes one."""
WEIGHTS = (1.0, 0.75, 0.5, 0.25, 0.0)
"""Of the map beside the uncalibrated output, greatest first; cross-validation takes one."""
ONE_SCENE = (1, 0.75)
"""Index of the strength, and weight, of a calibration to a single scene; chosen on single patches of other cameras."""
MOST_RISE = 0.01
"""Of the error by a halo's map, in the median scene, as a share; above it there is no such map."""
FEW_SCENES = 3  # up to which the standard error is over samples: so few scenes do not give one


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
        alone: (16, 17) matrix and offset of the last network alone (`pipeline.blur.halo`), or None.
    """

    matrix: NDArray[np.float64]
    offset: NDArray[np.float64]
    widening: float
    samples: int
    error_percent: tuple[float, float]
    alone: NDArray[np.float64] | None = None

    @property
    def members(self) -> int:
        """Networks that the map takes the MTFs of."""
        return self.matrix.shape[1] // VALUES

    def __call__(self, mtf: NDArray[np.floating]) -> NDArray[np.float64]:
        """Corrected MTFs: (N, 2, 8) in (0, 1), of those estimated, (N, 2, 8) or (N, E, 2, 8); NaN stays."""
        logits = logit(mtf.reshape(len(mtf), -1))
        mapped = sigmoid(logits @ self.matrix.T + self.offset)
        if self.alone is not None:
            last = logits[:, -VALUES:] @ self.alone[:, :-1].T + self.alone[:, -1]
            mapped = halo.mixed(mapped, sigmoid(last))
        return mapped.reshape(len(mtf), 2, FREQUENCIES)

    def answer(self, estimator: BlurEstimator, patches: Any) -> BlurEstimate:
        """The MTF added to the camera's sharp frames; see `corrected`."""
        return corrected(estimator.estimate(patches), self)

    def content(self) -> dict[str, Any]:
        """Everything in it, as JSON can hold it."""
        content = {"matrix": self.matrix.tolist(), "offset": self.offset.tolist(), "samples": self.samples}
        content["widening"] = None if np.isnan(self.widening) else self.widening
        if self.alone is not None:
            content["alone"] = self.alone.tolist()
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
        before, after = content["error_percent"]
        return cls(matrix, offset, widening, int(content["samples"]), (float(before), float(after)), alone)

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
        seed: of the kernels.

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
    logits, known = logit(read[usable]), truth[usable]
    scene = np.unique(overlap.scenes(sharp[:, 0])[(np.arange(samples) % len(sharp))[usable]], return_inverse=True)[1]
    fitted = _fitted(logits, known, scene)
    percent = (100 * float(np.abs(sigmoid(logits[:, :VALUES]) - known).mean()), 100 * float(fitted.error.mean()))
    widening = _widening(results, usable, fitted.error)
    return Calibration(fitted.matrix, fitted.offset, widening, int(usable.sum()), percent, fitted.alone)


@dataclass(frozen=True)
class _Fitted:
    """Maps of a `Calibration`, and the absolute errors (N, 16) of samples that were held out."""

    matrix: NDArray[np.float64]
    offset: NDArray[np.float64]
    alone: NDArray[np.float64] | None
    error: NDArray[np.float64]


def _fitted(logits: NDArray[np.float64], known: NDArray[np.float64], scene: NDArray[np.int_]) -> _Fitted:
    """The maps, their strength and weight cross-validated.

    Args:
        logits: (N, 16 E) of the estimates.
        known: (N, 16) true MTFs.
        scene: (N,) number, from 0, of what each sample shows.
    """
    count = int(scene.max()) + 1
    groups, plain, last = _groups(scene, count), logits[:, :VALUES], logits[:, -VALUES:]
    judged = scene if count > FEW_SCENES else np.arange(len(known))
    held_out = _held_out(logits, known, groups, STRENGTHS)
    if count == 1:
        index, weight = ONE_SCENE
        error = _errors(held_out[index], plain, known, weight)
    else:
        index, weight, error = _chosen(held_out, plain, known, judged)
    strengths = STRENGTHS[: index + 1]
    matrix, offset = _map_drawn_back(affine_logits.fit(logits, known, strengths)[index], weight)
    alone = None
    if logits.shape[1] > VALUES:
        joint = _drawn_back(held_out[index], plain, weight)
        other = _drawn_back(_held_out(last, known, groups, strengths)[index], last, weight)
        switched = np.abs(halo.mixed(sigmoid(joint), sigmoid(other)) - known)
        if _median_rise(switched, error, scene) <= MOST_RISE:
            single, shift = _map_drawn_back(affine_logits.fit(last, known, strengths)[index], weight)
            alone, error = np.concatenate([single, shift[:, None]], axis=1), switched
    return _Fitted(matrix, offset, alone, error)


def _drawn_back(mapped: NDArray[np.float64], start: NDArray[np.float64], weight: float) -> NDArray[np.float64]:
    """What a map gives, or the map itself, at this weight beside its start."""
    return np.asarray(weight * mapped + (1 - weight) * start)


def _map_drawn_back(
    fitted: tuple[NDArray[np.float64], NDArray[np.float64]], weight: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A and b of a map at this weight beside the uncalibrated output, which is the first network's."""
    matrix, offset = fitted
    return _drawn_back(matrix, np.eye(*matrix.shape), weight), weight * offset


@lru_cache(maxsize=2)
def _kernels(count: int, seed: int) -> NDArray[np.float32]:
    """(count, 49, 49) kernels to calibrate with; rendered lenses take seconds, so the last are kept."""
    from pipeline.learning.kernels import BLOCK, block

    blocks = range(-(-count // BLOCK))
    return np.concatenate([block(index, seed, "camera fit kernels", distribution=KERNELS) for index in blocks])[:count]


def _groups(scene: NDArray[np.int_], count: int) -> NDArray[np.int_]:
    """The fold of each sample: neighbouring sharp patches, which may show the same surroundings, are in one fold.

    Args:
        scene: (N,) what the sharp patch shows that a sample was made of.
        count: of scenes; with a single one, folds differ in kernels only.
    """
    return np.arange(len(scene)) % FOLDS if count == 1 else scene * min(FOLDS, count) // count


def _held_out(
    read: NDArray[np.float64], truth: NDArray[np.float64], groups: NDArray[np.int_], strengths: Sequence[float]
) -> NDArray[np.float64]:
    """(S, N, 16) logits of every sample by the maps of each strength that were calibrated on the other groups."""
    result = np.empty((len(strengths), *truth.shape))
    for group in np.unique(groups):
        out = groups == group
        for index, (matrix, offset) in enumerate(affine_logits.fit(read[~out], truth[~out], strengths)):
            result[index, out] = read[out] @ matrix.T + offset
    return result


def _errors(
    mapped: NDArray[np.float64], plain: NDArray[np.float64], truth: NDArray[np.float64], weight: float
) -> NDArray[np.float64]:
    """(N, 16) absolute errors of a map's logits at this weight beside the uncalibrated ones."""
    return np.asarray(np.abs(sigmoid(_drawn_back(mapped, plain, weight)) - truth))


def _chosen(
    held_out: NDArray[np.float64], plain: NDArray[np.float64], truth: NDArray[np.float64], scene: NDArray[np.int_]
) -> tuple[int, float, NDArray[np.float64]]:
    """Which strength and weight to take, and the held-out absolute errors (N, 16) with them.

    Args:
        held_out: see `_held_out`.
        plain: (N, 16) logits of the uncalibrated output.
        truth: (N, 16).
        scene: (N,) number, 0 to K - 1, of what each sample shows; the standard error is over these, K > 1.
    """
    errors = {
        (index, weight): _errors(mapped, plain, truth, weight)
        for index, mapped in enumerate(held_out)
        for weight in WEIGHTS
    }
    least = min(errors.values(), key=np.mean).mean(axis=1)
    samples = np.bincount(scene)

    def as_good(error: NDArray[np.float64]) -> bool:
        more = error.mean(axis=1) - least
        by_scene = np.bincount(scene, more) / samples
        return bool(more.mean() <= by_scene.std(ddof=1) / np.sqrt(len(by_scene)))

    index, weight = next(key for key, error in errors.items() if as_good(error))
    return index, weight, errors[index, weight]


def _median_rise(error: NDArray[np.float64], before: NDArray[np.float64], scene: NDArray[np.int_]) -> float:
    """How much larger the first error is than the second in the median scene, as a share of the second.

    Args:
        error: (N, 16) absolute.
        before: (N, 16), of the same samples.
        scene: (N,) number, from 0, of what each sample shows.
    """
    rise = np.bincount(scene, (error - before).mean(axis=1)) / np.bincount(scene, before.mean(axis=1))
    return float(np.median(rise))


def _widening(found: Sequence[BlurEstimate], usable: NDArray[np.bool_], error: NDArray[np.float64]) -> float:
    """Factor on the half width of intervals by which they hold 95 % of the errors."""
    if any(item.low is None or item.high is None for item in found):
        return float("nan")
    half = np.concatenate([(np.asarray(item.high) - np.asarray(item.low)) / 2 for item in found]).reshape(-1, VALUES)
    return float(np.quantile(error / np.maximum(half[usable], 1e-3), COVERAGE))
