"""Speed of the image from a sequence of motion estimates: a scalar Kalman filter on lengths of motion blur.

A frame exposed for t shows a line of length L = v t, so its estimate of the speed is z = L / t with variance R::

    R = (r / t) ** 2,    r = 1.25 px + 0.08 L + 1 px (sigma / 12 DN) ** 2

A short exposure constrains the speed little: lengths near the resolution of the estimator, about a pixel, are not
distinguished from no motion, and strong noise disturbs the estimate of blur. The speed may change between frames by a
quarter of itself and 100 px/s (standard deviation). An estimate more than three standard deviations from the prediction
is a sudden change: the filter starts anew from it. Lines of 27 to 48 px all look like 22.6 to 22.9 px to the monitor:
such an estimate bounds the length from below, and half as much more is assumed, with as large an error. A length at the
resolution bounds it from above: a known speed is kept as far as it agrees with that, so that a row of short exposures,
which all show no motion, is not taken for a standing image.

A known speed (odometry) is not filtered; it jumps where it is more than half a stop from what it was at the last jump.
"""

from __future__ import annotations

import math

RESOLUTION_PX = 1.25
RELATIVE_ERROR = 0.08
DISTURBING_NOISE_DN = 12.0
DRIFT_PX_S, DRIFT_FRACTION = 100.0, 0.25
SUDDEN_SIGMAS = 3.0
SUDDEN_STOPS = 0.5
LONGEST_RESOLVED_PX, BEYOND = 22.2, 0.5


def length_error_px(length_px: float, sigma_dn: float) -> float:
    """Standard deviation of an estimated length of motion blur, px.

    Args:
        length_px: estimated.
        sigma_dn: estimated noise of the frame.
    """
    return RESOLUTION_PX + RELATIVE_ERROR * length_px + (sigma_dn / DISTURBING_NOISE_DN) ** 2


def resolved_px(length_px: float) -> float:
    """Length of motion that an estimated length stands for, px.

    None at the resolution, the same well above it, half as much more where the estimators no longer resolve it.
    """
    if length_px <= RESOLUTION_PX:
        return 0.0
    if length_px >= LONGEST_RESOLVED_PX:
        return length_px * (1.0 + BEYOND)
    return length_px * math.sqrt(1.0 - (RESOLUTION_PX / length_px) ** 4)


class SpeedFilter:
    """Speed with its standard deviation, updated by every frame whose motion was estimated."""

    def __init__(self) -> None:
        self.value_px_s = math.nan
        self.variance = math.inf
        self.jumps = 0
        """Sudden changes so far."""

    @property
    def high_px_s(self) -> float:
        """Upper end of the 95 % interval, px/s."""
        return self.value_px_s + 1.96 * math.sqrt(self.variance) if math.isfinite(self.variance) else self.value_px_s

    def update(self, length_px: float, exposure_s: float, sigma_dn: float) -> float:
        """Speed after a frame, px/s.

        Args:
            length_px: estimated motion blur.
            exposure_s: of the frame.
            sigma_dn: estimated noise of the frame.
        """
        measured = resolved_px(length_px) / exposure_s
        error = (length_error_px(length_px, sigma_dn) / exposure_s) ** 2
        prior = self.variance + (DRIFT_PX_S + DRIFT_FRACTION * self.value_px_s) ** 2
        known = not math.isnan(self.value_px_s)
        sudden = (measured - self.value_px_s) ** 2 > SUDDEN_SIGMAS**2 * (prior + error)
        if length_px >= LONGEST_RESOLVED_PX:
            error += (BEYOND * length_px / exposure_s) ** 2
        if length_px <= RESOLUTION_PX and known:
            measured, sudden = min(self.value_px_s, RESOLUTION_PX / exposure_s), False
        if sudden or not known:
            self.jumps += 1
            self.value_px_s, self.variance = measured, error
            return measured
        weight = prior / (prior + error)
        self.value_px_s += weight * (measured - self.value_px_s)
        self.variance = (1.0 - weight) * prior
        return self.value_px_s


class KnownSpeedJumps:
    """Sudden changes of a speed that is known without error.

    Args:
        exposure_max_s: longest exposure time; a speed that moves the image by less than the resolution meanwhile
            counts as none.
    """

    def __init__(self, exposure_max_s: float) -> None:
        self.least_px_s = RESOLUTION_PX / exposure_max_s
        self.count = 0
        """Sudden changes so far, the first speed among them."""
        self._stops = math.nan

    def update(self, speed_px_s: float) -> int:
        """Sudden changes so far, with the speed of a frame, px/s."""
        stops = math.log2(max(abs(speed_px_s), self.least_px_s))
        if not abs(stops - self._stops) <= SUDDEN_STOPS:
            self.count += 1
            self._stops = stops
        return self.count
