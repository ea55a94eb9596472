"""Ratio of the estimated noise to that of the sensor model: a scalar Kalman filter on its logarithm.

The model is known to some 30 %; an estimate errs by about half a grey level and 5 %. Weak noise, which texture hides,
therefore hardly moves the ratio, and strong noise decides it at once. The ratio may drift by 10 % a frame.
"""

from __future__ import annotations

import math

MODEL_ERROR, DRIFT = 0.3, 0.1
ESTIMATE_ERROR_DN, ESTIMATE_ERROR = 0.5, 0.05


class NoiseRatio:
    """Estimated over modelled noise; 1 before the first frame."""

    def __init__(self) -> None:
        self._log, self._variance = 0.0, MODEL_ERROR**2

    @property
    def value(self) -> float:
        """The ratio."""
        return math.exp(self._log)

    def update(self, ratio: float, sigma_dn: float) -> float:
        """The ratio after a frame.

        Args:
            ratio: estimated over modelled noise of the frame, above 0.
            sigma_dn: estimated noise, above 0 DN.
        """
        error = ESTIMATE_ERROR_DN / max(sigma_dn, 1e-6) + ESTIMATE_ERROR
        prior = self._variance + DRIFT**2
        weight = prior / (prior + error**2)
        self._log += weight * (math.log(ratio) - self._log)
        self._variance = (1.0 - weight) * prior
        return self.value
