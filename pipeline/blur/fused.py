"""Fused estimator: networks on every patch, GBB and PMP on a few blurred ones, joined by a learned gate.

The spectral network costs milliseconds and its errors are a common bias of scene and kernel; those of GBB and PMP are
nearly independent of it (`pipeline.blur.fusion.gate`). Blind deconvolution costs about half a second a patch, and
pays only where there is blur: with m the mean MTF by the spectral network (calibrated to the camera if that was done),

    answer = w gate + (1 - w) spectral,     w = clip((0.6 - m) / 0.2, 0, 1) clip((b - 0.013) / 0.007, 0, 1),

so sharp frames stay at milliseconds; and so do patches that the spectral network is sure of, by the mean b of its scale
before any calibration (defocus by a disc, as a rule): on procedural samples of b below 0.013 its mean error is 0.53
points and that of the gate 0.58. Where it is not, and there is a calibration, spectral stands for

    (1 - u / 2) spectral + u / 2 (spectral and pixel network calibrated together),  u = clip((b - 0.013) / 0.007, 0, 1),

the mean of two calibrations, because the pixel network errs in other ways (`pipeline.blur.spectral_and_pixels`) and on
single patches more: by the second one alone KITTI was estimated worse, by their mean all recorded frames better.

Patches of one call that are blurred alike (`pipeline.blur.shared_blur`) share one kernel: GBB and PMP solve the stacked
equations of at most `deconvolved_patches` of them, and the gate joins the answer with the spectral MTF of every one
(or, without `joint`, each of them is solved alone). A patch with another blur is deconvolved alone. Nothing is random;
the answer for a patch depends on the other patches of the call, by which ones are deconvolved with it.

Answers are total MTFs until `Fused.calibrated` makes them relative to a camera's sharp frames. Ours; the gate is
trained on procedural pictures only (`pipeline.blur.fusion.training`).
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from pipeline.blur import shared_blur
from pipeline.blur.base import BlurEstimate, Estimator, as_patches
from pipeline.blur.calibration import overlap
from pipeline.blur.camera_calibration import SAMPLES, fit_map
from pipeline.blur.estimator_identity import EstimatorIdentity
from pipeline.blur.fusion.camera import SHARP_PATCHES, FusionMap
from pipeline.blur.fusion.members import Deconvolution, join_members
from pipeline.blur.spectral import RELEASED as RELEASED_SPECTRAL
from pipeline.blur.spectral import RELEASED_PROCESSED, Spectral
from pipeline.blur.spectral_and_pixels import RELEASED as RELEASED_PIXELS
from pipeline.blur.spectral_and_pixels import SpectralAndPixels
from pipeline.camera.mtf import CAMERA, SYSTEM
from pipeline.errors import InputError, did_you_mean
from pipeline.learning.inference import inference
from pipeline.project_files import located
from pipeline.weight_files import active

RELEASED = located("data/weights/mtf_fusion.safetensors")
RELEASED_BESIDE = {
    "spectral_weights": RELEASED_SPECTRAL,
    "processed_weights": RELEASED_PROCESSED,
    "pixel_weights": RELEASED_PIXELS,
}
SHARED = ("auto", "always", "never")
PAYS_BELOW = 0.6  # mean MTF under which deconvolution begins to help
PAYS_FULLY_BELOW = 0.4
UNSURE_ABOVE_SCALE = 0.013  # mean scale of the spectral network over which other estimators begin to help
UNSURE_FULLY_ABOVE_SCALE = 0.02
PIXELS_WEIGHT = 0.5  # of the calibration with the pixel network, where the spectral one is fully unsure


@dataclass(frozen=True)
class SpectralAnswer:
    """What the networks return of N patches, calibrated where there is a calibration.

    Attributes:
        mtf: (N, 2, 8).
        scale: (N, 2, 8) Laplace scale of the spectral one.
        sigma_dn: (N,) noise, DN.
        pays: (N,) weight in [0, 1] of what deconvolution adds.
    """

    mtf: NDArray[np.float64]
    scale: NDArray[np.float64]
    sigma_dn: NDArray[np.float64]
    pays: NDArray[np.float64]

    def part(self, indices: NDArray[np.int_]) -> SpectralAnswer:
        """Those of some patches."""
        return SpectralAnswer(self.mtf[indices], self.scale[indices], self.sigma_dn[indices], self.pays[indices])


def deconvolution_pays(mtf: NDArray[np.float64], scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """The weight w of the gate's answer beside the spectral one; see the module.

    Args:
        mtf: (N, 2, 8) by the spectral network, calibrated where there is a calibration.
        scale: (N, 2, 8) its Laplace scale, not widened by a calibration.

    Returns:
        (N,) in [0, 1].
    """
    blurred = (PAYS_BELOW - mtf.mean(axis=(1, 2))) / (PAYS_BELOW - PAYS_FULLY_BELOW)
    return np.asarray(np.clip(blurred, 0.0, 1.0) * unsureness(scale))


def unsureness(scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """How unsure the spectral network is, u of the module: (N,) in [0, 1] for its Laplace scale (N, 2, 8)."""
    above = (scale.mean(axis=(1, 2)) - UNSURE_ABOVE_SCALE) / (UNSURE_FULLY_ABOVE_SCALE - UNSURE_ABOVE_SCALE)
    return np.asarray(np.clip(above, 0.0, 1.0))


class Fused(Estimator):
    """See the module.

    Args:
        weights: file of the gate; None for the released one.
        spectral_weights: file of the spectral network; None for the released one.
        pixel_weights: file of the pixel network; None for the released one.
        deconvolved_patches: how many of the patches that share a blur are deconvolved, evenly spread over them.
        shared_blur: whether the patches of one call are blurred alike: ``"always"`` (a frame, a cell of a table),
            ``"never"`` (every blurred patch is deconvolved), or ``"auto"``, which takes those for alike whose spectral
            answers agree within their spread.
        joint: solve one kernel for the patches that share a blur; else each is solved alone and the median of what that
            adds to the spectral answers is added to those of all.
        kernel_size: side of the kernels, odd, pixels.
        batch, device: of the networks.

    Attributes:
        camera: calibration, or None: answers are then total MTFs.

    Raises:
        InputError: weight files that are absent or broken, or an option out of its range.
    """

    camera: FusionMap | None = None

    def __init__(
        self,
        weights: str | Path | None = None,
        *,
        spectral_weights: str | Path | None = None,
        pixel_weights: str | Path | None = None,
        deconvolved_patches: int = 4,
        shared_blur: str = "auto",
        joint: bool = True,
        kernel_size: int = 31,
        batch: int = 32,
        device: str = "cpu",
    ) -> None:
        from pipeline.blur.fusion.gate import ARCHITECTURE, FusionGate
        from pipeline.learning.weights import into, untrained

        if not isinstance(deconvolved_patches, int) or deconvolved_patches < 1:
            raise InputError(f"deconvolved_patches={deconvolved_patches!r}: expected a whole number of at least 1")
        if shared_blur not in SHARED:
            raise InputError(f"shared_blur={shared_blur!r}: {did_you_mean(str(shared_blur), SHARED)}")
        self.deconvolved_patches, self.shared_blur, self.joint = deconvolved_patches, shared_blur, joint
        self.spectral = Spectral(spectral_weights, batch=batch, device=device)
        self.networks = SpectralAndPixels(self.spectral, pixel_weights)
        self.deconvolution = Deconvolution(kernel_size)
        gate = untrained(FusionGate)
        header = into(gate, Path(weights or active(RELEASED)), ARCHITECTURE)
        self.released = bool(header["released"]) and self.networks.released
        self.gate, self.interval = gate.eval(), float(header["interval"])

    def measure(self, patches: NDArray[np.float32], reason: NDArray[np.str_]) -> BlurEstimate:
        """See `pipeline.blur.base.Estimator.measure`; relative MTFs where there is a calibration."""
        spectral = self._of_networks(patches, reason)
        mtf, scale, pays = spectral.mtf, spectral.scale, spectral.pays
        answer, width = mtf.copy(), self.spectral.interval * scale
        blurred = np.flatnonzero((reason == "") & (pays > 0))
        for members in self._groups(mtf[blurred], scale[blurred]):
            group = blurred[members]
            picked = shared_blur.spread(group, self.deconvolved_patches)
            if self.joint or len(picked) == 1:
                answer[group], width[group] = self._fused(patches[picked], spectral.part(group))
            else:
                each = [self._fused(patches[index, None], spectral.part(np.array([index]))) for index in picked]
                shift = np.median([fused - mtf[index] for (fused, _), index in zip(each, picked, strict=True)], axis=0)
                answer[group] = np.clip(mtf[group] + shift, 0.0, 1.0)
                width[group] = np.median([wide for _, wide in each], axis=0)
        abstained = reason != ""
        answer[abstained] = width[abstained] = np.nan
        low, high = (np.clip(answer + sign * width, 0.0, 1.0) for sign in (-1, 1))
        return BlurEstimate(answer, abstained, reason, low=low, high=high)

    def _of_networks(self, patches: NDArray[np.float32], reason: NDArray[np.str_]) -> SpectralAnswer:
        """What the networks estimate of patches, with the pixel network where the camera's calibration has it."""
        networks = self.spectral.predict_members(patches)
        mtf, scale = np.asarray(networks.mtf, np.float64), np.asarray(networks.scale, np.float64)
        unwidened = scale
        if self.camera is not None:
            mtf, scale = self.camera.spectral(networks.members, networks.hidden), scale * self.camera.spectral.widening
            unsure = np.where(reason == "", unsureness(unwidened), 0.0)
            unsure_patches = unsure > 0
            if (joint := self.camera.networks) is not None and unsure_patches.any():
                seen = networks.members[unsure_patches], networks.hidden.part(unsure_patches)
                joint_mtf = joint(*self.networks.beside(*seen, patches[unsure_patches]))
                weight = PIXELS_WEIGHT * unsure[unsure_patches, None, None]
                mtf[unsure_patches] += weight * (joint_mtf - mtf[unsure_patches])
                scale[unsure_patches] += weight * (unwidened[unsure_patches] * joint.widening - scale[unsure_patches])
        sigma_dn = np.asarray(networks.hidden.sigma_dn, np.float64)
        return SpectralAnswer(mtf, scale, sigma_dn, deconvolution_pays(mtf, unwidened))

    def _groups(self, mtf: NDArray[np.float64], scale: NDArray[np.float64]) -> list[NDArray[np.int_]]:
        """Indices of the blurred patches, by blur."""
        if self.shared_blur == "auto":
            return shared_blur.groups(mtf, scale)
        if self.shared_blur == "always":
            return [np.arange(len(mtf))] if len(mtf) else []
        return [np.array([index]) for index in range(len(mtf))]

    def _fused(
        self, patches: NDArray[np.float32], spectral: SpectralAnswer
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """MTF and half the width of its interval, both (N, 2, 8), with one kernel for all.

        Args:
            patches: (M, 1, 192, 192) to deconvolve together.
            spectral: of N patches under the same blur.
        """
        import torch

        others = self.deconvolution(patches)
        if self.camera is not None:
            others[0] = self.camera.relative(others[0])
        arguments = (join_members(spectral.mtf, others), spectral.scale, spectral.sigma_dn)
        with inference():
            joined = self.gate(*(torch.from_numpy(np.asarray(part, np.float32)) for part in arguments))
        mtf, scale = (part.numpy().astype(np.float64) for part in joined)
        weight = spectral.pays[:, None, None]
        width = weight * self.interval * scale + (1 - weight) * self.spectral.interval * spectral.scale
        return weight * mtf + (1 - weight) * spectral.mtf, width

    def fit_camera(self, sharp_patches: Any, *, samples: int = SAMPLES, seed: int = 1) -> FusionMap:
        """Calibrate all members to a camera: see `pipeline.blur.fusion.camera`.

        Args:
            sharp_patches: (N, 1, 192, 192) float in [0, 1] of the camera's sharp frames; some tens, from
                different scenes, are enough. Of a single scene, the pixel network takes no part.
            samples: see `pipeline.blur.camera_calibration.fit_map`.
            seed: see there.

        Raises:
            InputError: see there.
        """
        sharp = as_patches(sharp_patches, "sharp_patches")
        spectral, networks = fit_map(self.spectral, sharp, samples=samples, seed=seed), None
        if overlap.scenes(sharp[:, 0]).any():  # with a single one there is none to judge the pixel network by
            networks = fit_map(self.networks, sharp, samples=samples, seed=seed)
        picked = shared_blur.spread(np.arange(len(sharp)), SHARP_PATCHES)
        result = self.deconvolution.gbb.estimate(sharp[picked])
        kept = np.asarray(result.mtf, np.float64)[~result.abstained]
        sharp_mtf = np.median(kept, axis=0) if len(kept) else np.ones(result.mtf.shape[1:])
        return FusionMap(spectral, sharp_mtf, networks, EstimatorIdentity.of(self))

    def weights_sha256(self) -> dict[str, str]:
        """See `pipeline.blur.estimator_identity.HasNetworks`."""
        from pipeline.learning.weights import tensors_sha256

        beside = {"gate": self.gate, "pixels": self.networks.pixels}
        hashes = {name: tensors_sha256(network.state_dict()) for name, network in beside.items()}
        return {**self.spectral.weights_sha256(), **hashes}

    def with_camera(self, camera: FusionMap | None) -> Self:
        """The same estimator with this calibration and no other; None for total MTFs."""
        made = copy.copy(self)
        made.camera, made.sharp_mtf = camera, None
        made.relative_to = SYSTEM if camera is None else CAMERA
        return made

    def calibrated(self, sharp_patches: Any) -> Self:
        """The same estimator, calibrated to the camera of these sharp patches: answers are relative MTFs.

        Takes two minutes: the networks are run on 2400 blurred patches, without and with noise, GBB on ten sharp ones.

        Args:
            sharp_patches: see `fit_camera`.

        Raises:
            InputError: see `fit_camera`.
        """
        return self.with_camera(self.fit_camera(sharp_patches))

    def divided(self, sharp_patches: Any) -> Self:
        """See `pipeline.blur.base.Estimator.divided`."""
        return super(Fused, self.with_camera(None)).divided(sharp_patches)
