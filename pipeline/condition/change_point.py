"""Change-point alarm: has the condition of a camera degraded since its reference period?

One-sided cumulative sums (Page, "Continuous inspection schemes", Biometrika 1954) of normal scores. With y the quantity
in which degradation counts upwards, and n frames of a reference period,

    z_t = probit((rank of y_t among the reference + 1/2) / (n + 1)),
    S_t = max(0, S_{t-1} + z_t / s - k),        alarm where S_t > h.

Scores of ranks (Conover, Tercero-Gomez and Cordero-Franco, "The sequential normal scores transformation", Sequential
Analysis 2017) are standard normal whatever law the frames follow, so that one in fifty that stands out, as behind a
gust of spray, counts in the sums as it did in the reference. Beyond the largest value of the reference, whose score is
z_n (2.9 of 300 frames), scores grow in proportion to the distance from the median, up to min(1 + (z_n - 1) tau^2, 6):
the longer frames are alike, the less a single score matters, and an alarm takes three frames at least. A score is at
most the distance from the median over 0.02, so that changes too small to matter raise nothing.

The threshold h follows from the average run length between false alarms, ARL (Siegmund, "Sequential Analysis", 1985,
with the long-run variance tau^2 of an autocorrelated series in place of 1, as in the chart of Kim, Alexopoulos, Tsui
and Wilson, "A distribution-free tabular CUSUM chart for autocorrelated data", IIE Transactions 2007):

    ARL = tau^2 / (2 k^2) (exp(x) - 1 - x),     x = 2 k b / tau^2,     b = h + 1.166.

tau^2 is that of the reference's scores (`pipeline.condition.long_run_variance`), times their variance where that bound
makes it less than 1, and at least 1. A reference of finite length is
uncertain. Three allowances keep the ARL: k = 1 + 1.5 tau / sqrt(n) in the recursion (the mean), s, which is 1 but for
its interval of 1.5 standard errors, whose upper end is taken, and an upper estimate of tau^2. They suffice where the
reference is long enough to show how frames vary, not for scenery that is alike for 5 s and longer in one of 30 s:
`pipeline.condition.trend` states the rates. Frames without an estimate are skipped.

A sum stops growing at 2 h, so that an alarm clears some frames after the quantity has recovered.

A reference must not contain the change that the chart is for: its mean would then be off and its spread too wide.
`drift` compares its first with its last third, m frames each. With r the deviations from each third's own line, s and
phi their spread and lag-1 autocorrelation, and tau as above, the means of the thirds differ where

    |mean_last - mean_first| > max(4 s tau sqrt(2 / m), s, 0.1).

Each third loses a line, so that a steady drift does not count as scatter; phi is enlarged by the bias that this causes
and by two standard errors. In stationary series with phi up to 0.9 fewer than one reference in 200 is found to drift.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtri
from scipy.stats import rankdata

from pipeline.condition.long_run_variance import lag_1, long_run_variance
from pipeline.condition.structure import MAD_TO_SIGMA
from pipeline.errors import InputError

Floats = NDArray[np.float64]

SHIFT_SIGMAS = 1.0  # k: half the shift that the chart is tuned for
OVERSHOOT = 1.166  # Siegmund's correction of the threshold for discrete time
LARGEST_SCORE = 6.0  # of frames beyond the reference, where it has less than that
CONFIDENCE = 1.5  # standard errors that the reference's mean and spread are enlarged by
LEAST_SPREAD = 0.02  # of ln(1 + sigma) and ln MTF: changes of 2 % are of no interest to an operator
LEAST_REFERENCE = 100
INLIER_SIGMAS = 3.5
CAP = 2.0  # in thresholds: where a sum stops growing
DRIFT_ERRORS = 4.0  # standard errors of the difference between a reference's thirds beyond which it has drifted
DRIFT_CONFIDENCE = 2.0  # standard errors that spread and autocorrelation are enlarged by for that
LEAST_DRIFT = 0.1  # of ln(1 + sigma) and ln MTF: what a chart of a camera in order may take in its reference
LARGEST_DRIFT_AUTOCORRELATION = 0.98


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
    """How quantities vary while the camera is in order.

    Attributes:
        ascending: (n, ...) values, each quantity's in ascending order.
        long_run_variance: (...) tau^2 of their scores.
    """

    ascending: Floats
    long_run_variance: Floats

    @classmethod
    def of(cls, values: ArrayLike) -> Reference:
        """The reference of a period.

        Args:
            values: (n, ...) quantities, frame by frame, finite.

        Raises:
            InputError: fewer than 100 frames, or a value that is no number.
        """
        series = _checked(values)
        scores = _bounded(ndtri((rankdata(series, axis=0) - 0.5) / len(series)), series - np.median(series, axis=0))
        tau2 = np.minimum(scores.var(axis=0), 1.0) * long_run_variance(scores)
        return cls(np.sort(series, axis=0), np.maximum(tau2, 1.0))

    @property
    def frames(self) -> int:
        """Length n of the reference."""
        return len(self.ascending)

    @property
    def median(self) -> Floats:
        """(...) level of the quantities."""
        return np.asarray((self.ascending[(self.frames - 1) // 2] + self.ascending[self.frames // 2]) / 2)

    @property
    def spread(self) -> Floats:
        """(...) s: standard deviation of later scores that the reference does not exclude."""
        effective = np.maximum(self.frames / self.long_run_variance, 2.0)  # independent frames that tell as much
        return np.asarray((1 + CONFIDENCE / np.sqrt(2 * effective)) / np.sqrt(1 - 1 / effective))

    def scores(self, values: ArrayLike) -> Floats:
        """Normal scores z of the values of a later frame.

        Args:
            values: (...) quantities, finite.

        Returns:
            (...) z, of the law of 0 mean and unit variance where nothing has changed.
        """
        y, n, largest = np.asarray(values, dtype=np.float64), self.frames, self.ascending[-1]
        rank = ((self.ascending < y).sum(axis=0) + (self.ascending <= y).sum(axis=0)) / 2
        scores = ndtri((rank + 0.5) / (n + 1))
        above = y - self.median
        end = float(ndtri((n + 0.5) / (n + 1)))
        most = np.minimum(1 + (end - 1) * self.long_run_variance, max(LARGEST_SCORE, end))
        beyond = np.minimum(end * above / np.maximum(largest - self.median, LEAST_SPREAD), most)
        return _bounded(np.where(y > largest, beyond, scores), above)


def drift(values: ArrayLike) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Whether quantities have drifted within a reference period.

    Args:
        values: (n, ...) quantities, frame by frame, finite.

    Returns:
        (...) means of the first and of the last third, and (...) bool, True where they differ by more than chance and
        by a size that matters.

    Raises:
        InputError: fewer than 100 frames, or a value that is no number.
    """
    series = _checked(values)
    m = len(series) // 3
    thirds = np.stack([_clipped(series[:m]), _clipped(series[-m:])], axis=1)
    first, last = thirds.mean(axis=0)
    frame = np.arange(m) - (m - 1) / 2
    centred = thirds - thirds.mean(axis=0)
    slopes = np.tensordot(frame, centred, axes=1) / (frame @ frame)
    rest = centred - frame.reshape(-1, *[1] * (centred.ndim - 1)) * slopes
    variance = (rest**2).sum(axis=(0, 1)) / (2 * m - 4)
    raw = lag_1(rest, (0, 1))
    phi = raw + (2 + 4 * np.maximum(raw, 0)) / m  # bias of a short series that has lost a line
    phi = phi + DRIFT_CONFIDENCE * np.sqrt(np.maximum(1 - np.clip(phi, 0, 1) ** 2, 0.0) / (2 * m))
    phi = np.clip(phi, 0.0, LARGEST_DRIFT_AUTOCORRELATION)
    effective = np.maximum(m * (1 - phi) / (1 + phi), 2.0)
    spread = np.sqrt(variance / (1 - 1 / effective)) * (1 + DRIFT_CONFIDENCE / np.sqrt(4 * effective))
    spread = np.maximum(spread, LEAST_SPREAD)
    error = spread * np.sqrt((1 + phi) / (1 - phi) * 2 / m)
    least = np.maximum(np.maximum(DRIFT_ERRORS * error, spread), LEAST_DRIFT)
    return first, last, np.asarray(np.abs(last - first) > least)


def _checked(values: ArrayLike) -> Floats:
    """(n, ...) values of a reference period; raises `InputError` where they are too few or not finite."""
    series = np.asarray(values, dtype=np.float64)
    if not np.isfinite(series).all():
        raise InputError("change-point alarm: a reference with values that are no numbers; leave those frames out")
    if len(series) < LEAST_REFERENCE:
        raise InputError(
            f"change-point alarm: a reference of {len(series)} frames; expected at least {LEAST_REFERENCE}"
        )
    return series


def _bounded(scores: Floats, distance: Floats) -> Floats:
    """(...) scores, of changes too small to matter no greater than their distance from the median over 0.02."""
    most = np.abs(distance) / LEAST_SPREAD
    return np.clip(scores, -most, most)


def _clipped(series: Floats) -> Floats:
    """(n, ...) values, those far from the median moved to 3.5 robust standard deviations from it."""
    middle = np.median(series, axis=0)
    rough = np.maximum(MAD_TO_SIGMA * np.median(np.abs(series - middle), axis=0), LEAST_SPREAD / 2)
    return np.clip(series, middle - INLIER_SIGMAS * rough, middle + INLIER_SIGMAS * rough)


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
        self.total = np.zeros(np.shape(tau2))
        self.alarm = np.zeros(np.shape(tau2), dtype=bool)
        self.frames_since_zero = np.zeros(np.shape(tau2), dtype=np.int64)

    def step(self, values: ArrayLike) -> NDArray[np.bool_]:
        """Take the values of one frame.

        Args:
            values: (...) quantities; NaN where there is no estimate.

        Returns:
            (...) bool, True where an alarm begins with this frame.
        """
        y = np.asarray(values, dtype=np.float64)
        known = np.isfinite(y)
        z = self.reference.scores(np.where(known, y, 0.0)) / self.reference.spread
        total = np.clip(self.total + z - self.allowance, 0.0, CAP * self.threshold)
        self.total = np.where(known, total, self.total)
        self.frames_since_zero = np.where(self.total > 0, self.frames_since_zero + 1, 0)
        begins = (self.total > self.threshold) & ~self.alarm
        self.alarm = (self.alarm | begins) & (self.total > 0)
        return begins
