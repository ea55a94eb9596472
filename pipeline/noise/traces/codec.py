"""Traces of a codec in patches, by the statistics that the network for correlated noise takes.

Strong ones are steps at block edges and vanished fine detail (`compressed`); weaker ones are quantised transform blocks
(`pipeline.noise.block_quantisation`), the weakest of which are but suspected. H.264 leaves no more than that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.noise.block_quantisation import present, suspected
from pipeline.noise.networks.correlated_features import GRID_START, QUANTISED_START

SMOOTH = 0.9  # fraction of vanished coefficients of quantised blocks above which no detail is left to flicker
VANISHED_COEFFICIENTS = 0.85  # of high-frequency DCT coefficients: a codec has removed them
GRID_STEP = 0.12  # ln of the step at block edges over that elsewhere


@dataclass(frozen=True)
class Traces:
    """Traces of a codec in N patches.

    Attributes:
        strong: (N,) steps at block edges or vanished fine detail (`compressed`).
        quantised: (N,) quantised transform blocks (`pipeline.noise.block_quantisation.present`).
        suspected: (N,) likewise, but too weak to be sure of (`pipeline.noise.block_quantisation.suspected`).
        detail: (N,) whether coefficients are left in the blocks, which may change from shot to shot.
    """

    strong: NDArray[np.bool_]
    quantised: NDArray[np.bool_]
    suspected: NDArray[np.bool_]
    detail: NDArray[np.bool_]

    @property
    def coded(self) -> NDArray[np.bool_]:
        """(N,) whether a codec shows."""
        return self.strong | self.quantised


def codec_traces(statistics: NDArray[np.float32], pixels: int) -> Traces:
    """Traces of a codec.

    Args:
        statistics: (N, COUNT), see `pipeline.noise.networks.correlated_features.statistics`.
        pixels: of a patch.
    """
    numbers, strong = statistics[:, QUANTISED_START:], compressed(statistics)
    return Traces(strong, present(numbers, pixels), suspected(numbers, pixels) & ~strong, numbers[:, -1] <= SMOOTH)


def compressed(statistics: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Whether patches show the traces of a strong codec: steps at block edges or vanished fine detail.

    Args:
        statistics: (N, COUNT), see `pipeline.noise.networks.correlated_features.statistics`.

    Returns:
        (N,).
    """
    grid = statistics[:, GRID_START : GRID_START + 9]
    return np.asarray((np.minimum(grid[:, 0], grid[:, 3]) > GRID_STEP) | (grid[:, 8] > VANISHED_COEFFICIENTS))
