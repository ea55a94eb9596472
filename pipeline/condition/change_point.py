"""Change-point alarm: has the condition of a camera degraded since its reference period?

One-sided cumulative sums (Page, "Continuous inspection schemes", Biometrika 1954) of standardised values. With y the
quantity in which degradation counts upwards,

    z_t = min((y_t - m) / s, 4),        S_t = max(0, S_{t-1} + z_t - k),        alarm where S_t > h,

m, s and the lag-1 autocorrelation phi come from a reference period of n frames. The threshold h follows from the
average run length between false alarms, ARL (Siegmund, "Sequential Analysis", 1985, with the long-run variance
tau^2 = (1 + phi) / (1 - phi) of an autocorrelated series in place of 1):

    ARL = tau^2 / (2 k^2) (exp(x) - 1 - x),     x = 2 k b / tau^2,     b = h + 1.166.

A reference of finite length is uncertain. Three allowances keep the ARL: k = 1 + 2 tau / sqrt(n) in the recursion (the
mean), s enlarged to the upper end of its interval, and phi likewise. Estimates of one picture that leap (clipping at 4
s) raise no alarm by themselves. Frames without an estimate are skipped.

A sum stops growing at 2 h, so that an alarm clears some frames after the quantity has recovered.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.errors import InputError

Floats = NDArray[np.float64]

SHIFT_SIGMAS = 1.0  # k: half the shift that the chart is tuned for
OVERSHOOT = 1.166  # Siegmund's correction of the threshold for discrete time
LARGEST_STEP = 4.0
CONFIDENCE = 1.0  # standard errors that the reference's mean, spread and autocorrelation are enlarged by
LARGEST_AUTOCORRELATION = 0.95
LEAST_SPREAD = 0.02  # of ln(1 + sigma) and ln MTF: changes of 2 % are of no interest to an operator
LEAST_REFERENCE = 100
MAD_TO_SIGMA = 1.4826
INLIER_SIGMAS = 3.5
CAP = 2.0  # in thresholds: where a sum stops growing


def run_length(threshold: ArrayLike, allowance: float, long_run_variance: ArrayLike) -> Floats:
    """Average number of frames between false alarms of a one-sided chart.

    Args:
        threshold: (...) h, in standard deviations.
        allowance: k, likewise.
        long_run_variance: (...) tau^2; 1 for independent frames.

    Returns:
        (...) frames.
    """
    tau2 = np.asarray(long_run_variance, dtype=np.float64)
    x = 2 * allowance * (np.asarray(threshold, dtype=np.float64) + OVERSHOOT) / tau2
    return np.asarray(tau2 / (2 * allowance**2) * (np.expm1(x) - x))


def threshold_for(frames: float, allowance: float, long_run_variance: ArrayLike) -> Floats:
    """The threshold h whose `run_length` is a number of frames, by bisection.

    Args:
        frames: average number of frames between false alarms, above 1.
        allowance: k, in standard deviations.
        long_run_variance: (...) tau^2.

    Returns:
        (...) h, in standard deviations, at least 0.
    """
    tau2 = np.asarray(long_run_variance, dtype=np.float64)
    low, high = np.zeros(tau2.shape), np.full(tau2.shape, 50.0) * np.maximum(tau2, 1.0)
    for _ in range(60):
        middle = (low + high) / 2
        above = run_length(middle, allowance, tau2) > frames
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return np.asarray((low + high) / 2)


@dataclass(frozen=True)
class Reference:
    """Level and spread of quantities while the camera is in order.

    Attributes:
        mean: (...) m.
        spread: (...) s.
        autocorrelation: (...) phi.
        frames: n.
    """

    mean: Floats
    spread: Floats
    autocorrelation: Floats
    frames: int

    @classmethod
    def of(cls, values: ArrayLike) -> Reference:
        """The reference of a period.

        Args:
            values: (n, ...) quantities, frame by frame, finite.

        Raises:
            InputError: fewer than 100 frames.
        """
        series = np.asarray(values, dtype=np.float64)
        n = len(series)
        if n < LEAST_REFERENCE:
            raise InputError(f"change-point alarm: a reference of {n} frames; expected at least {LEAST_REFERENCE}")
        middle = np.median(series, axis=0)
        rough = np.maximum(MAD_TO_SIGMA * np.median(np.abs(series - middle), axis=0), LEAST_SPREAD / 2)
        kept = np.clip(series, middle - INLIER_SIGMAS * rough, middle + INLIER_SIGMAS * rough)
        mean, spread = kept.mean(axis=0), kept.std(axis=0, ddof=1)
        centred = kept - mean
        raw = (centred[1:] * centred[:-1]).sum(axis=0) / np.maximum((centred**2).sum(axis=0), 1e-12)
        phi = raw + (1 + 3 * np.maximum(raw, 0)) / n  # bias of short series (Kendall 1954)
        phi = phi + CONFIDENCE * np.sqrt(np.maximum(1 - np.clip(phi, 0, 1) ** 2, 0.0) / n)
        phi = np.clip(phi, 0.0, LARGEST_AUTOCORRELATION)
        effective = np.maximum(n * (1 - phi) / (1 + phi), 2.0)  # independent frames that tell as much
        spread = spread / np.sqrt(1 - 1 / effective) * (1 + CONFIDENCE / np.sqrt(2 * effective))
        return cls(mean, np.maximum(spread, LEAST_SPREAD), phi, n)

    @property
    def long_run_variance(self) -> Floats:
        """(...) tau^2 of the standardised series."""
        return np.asarray((1 + self.autocorrelation) / (1 - self.autocorrelation))


class Chart:
    """One-sided CUSUM charts of several quantities, side by side.

    Args:
        reference: of the quantities, in which degradation counts upwards.
        frames_between_false_alarms: average run length of each chart.

    Attributes:
        threshold: (...) h.
        total: (...) S now.
        alarm: (...) bool, whether S has exceeded h and not yet returned to 0.
        frames_since_zero: (...) frames since S was 0: the estimated time of the change.
    """

    def __init__(self, reference: Reference, frames_between_false_alarms: float) -> None:
        self.reference = reference
        tau2 = reference.long_run_variance
        self.threshold = threshold_for(frames_between_false_alarms, SHIFT_SIGMAS, tau2)
        self.allowance = SHIFT_SIGMAS + CONFIDENCE * np.sqrt(tau2 / reference.frames)
        self.total = np.zeros(np.shape(reference.mean))
        self.alarm = np.zeros(np.shape(reference.mean), dtype=bool)
        self.frames_since_zero = np.zeros(np.shape(reference.mean), dtype=np.int64)

    def step(self, values: ArrayLike) -> NDArray[np.bool_]:
        """Take the values of one frame.

        Args:
            values: (...) quantities; NaN where there is no estimate.

        Returns:
            (...) bool, True where an alarm begins with this frame.
        """
        y = np.asarray(values, dtype=np.float64)
        known = np.isfinite(y)
        z = np.minimum((np.where(known, y, self.reference.mean) - self.reference.mean) / self.reference.spread,
                       LARGEST_STEP)  # fmt: skip
        total = np.clip(self.total + z - self.allowance, 0.0, CAP * self.threshold)
        self.total = np.where(known, total, self.total)
        self.frames_since_zero = np.where(self.total > 0, self.frames_since_zero + 1, 0)
        begins = (self.total > self.threshold) & ~self.alarm
        self.alarm = (self.alarm | begins) & (self.total > 0)
        return begins
