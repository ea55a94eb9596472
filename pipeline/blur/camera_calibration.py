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

An estimator of networks gets a correction beside the map of all, its output layers trained further on this camera and
under noise (`pipeline.blur.camera_correction`); where it sees a halo, the last network's map takes over from both.
Ours; the paper reads an estimator's answers as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pipeline.blur import affine_logits, camera_correction, halo
from pipeline.blur.affine_logits import logit, sigmoid
from pipeline.blur.base import FREQUENCIES, BlurEstimate, BlurEstimator, HiddenUnits, as_patches
from pipeline.blur.camera_correction import Correction, OutputLayers, Part
from pipeline.blur.camera_samples import LEAST_SAMPLES, VALUES, HasOutputLayers, Samples, blurred, members
from pipeline.camera.mtf import CAMERA, SYSTEM
from pipeline.errors import InputError

MOST_MEMBERS = 8
SAMPLES = 2400
COVERAGE = 0.95
STRENGTHS = (1.0, 0.1, 0.01, 0.001)
"""Of the draw of A towards its start, strongest first; cross-validation takes one."""
WEIGHTS = (1.0, 0.75, 0.5, 0.25, 0.0)
"""Of the map beside the uncalibrated output, greatest first; cross-validation takes one."""
ONE_SCENE = (1, 0.75)
"""Index of the strength, and weight, of a calibration to a single scene; chosen on single patches of other cameras."""
MOST_RISE = 0.01
"""Of the error by a halo's map, in the median scene, as a share; above it there is no such map."""
INCOMPLETE = "incomplete"
"""Why a patch is abstained from whose MTF is not known at every frequency."""
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
        correction: beside the map, or None.
    """

    matrix: NDArray[np.float64]
    offset: NDArray[np.float64]
    widening: float
    samples: int
    error_percent: tuple[float, float]
    alone: NDArray[np.float64] | None = None
    correction: Correction | None = None

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
        correction = Correction.from_content(content["correction"], VALUES) if "correction" in content else None
        before, after = content["error_percent"]
        errors = (float(before), float(after))
        return cls(matrix, offset, widening, int(content["samples"]), errors, alone, correction)

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

    Every corrected value rests on all frequencies: a patch of which some are unknown is abstained from, `INCOMPLETE`.

    Raises:
        InputError: the calibration is of an ensemble of other networks.
    """
    known = members(estimate)[:, : camera.members]  # a map of one network alone takes the joint output
    if known.shape[1] != camera.members:
        raise InputError(
            f"calibration of an ensemble of {camera.members} networks, estimator of {known.shape[1]}; calibrate anew"
        )
    mtf = camera(known, estimate.hidden)
    incomplete = np.isnan(mtf).any(axis=(1, 2)) & ~estimate.abstained
    mtf[incomplete] = np.nan
    reason = np.where(incomplete, INCOMPLETE, estimate.reason)
    ends: dict[str, Any] = {"low": None, "high": None}
    half = estimate.half_width()
    if half is not None and not np.isnan(camera.widening):
        half *= camera.widening
        ends = {"low": np.clip(mtf - half, 0, 1), "high": np.clip(mtf + half, 0, 1)}
    return replace(
        estimate, mtf=mtf, abstained=estimate.abstained | incomplete, reason=reason,
        kernel=None, half=None, members=None, hidden=None, **ends,
    )  # fmt: skip


def calibrate(estimator: BlurEstimator, sharp_patches: Any, *, samples: int = SAMPLES, seed: int = 1) -> CameraMap:
    """Calibrate an estimator to a camera: by its own `CameraFittable.fit_camera` if it has one, else `fit_map`.

    Arguments and errors are those of `fit_map`; an estimator that is calibrated already is one too.
    """
    relative_to = getattr(estimator, "relative_to", SYSTEM)
    if relative_to != SYSTEM:
        raise InputError(
            f"{type(estimator).__name__}: answers relative to the {relative_to}; expected an estimator of the whole "
            "system's MTF to calibrate"
        )
    if isinstance(estimator, CameraFittable):
        return estimator.fit_camera(sharp_patches, samples=samples, seed=seed)
    return fit_map(estimator, sharp_patches, samples=samples, seed=seed)


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
    from pipeline.executor import one_thread

    one_thread()
    sharp = as_patches(sharp_patches, "sharp_patches")
    if samples < LEAST_SAMPLES:
        raise InputError(f"samples={samples}; expected at least {LEAST_SAMPLES} to fit a camera on")
    if len(sharp) == 0:
        raise InputError("sharp_patches: none given; cut some from frames known to be sharp")
    layers = estimator.output_layers() if correction and isinstance(estimator, HasOutputLayers) else None
    read = blurred(estimator, sharp, samples, seed, noisy=layers is not None)
    fitted = _fitted(read, layers, seed)
    before = 100 * float(np.abs(sigmoid(read.logits[:, :VALUES]) - read.known).mean())
    return Calibration(
        fitted.matrix, fitted.offset, _widening(read.half_width, fitted.error), len(read.known),
        (before, 100 * float(fitted.error.mean())), fitted.alone, fitted.correction,
    )  # fmt: skip


Map = tuple[NDArray[np.float64], NDArray[np.float64]]
"""A and b of a map of logits, ``A x + b``."""


@dataclass(frozen=True)
class _Fitted:
    """Maps and correction of a `Calibration`, and the absolute errors (N, 16) of samples that were held out."""

    matrix: NDArray[np.float64]
    offset: NDArray[np.float64]
    alone: NDArray[np.float64] | None
    error: NDArray[np.float64]
    correction: Correction | None = None


@dataclass(frozen=True)
class _Strength:
    """How far maps depart from the uncalibrated output.

    Attributes:
        index: of `STRENGTHS`.
        weight: of the map beside the uncalibrated output, of `WEIGHTS`.
    """

    index: int
    weight: float

    def drawn_back(self, fitted: Sequence[Map]) -> Map:
        """The map of this strength, of those of all strengths, at this weight."""
        matrix, offset = fitted[self.index]
        return _drawn_back(matrix, np.eye(*matrix.shape), self.weight), self.weight * offset

    def held_out(
        self, maps: Sequence[Sequence[Map]], logits: NDArray[np.float64], folds: NDArray[np.int_]
    ) -> NDArray[np.float64]:
        """(N, 16) logits of every sample by such a map of the other folds."""
        return _drawn_back(_held_out(maps, logits, folds)[self.index], logits[:, :VALUES], self.weight)


def _fitted(samples: Samples, layers: OutputLayers | None = None, seed: int = 1) -> _Fitted:
    """The map, its strength cross-validated, a correction beside it, and the map of the network that knows halos.

    Args:
        samples: that they are fitted on.
        layers: output layers of the estimator's networks, for a correction; None for none.
        seed: of the correction.
    """
    logits, known = samples.logits, samples.known
    maps = _cross_fitted(logits, known, samples.fold, STRENGTHS)
    strength = _strength(samples, maps)
    whole = strength.drawn_back(affine_logits.fit(logits, known, STRENGTHS[: strength.index + 1]))
    correction, joint = None, strength.held_out(maps, logits, samples.fold)
    if layers is not None and samples.noisy is not None and samples.scene.any():
        correction, joint = _corrected(samples, layers, maps, strength, whole, seed)
    alone, error = _alone(samples, strength, joint)
    return _Fitted(*whole, alone, error, correction)


def _strength(samples: Samples, maps: Sequence[Sequence[Map]]) -> _Strength:
    """The strength and weight that samples of other scenes favour; of a single scene, none can be held out."""
    scenes = int(samples.scene.max()) + 1
    if scenes == 1:
        return _Strength(*ONE_SCENE)
    judged = samples.scene if scenes > FEW_SCENES else np.arange(len(samples.known))
    held_out = _held_out(maps, samples.logits, samples.fold)
    return _chosen(held_out, samples.logits[:, :VALUES], samples.known, judged)


def _corrected(
    samples: Samples, layers: OutputLayers, maps: Sequence[Sequence[Map]], strength: _Strength, whole: Map, seed: int
) -> tuple[Correction | None, NDArray[np.float64]]:
    """The correction that starts from the maps, by samples without and with noise; held-out logits (N, 16) with it."""
    noisy = samples.noisy
    assert noisy is not None
    clean = strength.held_out(maps, samples.logits, samples.fold)
    grainy = strength.held_out(maps, noisy.logits, samples.fold)
    parts = [Part(noisy.clean, clean, samples.known), Part(noisy.hidden, grainy, samples.known)]
    starts = [*map(strength.drawn_back, maps), whole]
    correction, logits = camera_correction.fit(layers, parts, samples.fold, samples.kernel, starts, seed)
    return correction, logits[0]


def _alone(
    samples: Samples, strength: _Strength, joint: NDArray[np.float64]
) -> tuple[NDArray[np.float64] | None, NDArray[np.float64]]:
    """A and b of the network that knows halos, where following it costs little; held-out errors (N, 16) with it.

    Args:
        samples: of an ensemble, whose last network it is, or of a single network.
        strength: of the map of all networks.
        joint: (N, 16) held-out logits by that map and the correction.
    """
    known, last = samples.known, samples.logits[:, -VALUES:]
    error = np.abs(sigmoid(joint) - known)
    if samples.logits.shape[1] == VALUES:
        return None, error
    strengths = STRENGTHS[: strength.index + 1]
    other = strength.held_out(_cross_fitted(last, known, samples.fold, strengths), last, samples.fold)
    switched = np.abs(halo.mixed(sigmoid(joint), sigmoid(other)) - known)
    if _median_rise(switched, error, samples.scene) > MOST_RISE:
        return None, error
    matrix, offset = strength.drawn_back(affine_logits.fit(last, known, strengths))
    return np.concatenate([matrix, offset[:, None]], axis=1), switched


def _drawn_back(mapped: NDArray[np.float64], start: NDArray[np.float64], weight: float) -> NDArray[np.float64]:
    """What a map gives, or the map itself, at this weight beside its start."""
    return np.asarray(weight * mapped + (1 - weight) * start)


def _cross_fitted(
    read: NDArray[np.float64], truth: NDArray[np.float64], groups: NDArray[np.int_], strengths: Sequence[float]
) -> list[list[Map]]:
    """Of each group, in order, the maps of each strength that were calibrated on the other groups."""
    return [affine_logits.fit(read[groups != group], truth[groups != group], strengths) for group in np.unique(groups)]


def _held_out(
    maps: Sequence[Sequence[Map]], read: NDArray[np.float64], groups: NDArray[np.int_]
) -> NDArray[np.float64]:
    """(S, N, 16) logits of every sample by the maps of each strength that were calibrated on the other groups."""
    result = np.empty((len(maps[0]), len(read), VALUES))
    for group, strengths in zip(np.unique(groups), maps, strict=True):
        out = groups == group
        for index, (matrix, offset) in enumerate(strengths):
            result[index, out] = read[out] @ matrix.T + offset
    return result


def _chosen(
    held_out: NDArray[np.float64], plain: NDArray[np.float64], truth: NDArray[np.float64], scene: NDArray[np.int_]
) -> _Strength:
    """Which strength and weight to take.

    Args:
        held_out: see `_held_out`.
        plain: (N, 16) logits of the uncalibrated output.
        truth: (N, 16).
        scene: (N,) number, 0 to K - 1, of what each sample shows; the standard error is over these, K > 1.
    """
    errors = {
        (index, weight): np.abs(sigmoid(_drawn_back(mapped, plain, weight)) - truth)
        for index, mapped in enumerate(held_out)
        for weight in WEIGHTS
    }
    least = min(errors.values(), key=np.mean).mean(axis=1)
    samples = np.bincount(scene)

    def as_good(error: NDArray[np.float64]) -> bool:
        more = error.mean(axis=1) - least
        by_scene = np.bincount(scene, more) / samples
        return bool(more.mean() <= by_scene.std(ddof=1) / np.sqrt(len(by_scene)))

    return _Strength(*next(key for key, error in errors.items() if as_good(error)))


def _median_rise(error: NDArray[np.float64], before: NDArray[np.float64], scene: NDArray[np.int_]) -> float:
    """How much larger the first error is than the second in the median scene, as a share of the second.

    Args:
        error: (N, 16) absolute.
        before: (N, 16), of the same samples.
        scene: (N,) number, from 0, of what each sample shows.
    """
    rise = np.bincount(scene, (error - before).mean(axis=1)) / np.bincount(scene, before.mean(axis=1))
    return float(np.median(rise))


def _widening(half_width: NDArray[np.float64] | None, error: NDArray[np.float64]) -> float:
    """Factor on the half width of intervals by which they hold 95 % of the errors; NaN without intervals."""
    if half_width is None:
        return float("nan")
    return float(np.quantile(error / np.maximum(half_width, 1e-3), COVERAGE))
