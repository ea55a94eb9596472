"""From radiance to grey level: exposure, then a power law, as a camera's tone curve does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]


@dataclass(frozen=True)
class Tone:
    """``grey = clip(exposure * radiance, 0, 1) ** (1 / gamma)``.

    Attributes:
        exposure: grey level of unit radiance under a linear curve.
        gamma: 1 is linear.
    """

    exposure: float = 0.4
    gamma: float = 2.2

    def __call__(self, radiance: Array) -> Array:
        """Grey levels in [0, 1], the shape of `radiance`."""
        level = np.clip(radiance * np.float32(self.exposure), 0.0, 1.0)
        return level if self.gamma == 1.0 else level ** np.float32(1.0 / self.gamma)


LINEAR = Tone(exposure=1.0, gamma=1.0)
