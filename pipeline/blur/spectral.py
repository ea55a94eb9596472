"""Spectral estimator: the MTF of a patch, with an interval, from a small network on log power spectra.

Both directions come from one pass (`networks.spectral_features`, `networks.spectral_net`); trained on procedural
pictures only (`training.spectral`). Estimates are *total* MTFs: lens, sensor and motion together. The MTF relative to a
camera's sharp frames is what `calibrated` gives, by a map of both networks' estimates and their output layers trained
further (`pipeline.blur.camera_calibration`); where there are none, ``output="relative"`` takes off a generic lens
(`pipeline.blur.generic_lens`).

Noise that a camera has processed (demosaiced, denoised, sharpened, coded) looks like texture, and the main network,
which knows white noise only, takes it for sharpness. A second network of the same form was trained through random
cameras; it reads such noise, and where it reads more than the main one it takes over:

    w = clip((sigma_processed - sigma - 0.8 DN) / 1.2 DN, 0, 1),    MTF = (1 - w) MTF_main + w MTF_processed

There the interval spans those of both, as the two differ by more than either allows for. Everywhere the scale of the
interval is the main network's plus the distance of the two,

    b = b_main + |MTF_main - MTF_processed|,

because a network's scale holds for pictures and kernels like those it was trained on, and their distance shows where a
patch is unlike them: on procedural pictures with irises, halos and rendered lenses 95 % intervals held 90 % of the
values without it and hold 96 % with it, on photographs of cameras it was not developed on 74 to 88 % and 90 to 97 %
(of the MTF relative to the sharp frame).

It expects scenes the right way up: it knows that street scenes hold less detail across than along, so frames of a
rolled camera must be turned upright first.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from pipeline.blur.base import FREQUENCIES, BlurEstimate, Estimator, HiddenUnits
from pipeline.blur.calibration.output_layers import OutputLayers
from pipeline.blur.camera_calibration import Calibration, corrected, fit_map
from pipeline.camera.mtf import CAMERA, GENERIC_LENS, SYSTEM
from pipeline.errors import InputError
from pipeline.learning.inference import inference
from pipeline.project_files import located
from pipeline.weight_files import active

if TYPE_CHECKING:
    import torch

    from pipeline.blur.networks.spectral_net import SpectralNet

RELEASED = located("data/weights/mtf_spectral.safetensors")
TYPICAL = "_typical.json"
"""Behind the stem of a weight file: its calibration to a generic camera, for the relative MTF."""
RELEASED_PROCESSED = located("data/weights/mtf_spectral_processed.safetensors")
RELEASED_BESIDE = {"processed_weights": RELEASED_PROCESSED}
"""Option -> the weights beside `RELEASED` that an answer needs; for records of what was measured with what."""
EXCESS_DN = (0.8, 2.0)
"""Noise that the network for processed pictures reads beyond the main one, over which it takes over."""

WIDENED_FROM = 0.25  # weight of that network from which the interval spans both
RELEASED_TYPICAL = located("data/weights/mtf_spectral_typical.json")

OUTPUTS = ("system", "relative")
AT_ONCE = 8
INTERVAL = 3.0  # of a Laplace distribution, ln 20 scales hold 95 %; weight files carry their measured factor


Answer = tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]
"""MTF (N, 2, 8), its Laplace scale (N, 2, 8), and noise sigma (N,), DN."""

FIRST, SECOND = 2, 4
"""Layers of a network's head above the hidden units that a calibration to a camera starts from."""


@dataclass(frozen=True)
class Prediction:
    """What the networks return of N patches.

    Attributes:
        mtf: (N, 2, 8) total MTF in [0, 1].
        scale: (N, 2, 8) its Laplace scale.
        members: (N, E, 2, 8): `mtf`, then that of the network for processed pictures, where it takes part.
        hidden: units of the first hidden layer of each network, and the noise that they see.
    """

    mtf: NDArray[np.float32]
    scale: NDArray[np.float32]
    members: NDArray[np.float32]
    hidden: HiddenUnits


class Spectral(Estimator):
    """See the module.

    `camera` is its calibration to a camera, or None.

    Args:
        weights: file of `pipeline.learning.weights`; None for the released one.
        processed_weights: of the network for processed pictures; None for the released one.
        processed: whether that network takes part.
        output: ``"system"``, the MTF of lens, sensor and motion together, or ``"relative"``, that of the blur added to
            a generic lens's sharp frames; the latter's map lies beside the weights (``STEM_typical.json``).
        mirrored: average the answers for the patch and its mirror image (whose spectrum is known already): the network
            runs twice, for hundredths of a percent in the AMAE.
        batch: patches computed together.
        device: where, e.g. ``"cpu"`` or ``"cuda"``.

    Raises:
        InputError: a weight file that is absent, broken or of another network, its map likewise, a batch under 1, or
            another answer.
    """

    camera: Calibration | None = None

    def __init__(
        self,
        weights: str | Path | None = None,
        *,
        processed_weights: str | Path | None = None,
        processed: bool = True,
        output: str = "system",
        mirrored: bool = False,
        batch: int = 32,
        device: str = "cpu",
    ) -> None:
        import torch

        from pipeline.blur.networks.grouped_convolutions import GroupedBodies
        from pipeline.blur.networks.spectral_net import ARCHITECTURE, SpectralNet
        from pipeline.learning.weights import into, untrained

        if batch < 1:
            raise InputError(f"blur estimator 'spectral': batch={batch}, expected at least 1")
        if output not in OUTPUTS:
            raise InputError(f"blur estimator 'spectral': output={output!r}, expected one of {', '.join(OUTPUTS)}")
        self.mirrored, self.batch, self.device = mirrored, batch, device
        network, path = untrained(SpectralNet), Path(weights or active(RELEASED))
        header = into(network, path, ARCHITECTURE)
        self.released = bool(header["released"])
        if output == "relative":
            self.relative_to = GENERIC_LENS
        self.typical = Calibration.load(path.with_name(path.stem + TYPICAL)) if output == "relative" else None
        self.interval = float(header.get("interval", INTERVAL))
        self.network = network.eval().to(device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.processed: SpectralNet | None = None
        if processed:
            second = untrained(SpectralNet)
            header = into(second, Path(processed_weights or active(RELEASED_PROCESSED)), ARCHITECTURE)
            self.released &= bool(header["released"])
            self.processed_interval = float(header.get("interval", INTERVAL))
            self.processed = second.eval().to(device, memory_format=torch.channels_last)  # type: ignore[call-overload]
            self.grouped = untrained(lambda: GroupedBodies([self.network, second]))

    def measure(self, patches: NDArray[np.float32], reason: NDArray[np.str_]) -> BlurEstimate:
        """The uncalibrated answer; see `pipeline.blur.base.Estimator.measure`."""
        networks = self.predict_members(patches)
        mtf, scale, abstained = networks.mtf, networks.scale, reason != ""
        mtf[abstained] = scale[abstained] = networks.members[abstained] = np.nan
        half = self.interval * scale
        low, high = (np.clip(mtf + sign * half, 0.0, 1.0) for sign in (-1, 1))
        result = BlurEstimate(
            mtf, abstained, reason, low=low, high=high, half=half, members=networks.members, hidden=networks.hidden
        )
        camera = self.camera or self.typical
        return result if camera is None else corrected(result, camera)

    def calibrated(self, sharp_patches: Any) -> Self:
        """The same estimator, calibrated to the camera of these sharp patches by a map of both networks' estimates.

        Takes half a minute (`pipeline.blur.camera_calibration.fit_map`). On recorded frames that it was not
        fitted to its errors are smaller than those by division (`divided`) on KITTI and the authors' *Sim*; on four
        frames of Udacity, of which it was fitted to two at a time, they are alike.

        Args:
            sharp_patches: (N, 1, 192, 192) float in [0, 1] from frames known to be sharp; some tens, of different
                scenes, are enough.

        Raises:
            InputError: not as expected, or hardly any of them can be measured.
        """
        made = self._uncalibrated()
        made.camera, made.relative_to = fit_map(made, sharp_patches), CAMERA
        return made

    def divided(self, sharp_patches: Any) -> Self:
        """See `pipeline.blur.base.Estimator.divided`."""
        return super(Spectral, self._uncalibrated()).divided(sharp_patches)

    def _uncalibrated(self) -> Self:
        """The same estimator, of total MTFs."""
        made = copy.copy(self)
        made.camera = made.typical = made.sharp_mtf = None
        made.relative_to = SYSTEM
        return made

    def sigma_dn(self, patches: NDArray[np.float32]) -> NDArray[np.float32]:
        """The noise the network takes to have been added after the blur, DN: (N,) for (N, 1, 192, 192).

        A by-product, by which a caller may decide whether to remove noise first; `pipeline.noise` measures better.
        """
        return self.predict(patches)[2]

    def predict(
        self, patches: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        """What the network returns, of every patch and without abstentions.

        Args:
            patches: (N, 1, 192, 192) float32 in [0, 1].

        Returns:
            total MTF (N, 2, 8) in [0, 1], its Laplace scale (N, 2, 8), and noise sigma (N,), DN.
        """
        networks = self.predict_members(patches)
        return networks.mtf, networks.scale, np.asarray(networks.hidden.sigma_dn, np.float32)

    def predict_members(self, patches: NDArray[np.float32]) -> Prediction:
        """What the networks return, together and apart; see `predict`."""
        import torch

        from pipeline.blur.networks.spectral_features import features, mirrored

        count = len(patches)
        members = np.empty((count, 1 if self.processed is None else 2, 2, 8), np.float32)
        mtf, scale = np.empty((count, 2, 8), np.float32), np.empty((count, 2, 8), np.float32)
        sigma_dn, share = np.empty(count, np.float32), np.zeros(count, np.float32)
        units = np.empty((count, members.shape[1], self.network.head[0].out_features), np.float32)
        with inference():
            for first in range(0, count, self.batch):
                part = slice(first, first + self.batch)
                # To whole numbers: the network knows 8-bit images, whose rounding has a power of its own.
                image = torch.from_numpy(np.rint(patches[part, 0] * 255)).to(self.device)
                # A few at a time: their spectra then stay in the processor's cache.
                maps, vector = (torch.cat(parts) for parts in zip(*map(features, image.split(AT_ONCE)), strict=True))
                orientations = 2 if self.mirrored else 1
                if self.mirrored:
                    maps, vector = torch.cat([maps, mirrored(maps)]), torch.cat([vector, vector])
                hidden = self._hidden(maps, vector)
                main, units[part, 0] = _answer(self.network, hidden[0], orientations)
                if self.processed is not None:
                    other, units[part, 1] = _answer(self.processed, hidden[1], orientations)
                    share[part] = _second_share(main, other)
                    main, members[part, 1] = self._joined(main, other, share[part]), other[0]
                mtf[part], scale[part], sigma_dn[part] = main
        members[:, 0] = mtf
        return Prediction(mtf, scale, members, HiddenUnits(units, share, sigma_dn))

    def _networks(self) -> list[SpectralNet]:
        """The main one and, where it takes part, the one for processed pictures."""
        return [self.network, *([] if self.processed is None else [self.processed])]

    def _hidden(self, maps: torch.Tensor, vector: torch.Tensor) -> list[torch.Tensor]:
        """(N, 256) hidden units of each network."""
        networks = self._networks()
        if len(maps) > 1 or len(networks) == 1:
            return [network.hidden(maps, vector) for network in networks]
        return [network.units(seen, vector) for network, seen in zip(networks, self.grouped(maps), strict=True)]

    def weights_sha256(self) -> dict[str, str]:
        """See `pipeline.blur.estimator_identity.HasNetworks`."""
        from pipeline.learning.weights import tensors_sha256

        hashes = [tensors_sha256(network.state_dict()) for network in self._networks()]
        return dict(zip(("main", "processed"), hashes, strict=False))

    def output_layers(self) -> OutputLayers:
        """The last two layers of each network: see `pipeline.blur.calibration.output_layers`."""
        networks = self._networks()

        def stacked(layer: int, name: str) -> NDArray[np.float64]:
            each = [getattr(network.head[layer], name).detach().cpu().double().numpy() for network in networks]
            return np.stack(each)

        values = 2 * FREQUENCIES
        return OutputLayers(
            stacked(FIRST, "weight"), stacked(FIRST, "bias"),
            stacked(SECOND, "weight")[:, :values], stacked(SECOND, "bias")[:, :values],
        )  # fmt: skip

    def _joined(self, main: Answer, processed: Answer, share: NDArray[np.float32]) -> Answer:
        """The answers of both networks as one; scales are those of the main network's interval."""
        excess, weight = processed[2] - main[2], share[:, None, None]
        mtf = (1 - weight) * main[0] + weight * processed[0]
        apart = main[1] + np.abs(main[0] - processed[0])
        reach = np.maximum(
            np.abs(main[0] - mtf) + self.interval * main[1],
            np.abs(processed[0] - mtf) + self.processed_interval * processed[1],
        )
        wide = np.minimum(weight / WIDENED_FROM, 1)
        scale = np.maximum(apart, (1 - wide) * main[1] + wide * reach / self.interval)
        return mtf, scale, main[2] + weight[:, 0, 0] * excess


def _second_share(main: Answer, processed: Answer) -> NDArray[np.float32]:
    """(N,) w of the module."""
    excess = processed[2] - main[2]
    return np.clip((excess - EXCESS_DN[0]) / (EXCESS_DN[1] - EXCESS_DN[0]), 0, 1).astype(np.float32)


def _answer(network: SpectralNet, units: torch.Tensor, orientations: int) -> tuple[Answer, NDArray[np.float32]]:
    """What a network answers and its hidden units (N, 256), averaged over the ways a patch is seen."""
    values = (*network.outputs(units)[:3], units)
    if orientations > 1:
        values = tuple(value.unflatten(0, (orientations, -1)).mean(0) for value in values)
    mtf, scale, sigma_dn, hidden = (value.cpu().numpy() for value in values)
    return (mtf, scale, sigma_dn), hidden
