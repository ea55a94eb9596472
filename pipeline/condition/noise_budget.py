"""The noise budget of a frame: how much noise its sensor explains, from which sources, and what the rest may be.

A sensor of known constants, an exposure time and a gain predict the noise of every grey level in closed form
(`pipeline.camera.exposure.Camera.budget`): photon noise, dark-current shot noise, readout noise, rounding, and fixed
pattern in proportion to the light, which a single frame shows as noise. In tile i of a frame whose local means are m::

    expected_i^2 = mean over pixels of (photon(m) + dark(m) + readout(m) + pattern(m) + rounding(m))
    ratio = median_i s_i / expected_i

with the noise s_i estimated in it, all behind the tone curve. Noise departs from the sensor where the interval of the
ratio does not hold 1 and the ratio is off by 15 % and .5 DN; it is less than expected only where it is less than
without the fixed pattern, of which a camera may correct any part. Stated then are the single changes x that explain the
tiles, dark and bright: a gain x times that assumed (photon noise grows with x, dark and readout noise with x^2, in
variance), dark or readout noise x times as strong, x percent of fixed pattern, or noise of x DN added behind the tone
curve. Dark and readout noise are alike in one frame: neither depends on the light.

Model: Wischow et al. 2023, Sec. III; photon transfer after EMVA Standard 1288. That noise which does not match the
metadata shows an unexpected source is their later idea (Wischow et al. 2024); theirs is a network, this is the formula.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import as_array
from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.camera.exposure import Camera, check_settings
from pipeline.camera.sensor import check_base_gain
from pipeline.camera.tone_curve import decode, noise_after_curve
from pipeline.condition.estimate import NoiseState
from pipeline.datasets.patches import Patch
from pipeline.errors import InputError
from pipeline.statistics import inliers

Floats = NDArray[np.float64]

SOURCES = ("photon", "dark", "readout", "pattern", "rounding")
DEPARTURES = ("more", "less")
LEAST_RATIO, LEAST_DN = 0.15, 0.5
"""How far noise must be from what is expected to depart from it, as a fraction and in DN."""

PROCESSED_CORRELATION = 0.25
"""Correlation of adjacent pixels from which noise was processed: a sensor's is white."""

SMOOTHING_PX = 9  # side of the box whose mean stands for the grey level without noise
_GREY = np.arange(256.0)  # levels of 8 bits
_CLIPPED_SIGMAS = 2.5  # distance from black and white in standard deviations below which noise is clipped
_LEAST_SIGMA_DN = 0.05  # for the logarithm
_LEAST_READABLE = 0.5  # fraction of a tile's pixels
_FITS_AS_WELL = (1.5, 0.01)  # times the least misfit, and beside that
_FACTORS = np.geomspace(0.05, 20.0, 241)  # 2.5 % apart
_ADDED_DN = np.geomspace(0.1, 60.0, 241)
_PATTERNS = np.geomspace(0.001, 0.5, 241)  # fractions of the light


@dataclass(frozen=True)
class Explanation:
    """One change of the sensor's model with which it explains the noise of a frame.

    Attributes:
        kind: ``gain``, ``dark or readout``, ``pattern`` or ``added``.
        amount: times the gain, or times the standard deviation of dark and readout noise; of ``pattern`` a fraction of
            the light, of ``added`` DN.
        misfit: mean absolute difference of the tiles' log noise from it.
    """

    kind: str
    amount: float
    misfit: float


@dataclass(frozen=True)
class FrameBudget:
    """What the sensor explains of a frame's noise; numbers are NaN where the estimator has no answer.

    Attributes:
        sigma_dn: estimated noise, median over the tiles that count.
        expected_dn: of the sensor at these settings, in the same tiles.
        ratio: median over the tiles of estimated by expected noise.
        ratio_low, ratio_high: ends of its interval, by those of the estimates.
        shares: source of `SOURCES` -> its fraction of the expected variance.
        tiles: how many count.
        verdict: ``agrees``; ``more`` or ``less`` noise than the sensor explains; ``undecided``, the estimate is far
            from what is expected, but its interval holds that; ``unknown``, they cannot be compared.
        reason: why it is unknown; else empty.
        explanations: of ``more`` and ``less``, those that fit about as well as the best, best first.
    """

    sigma_dn: float
    expected_dn: float
    ratio: float
    ratio_low: float
    ratio_high: float
    shares: Mapping[str, float]
    tiles: int
    verdict: str
    reason: str = ""
    explanations: tuple[Explanation, ...] = ()

    @property
    def dominant(self) -> str:
        """The source of most of the expected variance; empty where nothing is known."""
        return max(self.shares, key=lambda name: self.shares[name]) if self.shares else ""


def noise_budget(
    image: NDArray[np.floating],
    noise: NoiseState,
    camera: Camera,
    exposure_s: float,
    gain: float,
    pattern_fraction: float = 0.0,
    black_dn: float = 0.0,
) -> FrameBudget:
    """The noise budget of a frame.

    Args:
        image: (H, W) float in [0, 1], the frame that `noise` was estimated on, grey levels behind the tone curve.
        noise: of `pipeline.condition.ConditionMonitor.frame`.
        camera: sensor, temperature, converter and tone curve.
        exposure_s: exposure time, above 0 s.
        gain: ISO / base ISO, at least 1.
        pattern_fraction: standard deviation of what pixels differ by in every frame, as a fraction of the light: the
            photo response non-uniformity (PRNU) of EMVA 1288.
        black_dn: grey level of no light, 0 to below 255 DN, as of raw frames that it has not been subtracted from.

    Raises:
        InputError: settings out of range, or a frame that does not hold the tiles.
    """
    check_settings(exposure_s, gain)
    check_base_gain("gain", gain)
    if not 0.0 <= pattern_fraction < 1.0:
        raise InputError(f"pattern_fraction is a fraction of the light, 0 to below 1, got {pattern_fraction!r}")
    if not 0.0 <= black_dn < FULL_SCALE_DN:
        raise InputError(f"black_dn is a grey level of 0 to below {FULL_SCALE_DN:g} DN, got {black_dn!r}")
    picture = np.asarray(as_array(image), dtype=np.float32)
    if picture.ndim != 2 or any(
        patch.x_px + patch.size_px > picture.shape[1] or patch.y_px + patch.size_px > picture.shape[0]
        for patch in noise.patches
    ):
        raise InputError(f"noise budget: a frame of shape {picture.shape} does not hold the tiles of its noise")
    if np.isnan(noise.summary.value):
        return _unknown(f"noise has no estimate{_most_common(noise.estimate.reason)}")
    if noise.correlation > PROCESSED_CORRELATION:
        return _unknown(f"the camera has processed the noise (adjacent pixels correlate by {noise.correlation:.2f})")
    grey = picture * np.float32(FULL_SCALE_DN)
    is_8_bit = bool(np.allclose(grey, np.rint(grey), rtol=0.0, atol=1e-3))
    levels = level_variances(camera, exposure_s, gain, pattern_fraction, black_dn, is_8_bit=is_8_bit)
    # of a fixed pattern as strong as the light, behind the curve
    light = (np.maximum(_GREY - black_dn, 0.0) / camera.gamma) ** 2
    readable = unclipped(camera, exposure_s, gain, black_dn)
    means = tile_means(picture, noise.patches, np.vstack([levels, light]), readable)
    variance, pattern = means[:, :-1], means[:, -1]
    expected = np.sqrt(variance.sum(axis=1))
    counts = inliers(noise.estimate.sigma_dn / expected)
    if not counts.any():
        return _unknown("no tile has an estimate and a grey level at which noise is not clipped")
    expected, variance, pattern = expected[counts], variance[counts], pattern[counts]
    ends = (noise.estimate.sigma_dn, noise.estimate.low_dn, noise.estimate.high_dn)
    sigma, low, high = (np.asarray(end, dtype=np.float64)[counts] for end in ends)
    verdict = _verdict(sigma, low, high, variance)
    total = variance.sum(axis=0)
    return FrameBudget(
        sigma_dn=float(np.median(sigma)),
        expected_dn=float(np.median(expected)),
        ratio=float(np.median(sigma / expected)),
        ratio_low=float(np.median(low / expected)),
        ratio_high=float(np.median(high / expected)),
        shares={name: float(share) for name, share in zip(SOURCES, total / total.sum(), strict=True)},
        tiles=len(expected),
        verdict=verdict,
        explanations=explained(sigma, variance, pattern, verdict) if verdict in DEPARTURES else (),
    )


def _most_common(reasons: NDArray[np.object_]) -> str:
    """The reason of most abstentions, as the end of a sentence; empty without one."""
    counted = Counter(str(reason) for reason in reasons if reason)
    return f" (most tiles that abstain are {counted.most_common(1)[0][0]})" if counted else ""


def _verdict(sigma: Floats, low: Floats, high: Floats, variance: Floats) -> str:
    """``more`` noise than with all of the fixed pattern, ``less`` than without any, ``undecided``, or ``agrees``.

    A record of a sensor holds the grain of its target as fixed pattern, and cameras correct some of it.
    """
    most = np.sqrt(variance.sum(axis=1))
    if _is_far(np.median(sigma / most) - 1.0, most):
        return "more" if np.median(low / most) > 1.0 else "undecided"
    least = np.sqrt(np.delete(variance, SOURCES.index("pattern"), axis=1).sum(axis=1))
    if _is_far(1.0 - np.median(sigma / least), least):
        return "less" if np.median(high / least) < 1.0 else "undecided"
    return "agrees"


def _is_far(excess: float, expected: Floats) -> bool:
    """Whether a fraction of the expected noise is more than estimates may err by."""
    return bool(excess >= LEAST_RATIO and excess * np.median(expected) >= LEAST_DN)


def _unknown(reason: str) -> FrameBudget:
    nan = float("nan")
    return FrameBudget(nan, nan, nan, nan, nan, {}, 0, "unknown", reason)


def level_variances(
    camera: Camera,
    exposure_s: float,
    gain: float,
    pattern_fraction: float,
    black_dn: float = 0.0,
    *,
    is_8_bit: bool = True,
) -> Floats:
    """Variance of each source in `SOURCES` at the grey levels 0..255 behind the tone curve.

    Args:
        camera: see `noise_budget`.
        exposure_s: exposure time, s.
        gain: ISO / base ISO.
        pattern_fraction: see `noise_budget`.
        black_dn: see `noise_budget`.
        is_8_bit: whether the picture has whole grey levels.

    Returns:
        (5, 256) DN squared. Rounding is that of the converter, and of a picture of 8 bits that to these where the
        converter's steps are finer or a curve follows.
    """
    linear, span_dn = _light(camera, black_dn), FULL_SCALE_DN - black_dn
    budget = camera.budget(linear * FULL_SCALE_DN / (camera.sensor.dn_per_electron * gain), gain, exposure_s)
    pattern = pattern_fraction * FULL_SCALE_DN * linear
    parts = (budget.shot, budget.dark, budget.read, pattern, budget.rounding)
    before = np.stack([np.broadcast_to(np.asarray(part), linear.shape) ** 2 for part in parts])
    total = before.sum(axis=0)
    after = (span_dn * noise_after_curve(linear, np.sqrt(total) / FULL_SCALE_DN, camera.gamma)) ** 2
    variances = before / total * after
    if is_8_bit and (camera.adc_bits > 8 or camera.gamma != 1.0):
        variances[-1] += 1.0 / 12.0
    return variances


def unclipped(camera: Camera, exposure_s: float, gain: float, black_dn: float) -> NDArray[np.bool_]:
    """(256,) grey levels behind the tone curve whose expected noise black and white do not clip."""
    linear = _light(camera, black_dn)
    reach = _CLIPPED_SIGMAS * camera.linear_sigma_dn(linear, gain, exposure_s) / FULL_SCALE_DN
    return np.asarray((linear > reach) & (linear < 1.0 - reach))


def _light(camera: Camera, black_dn: float) -> Floats:
    """(256,) light, 0..1, of the grey levels 0..255 behind the tone curve."""
    return np.asarray(decode(np.maximum(_GREY - black_dn, 0.0) / (FULL_SCALE_DN - black_dn), camera.gamma))


def tile_means(
    picture: NDArray[np.float32], patches: Sequence[Patch], levels: Floats, readable: NDArray[np.bool_]
) -> Floats:
    """Means over the pixels of each tile of what depends on their grey level without noise, a mean over 9 x 9 px.

    Args:
        picture: (H, W) in [0, 1].
        patches: N tiles of it.
        levels: (K, 256) quantities by grey level, as of `level_variances`.
        readable: (256,) of `unclipped`.

    Returns:
        (N, K); NaN for a tile of which half of the pixels or more are not readable.
    """
    import cv2

    grey = cv2.blur(picture, (SMOOTHING_PX, SMOOTHING_PX)) * np.float32(FULL_SCALE_DN)
    result = np.full((len(patches), len(levels)), np.nan)
    for row, patch in zip(result, patches, strict=True):
        tile = grey[patch.y_px : patch.y_px + patch.size_px, patch.x_px : patch.x_px + patch.size_px]
        if readable[np.rint(tile).astype(np.intp)].mean() > _LEAST_READABLE:
            row[:] = [np.interp(tile, _GREY, source).mean() for source in levels]
    return result


def explained(sigma_dn: Floats, variances: Floats, pattern: Floats, verdict: str) -> tuple[Explanation, ...]:
    """Single changes of the model that explain the noise of tiles, best first.

    Args:
        sigma_dn: (N,) estimated noise, DN.
        variances: (N, 5) expected, in the tiles.
        pattern: (N,) variance of fixed pattern that is as strong as the light, DN squared.
        verdict: ``more``; or ``less``, which counts without fixed pattern and is not explained by noise that was added.

    Returns:
        those whose misfit, the mean absolute difference of log sigma, is at most 1.5 times the least, and .01; not
        those at the end of the range tried, as of a picture that was denoised.
    """
    photon, dark, readout, expected_pattern, rounding = variances.T
    constant, rest = dark + readout, rounding + (expected_pattern if verdict == "more" else 0.0)
    models: dict[str, tuple[Floats, Callable[[Floats], Floats]]] = {
        "gain": (_FACTORS, lambda x: x * photon + x**2 * constant + rest),
        "dark or readout": (_FACTORS, lambda x: photon + x**2 * constant + rest),
    }
    if verdict == "more":
        models["pattern"] = (_PATTERNS, lambda x: photon + constant + rounding + x**2 * pattern)
        models["added"] = (_ADDED_DN, lambda x: photon + constant + rest + x**2)
    fits: list[tuple[Explanation, bool]] = []
    for kind, (amounts, model) in models.items():
        differences = 0.5 * np.log(model(amounts[:, None])) - np.log(np.maximum(sigma_dn, _LEAST_SIGMA_DN))
        misfits = np.abs(differences).mean(axis=1)
        best = int(np.argmin(misfits))
        is_inside = 0 < best < len(amounts) - 1
        fits.append((Explanation(kind, float(amounts[best]), float(misfits[best])), is_inside))
    fits.sort(key=lambda fit: fit[0].misfit)
    times, beside = _FITS_AS_WELL
    most = times * fits[0][0].misfit + beside
    return tuple(item for item, is_inside in fits if is_inside and item.misfit <= most)
