"""How the map of a camera is fitted: its strength cross-validated, and what stands beside it, by scenes held out.

A map is only as good as the scenes that it was fitted on. It is cross-validated over groups of sharp patches: how
strongly A is drawn to its start, and how far the map is drawn back to the estimator's uncalibrated output x0,

    logit(M) = w (A logit(m) + b) + (1 - w) x0,        w in {0, 1/4, 1/2, 3/4, 1}.

Of all whose held-out error exceeds the least by no more than one standard error of the difference (over sharp patches)
the strongest draw is taken, and of those the greatest w; so a calibration which does not carry over to other scenes is
none. Some cameras need much of A off the diagonal, for others most of that is the scenes': one strength for all was up
to a tenth worse on either. Sharp patches that overlap (`pipeline.blur.calibration.overlap`) are one scene and held out
together. Where all are one scene there is none to hold out, and strength and weight are fixed (`ONE_SCENE`): one
scene's map, trusted whole, was up to a fifth worse on other scenes of real cameras.

Beside the map of all networks, the last one, which alone was trained on kernels with wide halos, gets a map to itself,
of the same strength and weight; it takes over where it sees a halo (`pipeline.blur.calibration.halo`), unless held-out
errors rise by more than 1 % in the median scene: by 2 to 42 % with a camera that sharpens strongly, with none of eight
others at all. Their mean would not do: on a few scenes the network fails whatever the camera.

A correction by the networks' output layers starts from these maps (`pipeline.blur.calibration.output_layers`). Ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.blur.calibration import affine_logits, halo, output_layers
from pipeline.blur.calibration.affine_logits import sigmoid
from pipeline.blur.calibration.output_layers import Correction, OutputLayers, Part
from pipeline.blur.calibration.samples import VALUES, Samples

STRENGTHS = (1.0, 0.1, 0.01, 0.001)
"""Of the draw of A towards its start, strongest first; cross-validation takes one."""
WEIGHTS = (1.0, 0.75, 0.5, 0.25, 0.0)
"""Of the map beside the uncalibrated output, greatest first; cross-validation takes one."""
ONE_SCENE = (1, 0.75)
"""Index of the strength, and weight, of a calibration to a single scene; chosen on single patches of other cameras."""
MOST_RISE = 0.01
"""Of the error by a halo's map, in the median scene, as a share; above it there is no such map."""
FEW_SCENES = 3  # up to which the standard error is over samples: so few scenes do not give one

Map = tuple[NDArray[np.float64], NDArray[np.float64]]
"""A and b of a map of logits, ``A x + b``."""


@dataclass(frozen=True)
class Fitted:
    """What a `pipeline.blur.camera_calibration.Calibration` is made of.

    Attributes:
        matrix: (16, 16 E) A of the map.
        offset: (16,) b of the map.
        alone: (16, 17) both of the last network's own map, or None.
        error: (N, 16) absolute errors of the samples, each where it was held out.
        correction: beside the map, or None.
    """

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


def fit(samples: Samples, layers: OutputLayers | None = None, seed: int = 1) -> Fitted:
    """The map, its strength cross-validated, a correction beside it, and the map of the network that knows halos.

    Args:
        samples: that they are fitted on (`pipeline.blur.calibration.samples`).
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
    return Fitted(*whole, alone, error, correction)


def _strength(samples: Samples, maps: Sequence[Sequence[Map]]) -> _Strength:
    """The strength and weight that samples of other scenes favour; of a single scene, none can be held out."""
    scenes = int(samples.scene.max()) + 1
    if scenes == 1:
        return _Strength(*ONE_SCENE)
    independent = samples.scene if scenes > FEW_SCENES else np.arange(len(samples.known))
    held_out = _held_out(maps, samples.logits, samples.fold)
    return _chosen(held_out, samples.logits[:, :VALUES], samples.known, independent)


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
    correction, logits = output_layers.fit(layers, parts, samples.fold, samples.kernel, starts, seed)
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
