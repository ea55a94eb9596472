"""The default noise estimator: right on white sensor noise and on pictures as cameras deliver them.

Two networks answer, and the correlation of the noise decides between them:

    cellwise      white noise: rendered frames, raw and machine-vision cameras, noise added in software
    correlated    noise behind demosaicing, denoising, sharpening or a codec

    ln(1 + sigma) = (1 - w) ln(1 + sigma_white) + w ln(1 + sigma_correlated),   w = ramp of the correlation, 0.24 to 0.38

Where the second network is unsure, which happens on fine texture, principal components of every second pixel (`pca`,
``stride=2``) join it: v = b^2 / (b^2 + b0^2) of the answer, b the network's scale. Where the interval stays too wide to
be of use the patch is abstained from: as ``"compressed"`` where the picture shows the traces of a strong codec, which
removes weak noise and leaves its own, else as ``"uncertain"``.

`NoiseEstimate.sigma_dn` is the total noise of the delivered picture, `white_sigma_dn` its white part. A patch that is
plainly white skips the second network, so that such frames cost no more than `cellwise`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.noise.base import Measured
from pipeline.noise.cell_mapper import CellMapper
from pipeline.noise.cellwise import SATURATED_FRACTION, Cellwise
from pipeline.noise.correlated import Correlated, Prediction
from pipeline.noise.correlated_features import GRID_START, LEAST_PX, whiteness
from pipeline.noise.pca import PrincipalComponents

COMPRESSED, UNCERTAIN = "compressed", "uncertain"

WHITE_BELOW, CORRELATED_ABOVE = 0.24, 0.38
"""Correlation of adjacent pixels between which the answer moves from one network to the other."""

PLAINLY_WHITE = 0.1  # lag-1 correlation of flat windows below which ...
PLAIN_SIGMA_DN = 1.0  # ... noise that certainly exceeds this is white
PCA_FACTOR = 1.15  # principal components of every second pixel read correlated noise low by this factor
PCA_SCALE = 0.35  # b0, of the half-width of the interval
PCA_MIN_PX = 64
WIDEST_REACH = 0.9
"""Half-width of the interval of ln(1 + sigma) beyond which there is no answer: a factor of 2.5 either way."""

VANISHED_COEFFICIENTS = 0.9  # of high-frequency DCT coefficients: a codec has removed them
GRID_STEP = 0.25  # ln of the step at block edges over that elsewhere


class Adaptive(CellMapper):
    """See the module.

    Args:
        cellwise_weights, correlated_weights: weight files of the two networks; None for the released ones.
        widest_reach: half-width of the interval of ln(1 + sigma) from which a patch is abstained from.
        saturated_fraction: of saturated pixels, (0, 1], from which a patch is refused.

    Raises:
        InputError: weights that are absent, broken or of another network; an option out of range.
    """

    min_size_px = LEAST_PX

    def __init__(
        self,
        cellwise_weights: str | Path | None = None,
        correlated_weights: str | Path | None = None,
        *,
        widest_reach: float = WIDEST_REACH,
        saturated_fraction: float = SATURATED_FRACTION,
    ) -> None:
        super().__init__(saturated_fraction)
        self.white = Cellwise(cellwise_weights)
        self.correlated = Correlated(correlated_weights)
        self.principal = PrincipalComponents(stride=2)
        self.widest_reach = widest_reach

    def measure_cells(
        self, stack: NDArray[np.floating], reason: NDArray[np.object_]
    ) -> tuple[Measured, NDArray[np.float32]]:
        """See `pipeline.noise.cell_mapper.CellMapper.measure_cells`; writes its own reasons to abstain."""
        white, cells = self.white.measure_cells(stack, reason)
        assert white.low_dn is not None and white.high_dn is not None
        sigma, low, high = white.sigma_dn.copy(), white.low_dn.copy(), white.high_dn.copy()
        white_sigma, correlation = sigma.copy(), np.zeros(len(sigma))
        asked = np.flatnonzero(~self._plainly_white(stack, white.low_dn))
        if len(asked):
            answer = self.correlated.predict(stack[asked])
            ratio = (answer.correlation - WHITE_BELOW) / (CORRELATED_ABOVE - WHITE_BELOW)
            weight = np.clip(ratio, 0.0, 1.0)
            total, total_low, total_high = self._correlated_answer(stack[asked], answer)
            sigma[asked] = _between(sigma[asked], total, weight)
            low[asked] = np.where(weight > 0, _between(low[asked], total_low, weight), low[asked])
            high[asked] = np.where(weight > 0, _between(high[asked], total_high, weight), high[asked])
            white_sigma[asked] = _between(white_sigma[asked], answer.white_sigma_dn, weight)
            correlation[asked] = answer.correlation
            level = sigma[asked] / np.maximum(np.sqrt((answer.cells_dn**2).mean(axis=(1, 2))), 1e-6)
            adapted = answer.cells_dn * level[:, None, None].astype(np.float32)
            cells[asked] = np.where(weight[:, None, None] >= 0.5, adapted, cells[asked])
            wide = (np.log1p(high[asked]) - np.log1p(low[asked])) / 2 > self.widest_reach
            unsure = wide & (weight > 0) & (reason[asked] == "")
            traces = compressed(answer.statistics)
            reason[asked[unsure & traces]] = COMPRESSED
            reason[asked[unsure & ~traces]] = UNCERTAIN
        return Measured(sigma, low, high, np.minimum(white_sigma, sigma), correlation), cells

    def _plainly_white(self, stack: NDArray[np.floating], low_dn: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Patches whose noise is certainly there and white, for which the second network need not run."""
        plain = low_dn > PLAIN_SIGMA_DN
        for index in np.flatnonzero(plain):
            plain[index] = whiteness(np.rint(stack[index] * np.float32(FULL_SCALE_DN))) < PLAINLY_WHITE
        return plain

    def _correlated_answer(
        self, stack: NDArray[np.floating], answer: Prediction
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Sigma and its interval, DN, with principal components where the network is unsure."""
        level, reach = np.log1p(answer.sigma_dn), answer.reach
        if min(stack.shape[1:]) >= PCA_MIN_PX:
            share = reach**2 / (reach**2 + PCA_SCALE**2)
            reason = np.full(len(stack), "", dtype=object)
            principal = np.log1p(PCA_FACTOR * np.nan_to_num(self.principal.measure(stack, reason).sigma_dn))
            joined = (1 - share) * level + share * principal
            # The interval covers what the network alone would have allowed, about the joined answer.
            level, reach = joined, np.maximum(reach, np.abs(joined - level))
        return np.expm1(level), np.maximum(np.expm1(level - reach), 0.0), np.expm1(level + reach)


def compressed(statistics: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Whether patches show the traces of a strong codec: steps at block edges or vanished fine detail.

    Args:
        statistics: (N, COUNT), see `correlated_features.statistics`.
    """
    grid = statistics[:, GRID_START : GRID_START + 9]
    return (np.minimum(grid[:, 0], grid[:, 3]) > GRID_STEP) | (grid[:, 8] > VANISHED_COEFFICIENTS)


def _between(
    first: NDArray[np.float64], second: NDArray[np.float64], weight: NDArray[np.float64]
) -> NDArray[np.float64]:
    """A weighted mean of ln(1 + x): the first where the weight is 0, the second where it is 1."""
    return np.expm1((1 - weight) * np.log1p(first) + weight * np.log1p(second))
