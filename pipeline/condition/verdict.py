"""Words for a condition: how blurred, in which direction, how noisy, and the probable cause.

Blur is graded by the MTF50, the frequency of half contrast, of the worse axis, as a fraction of Nyquist:

| MTF50 | grade | comparable to linear motion of |
|---|---|---|
| from 0.35 | sharp | up to 3 px |
| 0.22 .. 0.35 | slightly blurred | 3 to 5 px |
| 0.11 .. 0.22 | moderately blurred | 5 to 11 px |
| below 0.11 | strongly blurred | more than 11 px |

The ends of the MTF's 95 % interval are graded alike. Where they are two grades apart or more, as on noisy photographs
of cameras, the grade is uncertain, and so stated (*strongly blurred (uncertain: sharp to strongly blurred)*); a cause
is not named then. So it is with noise (`noise_ends`), which texture may hide.

Noise by its standard deviation: very low below 1 DN, low below 4, moderate below 10, high below 20, else very high.

Blur has a direction where the mean MTF of one axis is below the other's by more than a fifth. That is what motion (or
a shaking mount) does; defocus, water on the lens and motion along a diagonal reduce both axes alike, and two axes do
not distinguish them. Where both are strongly blurred no direction is told: little contrast is left to compare. Nor is
one where less than 70 % of the blurred patches have it themselves (`directed`): medians over sharp and blurred patches
of a frame may differ between axes though no patch does. From half of them on the cause is open, too.

Patches may differ: a drop on the lens or an object in motion blurs a part. A patch is surely blurred where its MTF
grades it as moderately blurred and the upper end of its interval is nearer to that than to sharp (`blurred_fraction`);
with a fifth of such patches a frame is partly blurred (`is_partly_blurred`).

``benchmarks/blur_words.py`` counts how often these words are right and wrong.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, isfinite

import numpy as np
from numpy.typing import NDArray

from pipeline.condition.summary import half_contrast

SHARP = "sharp"
BLUR_GRADES = ((0.11, "strongly blurred"), (0.22, "moderately blurred"), (0.35, "slightly blurred"))
BAD_BLUR = ("moderately blurred", "strongly blurred")
SURELY_BLURRED_MTF50 = 0.28
"""Of the upper end of a patch's interval, below which it is surely blurred: nearer to moderate blur than to none."""
LEAST_BLURRED_FRACTION = 0.2
"""Of a frame's patches, from which it is stated that a part is blurred."""

UNCERTAIN_GRADES = 2
"""So many grades between the ends of an interval make the grade uncertain."""
NOISE_GRADES = ((1.0, "very low"), (4.0, "low"), (10.0, "moderate"), (20.0, "high"))
HIGHEST_NOISE = "very high"
PROCESSED_CORRELATION = 0.25
"""Correlation of the noise of adjacent pixels from which a camera or program has processed it. The 8 photographs of CC
and 10 of PolyU read 0.45 to 0.67, 6 frames of KITTI and Udacity with 2 to 10 DN of white noise 0.09 at most."""
DIRECTED_RATIO = 0.8  # of the mean MTF of the lower axis to the other's
DIRECTED_SHARE = 0.7  # of the blurred patches, from which the frame has their direction
PERHAPS_DIRECTED_SHARE = 0.5  # from which they may have one
HIGH_NOISE_DN = 10.0
MUCH_MORE = 1.5
DIM_MEDIAN_DN = 48.0
AXES = ("horizontal", "vertical")
REASONS = {
    "compressed": "a codec may have removed it",
    "uncertain": "it may be grain of the scene, or noise that a filter, scaling or rotation changed",
    "beyond": "it is stronger than estimators know, above 60 DN: a broken camera or signal, or a printed pattern",
    "alternating": "it alternates from pixel to pixel, as a raw colour mosaic does; demosaic it first",
    "streaked": "neighbouring pixels are equal too often, as behind a median filter",
    "saturated": "too bright or too dark",
    "flat": "no variation to measure",
    "structureless": "no structure, only shading and noise",
    "striped": "stripes or a straight edge, along which nothing tells blur",
    "contradicted": "edges are sharper than the blur that was read",
    "covered": "a part has one grey level: a border, or a picture of few levels",
    "incomplete": "some frequencies are unknown",
}
"""Why noise or blur is unknown, in words; other reasons are words already."""


@dataclass(frozen=True)
class Grades:
    """A condition in words; empty words where it is unknown.

    Attributes:
        blur: grade of blur.
        direction: ``horizontal``, ``vertical``, or empty where both axes are alike or the picture is sharp.
        blur_range: grades that the interval of the MTF reaches, where it is uncertain: ``sharp to strongly blurred``.
        noise: grade of noise.
        blur_cause, noise_cause: probable causes, or empty.
    """

    blur: str
    direction: str
    blur_range: str
    noise: str
    blur_cause: str
    noise_cause: str

    def words(self) -> list[str]:
        """Phrases for blur and noise; abstentions are stated."""
        return [
            blur_words(self.blur, self.direction, self.blur_range),
            f"noise {self.noise}" if self.noise else "noise unknown",
        ]

    def causes(self) -> list[str]:
        """Probable causes, blur first."""
        return [cause for cause in (self.blur_cause, self.noise_cause) if cause]


def blur_words(blur: str, direction: str, blur_range: str) -> str:
    """A phrase for blur; see `Grades`."""
    words = blur or "blur unknown"
    words += f", mainly {direction}" if direction else ""
    return words + (f" (uncertain: {blur_range})" if blur_range else "")


def bound_words(at_most_dn: float) -> str:
    """How much noise there is at most, rounded up: ``"at most 7 DN"``; empty where that is unknown (NaN)."""
    return f"at most {ceil(at_most_dn)} DN" if isfinite(at_most_dn) else ""


def noise_parts_words(sigma_dn: float, white_sigma_dn: float, correlation: float) -> str:
    """White part and correlation of noise in a sentence without its full stop, and what follows from them.

    Args:
        sigma_dn: estimate of all noise, DN.
        white_sigma_dn: its white part, DN.
        correlation: of the noise of adjacent pixels, -1 to 1.

    Returns:
        empty where a number is unknown (NaN), or noise is very low: there is too little of it to be taken apart.
    """
    (very_low_dn, _), *_ = NOISE_GRADES
    if not np.isfinite([sigma_dn, white_sigma_dn, correlation]).all() or sigma_dn < very_low_dn:
        return ""
    words = f"Noise of {sigma_dn:.1f} DN, of which {white_sigma_dn:.1f} DN white; neighbouring pixels correlate by "
    words += f"{round(correlation, 2) + 0.0:.2f}"  # no -0.00
    return words + (": the camera has processed its noise" if correlation > PROCESSED_CORRELATION else "")


def noise_ends(sigma_dn: float, low_dn: float, high_dn: float) -> tuple[float, float]:
    """Noise to be reckoned with, least and most, DN.

    Args:
        sigma_dn: estimate.
        low_dn: lower end of its 95 % interval; NaN where there is none.
        high_dn: upper end.

    Returns:
        the ends of the interval where they are as many grades apart as make a grade uncertain, else the estimate twice.
    """
    if not np.isfinite([sigma_dn, low_dn, high_dn]).all():
        return sigma_dn, sigma_dn
    least, most = (_reached(NOISE_GRADES, end) for end in (low_dn, high_dn))
    return (low_dn, high_dn) if most - least >= UNCERTAIN_GRADES else (sigma_dn, sigma_dn)


def may_be_much_more(sigma_dn: float, high_dn: float) -> bool:
    """Whether noise may be half as much again as estimated, or more; not where an end is unknown (NaN).

    Args:
        sigma_dn: estimate, DN.
        high_dn: upper end of its 95 % interval, DN.
    """
    return high_dn >= MUCH_MORE * sigma_dn


def blur_range(low: NDArray[np.floating], high: NDArray[np.floating]) -> str:
    """Grades of blur that the interval of an MTF reaches where it is uncertain, from the sharpest; else empty.

    Args:
        low: (2, 8) lower ends of the 95 % interval; NaN where there is none.
        high: upper ends.
    """
    if not np.isfinite([low, high]).all():
        return ""
    blurriest, sharpest = (_reached(BLUR_GRADES, _worse_mtf50(end)) for end in (low, high))
    names = [*(name for _, name in BLUR_GRADES), SHARP]
    return f"{names[sharpest]} to {names[blurriest]}" if sharpest - blurriest >= UNCERTAIN_GRADES else ""


def blurred_fraction(mtf: NDArray[np.floating], high: NDArray[np.floating] | None) -> float:
    """Share of the patches with an estimate that are surely at least moderately blurred.

    Args:
        mtf: (N, 2, 8) of patches; NaN where there is no estimate.
        high: (N, 2, 8) upper ends of the 95 % interval; None where the estimator has none.

    Returns:
        0..1; NaN without an estimate.
    """
    known = np.isfinite(mtf).all(axis=(1, 2))
    if not known.any():
        return float("nan")
    (_, _), (moderate, _), *_ = BLUR_GRADES
    blurred = half_contrast(mtf[known]).min(axis=-1) < moderate
    ends = mtf if high is None else high
    return float(np.mean(blurred & (half_contrast(ends[known]).min(axis=-1) < SURELY_BLURRED_MTF50)))


def is_partly_blurred(blur: str, fraction: float) -> bool:
    """Whether a part of a frame is blurred whose grade, that of the median patch, does not say so.

    Args:
        blur: grade of the frame.
        fraction: of its patches that are surely blurred (`blurred_fraction`); NaN where unknown.
    """
    return blur not in BAD_BLUR and fraction >= LEAST_BLURRED_FRACTION


def directed(mtf: NDArray[np.floating]) -> tuple[float, float]:
    """Shares of the blurred patches whose own MTF has a direction.

    Args:
        mtf: (N, 2, 8) of patches; NaN where there is no estimate.

    Returns:
        of patches blurred horizontally, and vertically; 0 where none is blurred.
    """
    curves = mtf[np.isfinite(mtf).all(axis=(1, 2))]
    curves = curves[half_contrast(curves).min(axis=-1) < BLUR_GRADES[-1][0]] if len(curves) else curves
    if not len(curves):
        return 0.0, 0.0
    horizontal, vertical = curves.mean(axis=2).T
    below, above = horizontal < DIRECTED_RATIO * vertical, vertical < DIRECTED_RATIO * horizontal
    return float(below.mean()), float(above.mean())


def grade(
    sigma_dn: float,
    mtf: NDArray[np.floating],
    median_dn: float = float("nan"),
    ends: tuple[NDArray[np.floating], NDArray[np.floating]] | None = None,
    shares: tuple[float, float] | None = None,
) -> Grades:
    """Grade a condition.

    Args:
        sigma_dn: noise, DN; NaN where unknown.
        mtf: (2, 8) MTF, horizontal and vertical; NaN where unknown.
        median_dn: median grey level, DN; NaN where unknown.
        ends: (2, 8) lower and upper ends of the MTF's 95 % interval; None or NaN where there is none.
        shares: of the blurred patches or frames behind the MTF that are blurred horizontally, and vertically (see
            `directed`); None where the MTF speaks for itself.
    """
    blur = direction = uncertain = blur_cause = noise_cause = ""
    curves = np.asarray(mtf, dtype=np.float64)
    if np.isfinite(curves).all():
        worse = _worse_mtf50(curves)
        blur = next((name for limit, name in BLUR_GRADES if worse < limit), SHARP)
        uncertain = blur_range(*ends) if ends is not None else ""
        means = curves.mean(axis=1)
        if blur != SHARP:
            strong = _reached(BLUR_GRADES, float(half_contrast(curves).max())) == 0
            axis = int(np.argmin(means))
            differ = means.min() < DIRECTED_RATIO * means.max() and not strong
            share = (1.0 if shares is None else shares[axis]) if differ else 0.0
            if share >= DIRECTED_SHARE:
                direction = AXES[axis]
            if not uncertain and (direction or share < PERHAPS_DIRECTED_SHARE):
                blur_cause = "probably motion" if direction else "defocus, water on the lens or diagonal motion"
    noise = ""
    if np.isfinite(sigma_dn):
        noise = next((name for limit, name in NOISE_GRADES if sigma_dn < limit), HIGHEST_NOISE)
        if sigma_dn >= HIGH_NOISE_DN:
            dim = np.isfinite(median_dn) and median_dn < DIM_MEDIAN_DN
            noise_cause = "little light" if dim else "probably high gain"
    return Grades(blur, direction, uncertain, noise, blur_cause, noise_cause)


def _worse_mtf50(mtf: NDArray[np.floating]) -> float:
    """MTF50 of the worse axis of an MTF (2, 8)."""
    return float(half_contrast(mtf).min())


def _reached(grades: tuple[tuple[float, str], ...], value: float) -> int:
    """How many limits of grades a value reaches."""
    return sum(value >= limit for limit, _ in grades)
