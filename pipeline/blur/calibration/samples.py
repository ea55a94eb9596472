"""What a calibration to a camera is fitted on: its sharp patches, blurred by known kernels, as an estimator reads them.

Kernels are of the family that networks are trained on (`pipeline.learning.kernels`, with irises, halos and rendered
lenses; without those, kernels with a halo were read 40 % worse calibrated than not), none of the study's own. An
estimator that passes on its hidden units (`HasOutputLayers`) reads every sample again with white noise of 0 to 30 DN
added, for its correction (`pipeline.blur.calibration.output_layers`); there each kernel blurs up to four of the sharp
patches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pipeline.blur.base import FREQUENCIES, BlurEstimate, BlurEstimator, HiddenUnits
from pipeline.blur.calibration import overlap
from pipeline.blur.calibration.affine_logits import Floats, logit
from pipeline.blur.calibration.output_layers import OutputLayers
from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.errors import InputError
from pipeline.streams import stream

VALUES = 2 * FREQUENCIES
KERNELS = "with_optics"
LARGEST_SIGMA_DN = 30.0
AT_ONCE = 64
LEAST_SAMPLES = 100
FOLDS = 4
TOGETHER = 4
"""Most patches that a kernel blurs, under noise of one strength, for a correction."""


@dataclass(frozen=True)
class UnderNoise:
    """Samples with noise, by an estimator that passes on its hidden units.

    Attributes:
        logits: (N, 16 E) of the estimated MTFs.
        hidden: units with noise.
        clean: units of the same samples without.
    """

    logits: Floats
    hidden: HiddenUnits
    clean: HiddenUnits


@dataclass(frozen=True)
class Samples:
    """Blurred patches that an estimator can measure.

    Attributes:
        logits: (N, 16 E) of the estimated MTFs, network after network.
        known: (N, 16) true MTFs.
        scene: (N,) number, from 0, of what each sample shows.
        kernel: (N,) number of the kernel that blurred it.
        fold: (N,) fold of its scene; no kernel is in two of them.
        half_width: (N, 16) half the width of its 95 % intervals (`BlurEstimate.half_width`), or None.
        noisy: the same samples with noise, or None.
    """

    logits: Floats
    known: Floats
    scene: NDArray[np.int_]
    kernel: NDArray[np.int_]
    fold: NDArray[np.int_]
    half_width: Floats | None = None
    noisy: UnderNoise | None = None


@runtime_checkable
class HasOutputLayers(Protocol):
    """An estimator of networks that passes on their hidden units (`BlurEstimate.hidden`)."""

    def output_layers(self) -> OutputLayers:
        """The layers above these units."""
        ...


def members(estimate: BlurEstimate) -> Floats:
    """(N, E, 2, 8) MTFs by the networks of an ensemble, its joint output first; E = 1 for a single one."""
    return np.asarray(estimate.mtf[:, None] if estimate.members is None else estimate.members, float)


def blurred(estimator: BlurEstimator, sharp: NDArray[np.float32], samples: int, seed: int, *, noisy: bool) -> Samples:
    """Blur a camera's sharp patches and have them read.

    Args:
        estimator: not calibrated.
        sharp: (P, 1, 192, 192) in [0, 1]; every one is used about equally often.
        samples: how many.
        seed: of the kernels and of the noise.
        noisy: read them with noise as well, if they show two scenes or more; for an estimator that passes on its hidden
            units.

    Raises:
        InputError: hardly any of them can be measured.
    """
    from pipeline.camera import mtf

    scene = overlap.scenes(sharp[:, 0])
    fold = _folds(scene)
    shown, kernel = np.arange(samples) % len(sharp), np.arange(samples)
    noisy = noisy and bool(scene.any())  # of a single scene, none can be held out of a correction
    if noisy:
        shown, kernel = _several_at_once(fold, samples, stream(seed, "camera fit patches"))
    bank = _kernels(int(kernel[-1]) + 1, seed)
    clean, under_noise = _estimates(estimator, sharp, shown, bank, kernel, seed, noisy=noisy)
    mtfs = _networks_mtf(clean)
    usable = np.asarray(~np.isnan(mtfs).any(axis=1))
    if noisy:
        noisy_mtfs = _networks_mtf(under_noise)
        usable &= ~np.isnan(noisy_mtfs).any(axis=1)
    if usable.sum() < LEAST_SAMPLES:
        raise InputError(
            f"sharp_patches: only {usable.sum()} of {samples} blurred samples can be measured (flat or saturated); "
            "give patches with structure, from sharp frames"
        )
    known = np.asarray(mtf.sample(bank), float).reshape(-1, VALUES)[kernel[usable]]
    shown, kernel = shown[usable], np.unique(kernel[usable], return_inverse=True)[1]
    scene, fold = np.unique(scene[shown], return_inverse=True)[1], fold[shown]
    if not noisy or not np.ptp(fold):
        fold = _folds(scene) if scene.any() else kernel % FOLDS  # of a single scene, folds differ in kernels only
    return Samples(
        logit(mtfs[usable]),
        known,
        scene,
        kernel,
        fold,
        _half_width(clean, usable),
        UnderNoise(logit(noisy_mtfs[usable]), _hidden(under_noise, usable), _hidden(clean, usable)) if noisy else None,
    )


def _estimates(
    estimator: BlurEstimator,
    sharp: NDArray[np.float32],
    shown: NDArray[np.int_],
    bank: NDArray[np.float32],
    kernel: NDArray[np.int_],
    seed: int,
    *,
    noisy: bool,
) -> tuple[list[BlurEstimate], list[BlurEstimate]]:
    """What an estimator reads of blurred patches without noise, and with it; nothing there where it is not asked for.

    Args:
        estimator: not calibrated.
        sharp: (P, 1, 192, 192) in [0, 1]; copied a part of the samples at a time, for all of them take 350 MB.
        shown: (N,) number of the patch that each sample shows.
        bank: (K, 49, 49) kernels.
        kernel: (N,) number of that which blurs each sample; samples of one kernel have noise of one strength.
        seed: of the noise.
        noisy: read them with noise as well.
    """
    from pipeline.camera.blur import blur

    sigma_dn = stream(seed, "camera fit noise").uniform(0, LARGEST_SIGMA_DN, len(bank))
    clean: list[BlurEstimate] = []
    under_noise: list[BlurEstimate] = []
    for first in range(0, len(shown), AT_ONCE):
        part = slice(first, first + AT_ONCE)
        kernels = bank[kernel[part]]
        levels = blur(sharp[shown[part]], kernels / kernels.sum((1, 2), keepdims=True)) * FULL_SCALE_DN
        clean.append(estimator.estimate(np.rint(levels) / FULL_SCALE_DN))
        if noisy:
            generator = stream(seed, "camera fit noise", first)
            under_noise.append(estimator.estimate(_with_noise(levels, sigma_dn[kernel[part]], generator)))
    return clean, under_noise


def _networks_mtf(estimates: Sequence[BlurEstimate]) -> NDArray[np.float64]:
    """(N, 16 E) MTFs, network after network; NaN where abstained."""
    return np.concatenate([members(estimate).reshape(len(estimate), -1) for estimate in estimates])


def _folds(scene: NDArray[np.int_]) -> NDArray[np.int_]:
    """The fold of each scene: neighbours, which may show the same surroundings, are in one fold."""
    count = int(scene.max()) + 1
    return scene * min(FOLDS, count) // count


def _several_at_once(
    fold: NDArray[np.int_], samples: int, generator: np.random.Generator
) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Which patch each sample shows and which kernel blurs it, every patch equally often; a kernel's are of one fold.

    So scenes are held out together with kernels: a correction could know one again that it was trained on.

    Args:
        fold: (P,) of the sharp patches.
        samples: N.
        generator: of who are together; others each time.

    Returns:
        (N,) number of the patch, and (N,) of the kernel, rising.
    """
    sets: list[NDArray[np.int_]] = []
    while sum(map(len, sets)) < samples:
        for number in np.unique(fold):
            patches = generator.permutation(np.flatnonzero(fold == number))
            sets += np.array_split(patches, -(-len(patches) // TOGETHER))
    kernel = np.repeat(np.arange(len(sets)), [len(patches) for patches in sets])
    return np.concatenate(sets)[:samples], kernel[:samples]


def _with_noise(
    levels: NDArray[np.floating], sigma_dn: NDArray[np.float64], generator: np.random.Generator
) -> NDArray[np.float32]:
    """Patches with white noise, each of its strength, in [0, 1] and in whole grey levels."""
    noise = sigma_dn[:, None, None, None] * generator.standard_normal(levels.shape)
    return (np.rint(np.clip(levels + noise, 0, FULL_SCALE_DN)) / FULL_SCALE_DN).astype(np.float32)


def _half_width(estimates: Sequence[BlurEstimate], usable: NDArray[np.bool_]) -> Floats | None:
    half = [width for item in estimates if (width := item.half_width()) is not None]
    return np.concatenate(half).reshape(-1, VALUES)[usable] if len(half) == len(estimates) else None


def _hidden(estimates: Sequence[BlurEstimate], usable: NDArray[np.bool_]) -> HiddenUnits:
    known = [item.hidden for item in estimates if item.hidden is not None]
    arrays = (np.concatenate([getattr(item, part.name) for item in known]) for part in fields(HiddenUnits))
    return HiddenUnits(*arrays).part(usable)


def _kernels(count: int, seed: int) -> NDArray[np.float32]:
    """(count, 49, 49) kernels to calibrate with."""
    from pipeline.learning.kernels import BLOCK

    return np.concatenate([_block(index, seed) for index in range(-(-count // BLOCK))])[:count]


@lru_cache(maxsize=16)
def _block(index: int, seed: int) -> NDArray[np.float32]:
    """One block of kernels (`pipeline.learning.kernels`); rendered lenses take seconds, so the last blocks are kept."""
    from pipeline.learning.kernels import block

    return block(index, seed, "camera fit kernels", distribution=KERNELS)
