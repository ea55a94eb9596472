"""Photon shot noise: light arrives in single photons, so a pixel's count is Poisson distributed.

``e' ~ Poisson(e)``: mean ``e``, variance ``e`` (Wischow et al. 2023, Sec. III; Janesick 2007, ch. 3). One electron
per photon.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import draws


def photon_shot(
    electrons: NDArray[np.float32], generator: np.random.Generator, method: draws.PoissonMethod = "exact"
) -> NDArray[np.float32]:
    """Draw the photo-electrons that a mean signal gives.

    Args:
        electrons: (..., H, W) mean signal, e-, at least 0.
        generator: where the draws come from.
        method: ``exact`` Poisson counts, or ``hybrid`` (a rounded normal from 64 e- upwards); see `draws.poisson`.

    Returns:
        float32 whole electrons, same shape.

    Raises:
        InputError: a mean is negative or not a number.
    """
    return draws.poisson(electrons, generator, method)
