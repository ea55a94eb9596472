"""Sensor constants from raw frames: photon transfer and dark current, after EMVA 1288.

Photon transfer: the variance of a linear sensor's grey values grows with their mean,

    sigma^2 = c + K mu,    c = K^2 sigma_d^2 + q^2 / 12,

with mu the mean above the black level, K the system gain in DN per electron, sigma_d the dark noise in electrons and
q^2 / 12 of quantisation in steps of q DN: 1, or 16 where 12 bits lie in the high bits of 16 (`grey_step_dn`). Two
frames a and b of one scene, b of r times the exposure, differ by noise alone once a is scaled,

    var(b - r a) / (1 + r^2) = c + K mu_b (1 + r) / (1 + r^2),

which for r = 1 is half the variance of their difference. It is taken around a plane in each block of 16 x 16 px, so
that light that changes across a block from one frame to the next, as of a flickering lamp behind a rolling shutter, is
not counted. As in the standard the line is fitted up to 70 % of saturation, where sensors are linear. Beyond the
standard, a bin of points is summarised by medians instead of means, since between two exposures an edge of a real scene
may move: of 4455 blocks of a Flea3 a few in a thousand hold such an edge, and raise means of the variance by up to 4 %.
Medians are of variances over the line of the fit before: bins may hold two levels of light, and variances of both have
no median near their mean, but all are spread around the line as chi^2 with n - 3 degrees of freedom, whose median over
its mean (0.9974 of a block) is divided out.

Dark current: the mean of dark frames grows linearly with the exposure time; its slope over K is in electrons per
second. A camera whose black level is at 0 cuts off half of its dark noise: means and variances of its dark frames are
then limits, not measurements, which `DarkCurrent.zero_fraction` shows.

The intercept c is extrapolated from lit blocks, whose own noise spreads them over several grey values: rounding adds
q^2 / 12 to the variance only of noise that is not small against q, so that blocks of less than .4 q^2 are left out.
Where c is below q^2 / 12 there is no dark noise to state.

Fixed pattern: what pixels differ by in every frame, in proportion to their light, is not among this noise, though a
single frame shows it like noise. Two frames of one scene share it,

    s^2 = mean(h * a  h * b) / (mean(a) mean(b)),    h = (1, -4, 6, -4, 1) / sqrt(70) along rows and columns,

a filter that passes white patterns whole and little of what a lens has drawn. It is the non-uniformity of the sensor,
dust, and the finest grain of the scene, which two frames cannot tell apart: an upper limit for that of the sensor.

Frames are raw mosaics in DN; each of the four colour planes ("00", "01", "10", "11": row and column of its first
pixel) is a sensor by itself.

Source: EMVA Standard 1288, release 4.0, sections on photon transfer and dark current.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError

PLANES = ("00", "01", "10", "11")
BLOCK_PX = 16
FREEDOM = BLOCK_PX**2 - 3  # of the pixels of a block around a plane
LOWEST_STEPS = 4.0  # of grey above black
CLIPPED_FRACTION = 0.98  # of white: pixels from here on count as clipped
UNDERFLOW_FRACTION = 0.005  # of pixels at 0, which cuts their noise off; as much as the standard allows
LINEAR_FRACTION = 0.7  # of saturation, up to which the standard fits the line
MEAN_BINS = 24
LOWEST_VARIANCE_STEPS2 = 0.4  # q^2, rounding included; from here on rounding adds q^2 / 12 within 1 % of the variance
FITS = 3  # of the line: bins of two levels bias the first by up to 3 %, the second by a tenth of that
SURE_ERRORS = 3.0  # standard errors by which the gain has to exceed 0
_FINE_GAIN = 70.0  # of the fourth difference along rows and columns: 1 + 16 + 36 + 16 + 1


@dataclass(frozen=True)
class TransferPoints:
    """Points of the photon-transfer curve.

    Attributes:
        mean_dn: (N,) mean grey value of a block, DN above black; of frames of two exposures mu_b (1 + r) / (1 + r^2).
        variance_dn2: (N,) variance of the noise at that grey value, DN^2.
        pattern_variance: (N,) variance s^2 of the fixed pattern, over the square of the grey value; of a single block
            it may be negative. Empty where it was not measured.
    """

    mean_dn: NDArray[np.float64]
    variance_dn2: NDArray[np.float64]
    pattern_variance: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))


@dataclass(frozen=True)
class PhotonTransfer:
    """A fitted photon-transfer curve.

    Attributes:
        gain_dn_per_e: system gain K.
        gain_error: its standard error, DN per electron.
        dark_variance_dn2: c, the variance at no light, quantisation included; it can be slightly negative.
        points: of the curve.
        black_dn: grey value without light that was subtracted from the points, DN.
        dark_variance_error: standard error of c, DN^2.
        covariance: of K and c, DN^3 per electron; both errors are of one line, so that it is negative.
        pattern_fraction: standard deviation s of the fixed pattern as a fraction of the grey value above black; NaN
            where it was not measured.
        step_dn: q, between neighbouring grey values, DN (`grey_step_dn`).
    """

    gain_dn_per_e: float
    gain_error: float
    dark_variance_dn2: float
    points: int
    black_dn: float = 0.0
    dark_variance_error: float = 0.0
    covariance: float = 0.0
    pattern_fraction: float = math.nan
    step_dn: float = 1.0

    @property
    def dark_sigma_e(self) -> float:
        """Dark noise in electrons, quantisation removed; NaN where that leaves nothing (`dark_sigma_reason`)."""
        excess_dn2 = self.dark_variance_dn2 - quantisation_dn2(self.step_dn)
        return float(np.sqrt(excess_dn2) / self.gain_dn_per_e) if excess_dn2 >= 0 else math.nan

    @property
    def dark_sigma_error(self) -> float:
        """Standard error of the dark noise, electrons, by propagation of those of c and K; NaN without dark noise."""
        sigma_e = self.dark_sigma_e
        if not sigma_e > 0:
            return math.nan
        by_variance, by_gain = 1 / (2 * sigma_e * self.gain_dn_per_e**2), -sigma_e / self.gain_dn_per_e
        variance = (by_variance * self.dark_variance_error) ** 2 + (by_gain * self.gain_error) ** 2
        return float(np.sqrt(max(variance + 2 * by_variance * by_gain * self.covariance, 0.0)))

    @property
    def dark_sigma_reason(self) -> str:
        """Why there is no dark noise, or ""."""
        quantisation = quantisation_dn2(self.step_dn)
        if self.dark_variance_dn2 >= quantisation:
            return ""
        return (
            f"the variance at no light, {self.dark_variance_dn2:.3f} DN^2, is below that of quantisation, "
            f"{quantisation:.3f} DN^2"
        )

    def snr(self, grey_dn: float) -> float:
        """Signal-to-noise ratio at a grey value above black."""
        return float(grey_dn / np.sqrt(self.dark_variance_dn2 + self.gain_dn_per_e * grey_dn))

    def sigma_dn(self, grey_dn: NDArray[np.float64]) -> NDArray[np.float64]:
        """Standard deviation of the noise, DN, at raw grey values, black level included: of any shape, DN."""
        above_dn = grey_dn - self.black_dn
        return np.asarray(np.sqrt(np.maximum(self.dark_variance_dn2 + self.gain_dn_per_e * above_dn, 0)))

    def sigma_with_pattern_dn(self, grey_dn: NDArray[np.float64]) -> NDArray[np.float64]:
        """Standard deviation of noise and fixed pattern together, DN; as `sigma_dn`; NaN without a measured pattern."""
        return np.hypot(self.sigma_dn(grey_dn), self.pattern_fraction * (grey_dn - self.black_dn))


@dataclass(frozen=True)
class DarkCurrent:
    """A line through the means of dark frames.

    Attributes:
        slope_dn_per_s: dark current, DN per second.
        slope_error: its standard error, DN per second.
        offset_dn: mean of a dark frame of no exposure, the black level.
        zero_fraction: pixels of 0 DN; near 1 the black level cuts off the noise and the slope is of hot pixels alone.
    """

    slope_dn_per_s: float
    slope_error: float
    offset_dn: float
    zero_fraction: float

    @property
    def black_dn(self) -> float:
        """Black level, DN: the offset, or 0 where half of the dark pixels are 0, whose mean is of clipped noise."""
        return self.offset_dn if self.zero_fraction < 0.5 else 0.0


def grey_step_dn(frames: Iterable[NDArray[np.generic]]) -> float:
    """The step q of a camera's grey values, DN: the greatest common divisor of their differences.

    A camera that writes other values into defective pixels, as by interpolation, hides a step above 1.

    Args:
        frames: (H, W) grey values of one camera in one mode, dark and lit; few differ by multiples of more by chance.

    Returns:
        1 for whole values without gaps, 2^(16 - n) for n bits in the high bits of 16; 1 too for frames of a single
        grey value and for values that are not whole.
    """
    values = np.unique(np.concatenate([np.unique(frame) for frame in frames]))
    if not (values == np.rint(values)).all():
        return 1.0
    return float(np.gcd.reduce(np.diff(values.astype(np.int64))) or 1)


def quantisation_dn2(step_dn: float) -> float:
    """Variance of rounding to steps, q^2 / 12, DN^2.

    Args:
        step_dn: q, DN.
    """
    return step_dn**2 / 12


def plane(frame: NDArray[np.generic], name: str) -> NDArray[np.float64]:
    """One colour plane of a raw mosaic.

    Args:
        frame: (H, W) raw grey values.
        name: one of `PLANES`.

    Returns:
        (H / 2, W / 2) float64, rounded down.

    Raises:
        InputError: not two-dimensional, too small for a block, or no such plane.
    """
    if name not in PLANES:
        raise InputError(f"plane {name!r}: expected one of {', '.join(PLANES)}")
    if frame.ndim != 2 or min(frame.shape) < 2 * BLOCK_PX:
        raise InputError(f"raw frame: shape {frame.shape}, expected (H, W) of {2 * BLOCK_PX} px or more")
    height, width = (side // 2 * 2 for side in frame.shape)
    return np.asarray(frame[int(name[0]) : height : 2, int(name[1]) : width : 2], dtype=np.float64)


def points_of_pair(
    first: NDArray[np.generic],
    second: NDArray[np.generic],
    white_dn: float,
    black_dn: float = 0.0,
    step_dn: float = 1.0,
) -> TransferPoints:
    """Points from two frames of one scene, block by block.

    Blocks are left out where they hold a clipped pixel or more than .5 % of pixels at 0, where the first frame is too
    dark, and where the second is brighter than 70 % of saturation.

    Args:
        first: (H, W) one colour plane, or a sensor without colour filters, raw DN.
        second: the same at the same or a longer exposure; the ratio is estimated in each block.
        white_dn: raw grey value of saturation, DN.
        black_dn: raw grey value without light, DN; subtracted from both frames.
        step_dn: between neighbouring grey values, DN (`grey_step_dn`).

    Raises:
        InputError: frames of unequal shape, or white that is not above black.
    """
    if first.shape != second.shape:
        raise InputError(f"frames: shapes {first.shape} and {second.shape}, expected the same")
    if not white_dn > black_dn:
        raise InputError(f"white_dn: {white_dn:g} DN, expected more than the black level of {black_dn:g} DN")
    a, b = _blocks(first), _blocks(second)
    unclipped = np.maximum(a, b).max(axis=(1, 2)) < CLIPPED_FRACTION * white_dn
    unclipped &= (np.minimum(a, b) <= 0).mean(axis=(1, 2)) < UNDERFLOW_FRACTION
    a, b = a - black_dn, b - black_dn
    linear = b.mean(axis=(1, 2)) <= LINEAR_FRACTION * (white_dn - black_dn)
    keep = (a.mean(axis=(1, 2)) >= LOWEST_STEPS * step_dn) & unclipped & linear
    a, b = a[keep], b[keep]
    mean_of_first, mean = a.mean(axis=(1, 2)), b.mean(axis=(1, 2))
    ratio = mean / mean_of_first
    variance = _noise_variance(b - ratio[:, None, None] * a) / (1 + ratio**2)
    pattern = (_fine(a) * _fine(b)).mean(axis=(1, 2)) / (mean_of_first * mean)
    return TransferPoints(mean * (1 + ratio) / (1 + ratio**2), variance, pattern)


def binned(points: Sequence[TransferPoints], step_dn: float = 1.0) -> TransferPoints:
    """Points in bins of equal count, as the line is fitted to them; see the module.

    Args:
        points: of any number of frames of one colour plane.
        step_dn: between neighbouring grey values of the frames, DN (`grey_step_dn`).

    Returns:
        the median mean of each bin, and its variance there, unbiased.

    Raises:
        InputError: fewer than 24 points whose noise rounding does not hide.
    """
    return _fitted(points, step_dn)[0]


def photon_transfer(points: Sequence[TransferPoints], black_dn: float = 0.0, step_dn: float = 1.0) -> PhotonTransfer:
    """The straight line through points: weighted least squares over bins of equal count (`binned`).

    Args:
        points: of any number of frames of one colour plane.
        black_dn: that was subtracted from them, kept with the result.
        step_dn: between neighbouring grey values of the frames, DN (`grey_step_dn`).

    Returns:
        the fit; weights are the inverse of the line, to which the error of a variance is proportional. The fixed
        pattern is the median over all blocks.

    Raises:
        InputError: fewer than 24 points whose noise rounding does not hide, or a variance that does not grow with the
            mean by three standard errors.
    """
    _, (slope, offset), covariance = _fitted(points, step_dn)
    slope_error, offset_error = np.sqrt(np.diag(covariance))
    if not slope > max(SURE_ERRORS * slope_error, 0.0):
        raise InputError(
            f"photon transfer: the variance grows with the mean by {slope:.3g} ± {slope_error:.2g} DN per electron, "
            "which is not sure; expected linear raw frames of dark and of bright scenes"
        )
    pattern = np.concatenate([part.pattern_variance for part in points])
    return PhotonTransfer(
        gain_dn_per_e=float(slope),
        gain_error=float(slope_error),
        dark_variance_dn2=float(offset),
        points=sum(len(part.mean_dn) for part in points),
        black_dn=black_dn,
        dark_variance_error=float(offset_error),
        covariance=float(covariance[0, 1]),
        pattern_fraction=float(np.sqrt(max(np.median(pattern), 0.0))) if len(pattern) else math.nan,
        step_dn=step_dn,
    )


def dark_current(exposures_s: Sequence[float], frames: Sequence[NDArray[np.generic]]) -> DarkCurrent:
    """The straight line through the means of dark frames over exposure time.

    Args:
        exposures_s: of each frame, seconds; at least three different ones.
        frames: (H, W) dark frames or planes of them, DN.

    Raises:
        InputError: lengths differ, or fewer than three exposures.
    """
    if len(exposures_s) != len(frames) or len(set(exposures_s)) < 3:
        raise InputError(
            f"dark current: {len(frames)} frames of {len(set(exposures_s))} exposures, expected three exposures or more"
        )
    means = np.array([np.asarray(frame, dtype=np.float64).mean() for frame in frames])
    (slope, offset), covariance = np.polyfit(np.asarray(exposures_s, dtype=np.float64), means, 1, cov=True)
    zero = float(np.mean([np.mean(frame == 0) for frame in frames]))
    return DarkCurrent(float(slope), float(np.sqrt(covariance[0, 0])), float(offset), zero)


def _fitted(
    points: Sequence[TransferPoints], step_dn: float
) -> tuple[TransferPoints, NDArray[np.float64], NDArray[np.float64]]:
    """Bins of points, the line through them (slope, offset), and its covariance; see `binned`."""
    from scipy.special import chdtri

    mean = np.concatenate([part.mean_dn for part in points]) if points else np.empty(0)
    variance = np.concatenate([part.variance_dn2 for part in points]) if points else np.empty(0)
    median_over_mean = float(chdtri(FREEDOM, 0.5)) / FREEDOM
    line, lowest = np.array([0.0, step_dn**2]), LOWEST_VARIANCE_STEPS2 * step_dn**2
    if len(mean) < MEAN_BINS:
        raise InputError(f"photon transfer: {len(mean)} usable blocks, expected {MEAN_BINS} or more; give more frames")
    for _ in range(FITS):
        usable = np.polyval(line, mean) >= lowest
        if usable.sum() < MEAN_BINS:
            raise InputError(
                f"photon transfer: rounding hides the noise of all but {usable.sum()} blocks, expected {MEAN_BINS} or "
                "more that show it; give frames of more light, more gain or more bits"
            )
        mean, variance = mean[usable], variance[usable]
        bins = np.array_split(np.argsort(mean, kind="stable"), MEAN_BINS)
        centre = np.array([np.median(mean[index]) for index in bins])
        if centre[0] == centre[-1]:
            raise InputError(f"photon transfer: all blocks of {centre[0]:g} DN, expected dark and bright scenes")
        over_line = variance / np.polyval(line, mean)
        at_centre = np.maximum(np.polyval(line, centre), lowest)
        in_bins = np.array([np.median(over_line[index]) for index in bins]) * at_centre / median_over_mean
        line, covariance = np.polyfit(centre, in_bins, 1, w=1 / at_centre, cov=True)
    return TransferPoints(centre, in_bins), line, covariance


def _noise_variance(blocks: NDArray[np.float64]) -> NDArray[np.float64]:
    """Variance of (N, 16, 16) blocks around the plane that fits each best, (N,), unbiased."""
    ramp = np.arange(BLOCK_PX) - (BLOCK_PX - 1) / 2
    square = BLOCK_PX * ramp @ ramp
    ramps = [np.einsum(order, blocks, ramp) ** 2 / square for order in ("nij,i->n", "nij,j->n")]
    return (blocks.var(axis=(1, 2)) * BLOCK_PX**2 - sum(ramps)) / FREEDOM


def _fine(blocks: NDArray[np.float64]) -> NDArray[np.float64]:
    """What the finest filter of the module leaves of (N, 16, 16) blocks, (N, 12, 12): of white noise its variance."""
    return np.diff(np.diff(blocks, n=4, axis=1), n=4, axis=2) / _FINE_GAIN


def _blocks(values: NDArray[np.generic]) -> NDArray[np.float64]:
    """Blocks side by side, (N, 16, 16)."""
    height, width = (side // BLOCK_PX for side in values.shape)
    cut = np.asarray(values[: height * BLOCK_PX, : width * BLOCK_PX], dtype=np.float64)
    split = cut.reshape(height, BLOCK_PX, width, BLOCK_PX).transpose(0, 2, 1, 3)
    return split.reshape(-1, BLOCK_PX, BLOCK_PX)
