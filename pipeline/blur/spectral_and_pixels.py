"""The spectral estimator's two networks and the pixel network, as one estimator to calibrate to a camera.

Networks that see the same features err alike, however long they are trained; the pixel network (`networks.pixel_net`)
sees edges in place of spectra, and its errors correlate by .3 to .4 with those of the spectral ones. Alone it is worse
on recorded frames, but where motion is short. So an uncalibrated estimate does not depend on it: a camera's calibration
(`camera_calibration`), which measures on scenes held out how each network does on that camera, joins all three.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pipeline.blur.base import FREQUENCIES, BlurEstimate, Estimator, HiddenUnits
from pipeline.blur.calibration.output_layers import OutputLayers
from pipeline.blur.spectral import FIRST, SECOND, Spectral
from pipeline.learning.inference import inference
from pipeline.project_files import located
from pipeline.weight_files import active

if TYPE_CHECKING:
    import torch
    from numpy.typing import NDArray

RELEASED = located("data/weights/mtf_pixels.safetensors")
AT_ONCE = 4  # patches: what convolutions give of more does not stay in the processor's cache
MIDDLE = 1
"""Where the pixel network stands among the networks: a calibration takes the first for what is answered without it, the
last for the one that knows halos."""


class SpectralAndPixels(Estimator):
    """Estimates as `Spectral` does, with the pixel network's MTF among those of the networks; see the module.

    Args:
        spectral: not calibrated, of total MTFs, with both its networks.
        pixel_weights: file of the pixel network; None for the released one.

    Raises:
        InputError: a weight file that is absent, broken or of another network.
    """

    def __init__(self, spectral: Spectral, pixel_weights: str | Path | None = None) -> None:
        import torch

        from pipeline.blur.networks.pixel_net import ARCHITECTURE, PixelNet
        from pipeline.learning.weights import into, untrained

        self.spectral, network = spectral, untrained(PixelNet)
        header = into(network, Path(pixel_weights or active(RELEASED)), ARCHITECTURE)
        self.released = spectral.released and bool(header["released"])
        self.pixels = network.eval().to(spectral.device, memory_format=torch.channels_last)  # type: ignore[call-overload]

    def measure(self, patches: NDArray[np.float32], reason: NDArray[np.str_]) -> BlurEstimate:
        """The uncalibrated answer; see `pipeline.blur.base.Estimator.measure`."""
        estimate = self.spectral.measure(patches, reason)
        assert estimate.members is not None and estimate.hidden is not None
        members, hidden = self.beside(estimate.members, estimate.hidden, patches)
        members[estimate.abstained] = np.nan
        return replace(estimate, members=members, hidden=hidden)

    def beside(
        self, members: NDArray[np.floating], hidden: HiddenUnits, patches: NDArray[np.float32]
    ) -> tuple[NDArray[np.floating], HiddenUnits]:
        """What all three networks estimate of patches that the spectral ones have seen.

        Args:
            members: (N, 2, 2, 8) MTFs by the spectral networks.
            hidden: their units.
            patches: (N, 1, 192, 192) float32 in [0, 1].

        Returns:
            MTFs (N, 3, 2, 8) and units of the three, the pixel network's between those of the spectral ones.
        """
        import torch

        mtf = np.empty((len(patches), *members.shape[2:]), np.float32)
        units = np.empty((len(patches), hidden.units.shape[2]), np.float32)
        with inference():
            for first in range(0, len(patches), AT_ONCE):
                part = slice(first, first + AT_ONCE)
                levels = torch.from_numpy(np.rint(patches[part, 0] * 255)).to(self.spectral.device)
                seen = self.pixels.hidden(levels)
                mtf[part], units[part] = self.pixels.outputs(seen)[0].cpu().numpy(), seen.cpu().numpy()
        every_unit = np.insert(hidden.units, MIDDLE, units, axis=1)
        return np.insert(members, MIDDLE, mtf, axis=1), replace(hidden, units=every_unit)

    def output_layers(self) -> OutputLayers:
        """The last two layers of all three; see `pipeline.blur.calibration.output_layers`."""
        spectral, head, values = self.spectral.output_layers(), self.pixels.head, 2 * FREQUENCIES

        def beside(others: NDArray[np.float64], values: torch.Tensor) -> NDArray[np.float64]:
            return np.insert(others, MIDDLE, values.detach().cpu().double().numpy(), axis=0)

        return OutputLayers(
            beside(spectral.first, head[FIRST].weight), beside(spectral.first_offset, head[FIRST].bias),
            beside(spectral.second, head[SECOND].weight[:values]),
            beside(spectral.second_offset, head[SECOND].bias[:values]),
        )  # fmt: skip
