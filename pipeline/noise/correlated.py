"""Estimator for noise that is correlated between pixels, as it is behind demosaicing, denoising, sharpening and codecs.

Statistics of flat windows (`networks.correlated_features`) go through small networks (`networks.correlated_net`) that
were trained on procedural scenes through random cameras (`training.correlated`). It estimates

    sigma_dn          total noise of the delivered picture: deviation between shots of the same scene
    white_sigma_dn    its white part; the rest is smooth
    correlation       of adjacent pixels: 0 white, 0.3 to 0.8 in processed pictures

with a 95 % interval of sigma. White noise is estimated more precisely by `cellwise`; `adaptive` weighs one against the
other.

Maps follow the estimated noise curve over grey level, so they show how noise differs with brightness, not between
places of equal brightness.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.errors import InputError
from pipeline.learning.inference import inference
from pipeline.noise.base import Measured
from pipeline.noise.cell_mapper import CELL_PX, CellMapper
from pipeline.noise.networks.correlated_features import LEAST_PX, Moments, moments, statistics_of
from pipeline.project_files import located
from pipeline.weight_files import active

RELEASED = located("data/weights/sigma_correlated.safetensors")


@dataclass(frozen=True)
class Prediction:
    """What the network answers for N patches.

    Attributes:
        sigma_dn: (N,) total noise, DN.
        reach: (N,) half-width of the 95 % interval of ln(1 + sigma).
        white_sigma_dn: (N,) its white part, DN.
        correlation: (N,) of adjacent pixels.
        cells_dn: (N, h, w) sigma per cell, DN.
        statistics: (N, COUNT) see `correlated_features.statistics`.
    """

    sigma_dn: NDArray[np.float64]
    reach: NDArray[np.float64]
    white_sigma_dn: NDArray[np.float64]
    correlation: NDArray[np.float64]
    cells_dn: NDArray[np.float32]
    statistics: NDArray[np.float32]

    @property
    def low_dn(self) -> NDArray[np.float64]:
        """(N,) lower end of the interval, DN."""
        return np.maximum(np.expm1(np.log1p(self.sigma_dn) - self.reach), 0.0)

    @property
    def high_dn(self) -> NDArray[np.float64]:
        """(N,) upper end of the interval, DN."""
        return np.asarray(np.expm1(np.log1p(self.sigma_dn) + self.reach))


class Correlated(CellMapper):
    """See the module.

    Args:
        weights: file of `pipeline.learning.weights`; None for the released one.
        saturated_fraction: of saturated pixels, (0, 1], from which a patch is refused.

    Raises:
        InputError: weights that are absent, broken or of another network; an option out of range.
    """

    min_size_px = LEAST_PX

    def __init__(self, weights: str | Path | None = None, *, saturated_fraction: float = 0.8) -> None:
        from pipeline.learning.weights import into, load, untrained
        from pipeline.noise.networks.correlated_net import ARCHITECTURE, CorrelatedNet

        super().__init__(saturated_fraction)
        path = weights or active(RELEASED)
        header = load(Path(path), ARCHITECTURE)[1]
        if not isinstance(header.get("interval"), float) or not isinstance(header.get("members"), int):
            raise InputError(
                f"{path}: has no interval or members in its header; train it anew (dvc repro train_sigma_correlated)"
            )
        network = untrained(partial(CorrelatedNet, header["members"]))
        self.released = bool(into(network, path, ARCHITECTURE)["released"])
        self.interval: float = header["interval"]
        self.network = network.eval()

    def measure_cells(
        self, stack: NDArray[np.floating], reason: NDArray[np.object_]
    ) -> tuple[Measured, NDArray[np.float32]]:
        """See `pipeline.noise.cell_mapper.CellMapper.measure_cells`."""
        answer = self.predict(stack)
        measured = Measured(
            answer.sigma_dn, answer.low_dn, answer.high_dn, answer.white_sigma_dn, answer.correlation
        )  # fmt: skip
        return measured, answer.cells_dn

    def predict(self, stack: NDArray[np.floating], known: Sequence[Moments | None] | None = None) -> Prediction:
        """The network's answers before abstentions.

        Args:
            stack: (N, H, W) in [0, 1].
            known: (N,) moments of the patches where they are known already.
        """
        import torch

        from pipeline.noise.networks.correlated_net import cell_map

        pixels = np.rint(stack * np.float32(FULL_SCALE_DN)).astype(np.float32)
        height, width = (side // CELL_PX for side in stack.shape[1:])
        cells = pixels[:, : height * CELL_PX, : width * CELL_PX]
        brightness = cells.reshape(-1, height, CELL_PX, width, CELL_PX).mean(axis=(2, 4))
        known = known or [None] * len(pixels)
        seen = statistics_of([part or moments(patch) for patch, part in zip(pixels, known, strict=True)])
        if not len(pixels):
            nothing = np.empty(0)
            return Prediction(nothing, nothing, nothing, nothing, np.empty((0, height, width), np.float32), seen)
        with inference():
            sigma, scale, white, correlation, curve = self.network(torch.from_numpy(seen))
            maps = cell_map(sigma, curve, torch.from_numpy(brightness))
        values = [value.double().numpy() for value in (sigma, self.interval * scale, sigma * white, correlation)]
        return Prediction(values[0], values[1], values[2], values[3], maps.numpy(), seen)
