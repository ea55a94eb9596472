"""What a calibration to a camera is fitted on: its sharp patches, blurred by known kernels, as an estimator reads them.

Kernels are of the family that networks are trained on (`pipeline.learning.kernels`, with irises, halos and rendered
lenses; without those, kernels with a halo were read 40 % worse calibrated than not), none of the study's own. An
estimator that passes on its hidden units (`HasOutputLayers`) reads every sample again with white noise of 0 to 30 DN
added, for its correction (`pipeline.blur.camera_correction`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pipeline.blur import overlap
from pipeline.blur.affine_logits import Floats, logit
from pipeline.blur.base import FREQUENCIES, BlurEstimate, BlurEstimator, HiddenUnits
from pipeline.blur.camera_correction import OutputLayers
from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.errors import InputError
from pipeline.streams import stream

VALUES = 2 * FREQUENCIES
KERNELS = "with_optics"
LARGEST_SIGMA_DN = 30.0
AT_ONCE = 64
LEAST_SAMPLES = 100


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
        half_width: (N, 16) half the width of its 95 % intervals, or None.
        noisy: the same samples with noise, or None.
    """

    logits: Floats
    known: Floats
    scene: NDArray[np.int_]
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
        noisy: read them with noise as well; for an estimator that passes on its hidden units.

    Raises:
        InputError: hardly any of them can be measured.
    """
    from pipeline.camera import mtf
    from pipeline.camera.blur import blur

    bank = _kernels(samples, seed)
    shown = np.arange(samples) % len(sharp)
    clean: list[BlurEstimate] = []
    grainy: list[BlurEstimate] = []
    for first in range(0, samples, AT_ONCE):
        kernels = bank[first : first + AT_ONCE]
        picked = sharp[shown[first : first + AT_ONCE]]
        levels = blur(picked, kernels / kernels.sum((1, 2), keepdims=True)) * FULL_SCALE_DN
        clean.append(estimator.estimate(np.rint(levels) / FULL_SCALE_DN))
        if noisy:
            grainy.append(estimator.estimate(_with_noise(levels, stream(seed, "camera fit noise", first))))
    read = np.concatenate([members(item) for item in clean]).reshape(samples, -1)
    usable = ~np.isnan(read).any(axis=1)
    if grainy:
        under_noise = np.concatenate([members(item) for item in grainy]).reshape(samples, -1)
        usable &= ~np.isnan(under_noise).any(axis=1)
    if usable.sum() < LEAST_SAMPLES:
        raise InputError(
            f"sharp_patches: only {usable.sum()} of {samples} blurred samples can be measured (flat or saturated); "
            "give patches with structure, from sharp frames"
        )
    return Samples(
        logit(read[usable]),
        np.asarray(mtf.sample(bank), float).reshape(samples, VALUES)[usable],
        np.unique(overlap.scenes(sharp[:, 0])[shown[usable]], return_inverse=True)[1],
        _half_width(clean, usable),
        UnderNoise(logit(under_noise[usable]), _hidden(grainy, usable), _hidden(clean, usable)) if grainy else None,
    )


def _with_noise(levels: NDArray[np.floating], generator: np.random.Generator) -> NDArray[np.float32]:
    """Patches with white noise, each of a strength of its own, in [0, 1] and in whole grey levels."""
    sigma_dn = generator.uniform(0, LARGEST_SIGMA_DN, (len(levels), 1, 1, 1))
    noise = sigma_dn * generator.standard_normal(levels.shape)
    return (np.rint(np.clip(levels + noise, 0, FULL_SCALE_DN)) / FULL_SCALE_DN).astype(np.float32)


def _half_width(estimates: Sequence[BlurEstimate], usable: NDArray[np.bool_]) -> Floats | None:
    if any(item.low is None or item.high is None for item in estimates):
        return None
    half = np.concatenate([(np.asarray(item.high) - np.asarray(item.low)) / 2 for item in estimates])
    return half.reshape(-1, VALUES)[usable]


def _hidden(estimates: Sequence[BlurEstimate], usable: NDArray[np.bool_]) -> HiddenUnits:
    known = [item.hidden for item in estimates if item.hidden is not None]
    units, share = (np.concatenate([getattr(item, name) for item in known]) for name in ("units", "second_share"))
    return HiddenUnits(units, share).part(usable)


@lru_cache(maxsize=2)
def _kernels(count: int, seed: int) -> NDArray[np.float32]:
    """(count, 49, 49) kernels to calibrate with; rendered lenses take seconds, so the last are kept."""
    from pipeline.learning.kernels import BLOCK, block

    blocks = range(-(-count // BLOCK))
    return np.concatenate([block(index, seed, "camera fit kernels", distribution=KERNELS) for index in blocks])[:count]
