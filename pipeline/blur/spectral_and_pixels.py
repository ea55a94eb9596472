"""The spectral estimator's two networks and the pixel network, as one estimator to calibrate to a camera.

Networks that see the same features err alike, however long they are trained; the pixel network (`pixel_net`) sees edges
in place of spectra, and its errors correlate by .3 to .4 with those of the spectral ones. Alone it is worse on recorded
frames, but where motion is short. So it has no say in what an uncalibrated estimator answers: a camera's calibration
(`camera_calibration`), which knows by scenes held out how each network does on that camera, joins all three.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.blur.base import FREQUENCIES, HiddenUnits
from pipeline.blur.camera_correction import OutputLayers
from pipeline.blur.spectral import FIRST, SECOND, Prediction, Spectral
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


class SpectralAndPixels(Spectral):
    """Answers as `Spectral` does until it is calibrated; see the module.

    Args:
        pixel_weights: file of the pixel network; None for the released one.
        spectral: options of `pipeline.blur.spectral.Spectral`; both its networks take part.

    Raises:
        InputError: a weight file that is absent, broken or of another network; see `Spectral`.
    """

    def __init__(self, pixel_weights: str | Path | None = None, **spectral: Any) -> None:
        import torch

        from pipeline.blur.pixel_net import ARCHITECTURE, PixelNet
        from pipeline.learning.weights import into

        super().__init__(**spectral)
        network = PixelNet()
        header = into(network, Path(pixel_weights or active(RELEASED)), ARCHITECTURE)
        self.released &= bool(header["released"])
        self.pixels = network.eval().to(self.device, memory_format=torch.channels_last)  # type: ignore[call-overload]

    def predict_members(self, patches: NDArray[np.float32]) -> Prediction:
        """What the networks return, together and apart; the pixel network's is between those of the spectral ones."""
        import torch

        spectral = super().predict_members(patches)
        mtf = np.empty((len(patches), *spectral.members.shape[2:]), np.float32)
        units = np.empty((len(patches), spectral.hidden.units.shape[2]), np.float32)
        with torch.inference_mode():
            for first in range(0, len(patches), AT_ONCE):
                part = slice(first, first + AT_ONCE)
                levels = torch.from_numpy(np.rint(patches[part, 0] * 255)).to(self.device)
                hidden = self.pixels.hidden(levels)
                mtf[part], units[part] = self.pixels.outputs(hidden)[0].cpu().numpy(), hidden.cpu().numpy()
        members = np.insert(spectral.members, MIDDLE, mtf, axis=1)
        hidden_units = np.insert(spectral.hidden.units, MIDDLE, units, axis=1)
        hidden = HiddenUnits(hidden_units, spectral.hidden.second_share, spectral.hidden.sigma_dn)
        return Prediction(spectral.mtf, spectral.scale, members, hidden)

    def output_layers(self) -> OutputLayers:
        """The last two layers of all three; see `pipeline.blur.camera_correction`."""
        spectral, head, values = super().output_layers(), self.pixels.head, 2 * FREQUENCIES

        def beside(others: NDArray[np.float64], values: torch.Tensor) -> NDArray[np.float64]:
            return np.insert(others, MIDDLE, values.detach().cpu().double().numpy(), axis=0)

        return OutputLayers(
            beside(spectral.first, head[FIRST].weight), beside(spectral.first_offset, head[FIRST].bias),
            beside(spectral.second, head[SECOND].weight[:values]),
            beside(spectral.second_offset, head[SECOND].bias[:values]),
        )  # fmt: skip
