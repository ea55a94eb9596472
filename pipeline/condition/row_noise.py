"""Row and column noise: offsets that whole rows or columns of a frame have in common, in DN.

CMOS cameras read a row at once, and columns through circuits of their own, so that noise of the reading shifts all
pixels of a row or of a column alike (EMVA 1288 release 4.0 splits the spatial variance into rows, columns and pixels).
Estimators of noise that compare neighbouring pixels in flat cells take such lines for structure.

A frame is divided into `STRIPS` vertical strips. In each, the difference of every row to the row above it is averaged
robustly over up to 72 columns (the mean of up to eight medians of nine): objects that cover less than half of the strip
hardly count. The differences of these differences are the strip's profile, a second difference along the column; for
independent row offsets of standard deviation s its variance is 6 s^2, and low frequencies (shading, the flicker of
lamps under a rolling shutter) hardly enter it. Scene and pixel noise differ between strips that do not touch, row
offsets do not, so that s^2 is a sixth of the covariance c of such strips. It is estimated in four ways, each by the
median over the pairs of strips:

    over rows       c = (m(x + y)^2 - m(x - y)^2) / 4, with m = 1.4826 median |.| (Gnanadesikan and Kettenring,
                    Biometrics 28, 1972): edges in less than half of the rows, those of a codec's blocks among them,
                    hardly count
    over rows, by differences between every second row
                    likewise: what alternates from row to row, as raw colour mosaics and interlaced fields do, does not
                    count
    over frequencies from 0.20 to 0.35, and over those from 0.35 to 0.50 of the sampling rate
                    c = 6 median(Re(X Y*) / (2 - 2 cos 2 pi f)^2) / ln 2, X and Y being spectra of unit mean power
                    for unit variance: the power of independent offsets, divided by the response of the second
                    difference, is the same at all frequencies, that of blinds and fences lies in few

The least of the four counts: only what is in most rows, most strips and most frequencies is row noise. It also must be
a fifth of a strip's variance, in under 225 rows more, so that row noise under a fourteenth of white noise does not
show. Rows near which a quarter of the pixels are clipped are left out. Columns are measured likewise, on the transposed
frame. Offsets that neighbouring rows share are underestimated. A frame filled by slats exactly along its rows, of
widths that vary, is taken for one with row noise.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from pipeline.condition.structure import MAD_TO_SIGMA

STRIPS = 6
GROUP = 9  # columns whose median is taken
MOST_GROUPS = 8  # in a strip
LEAST_ROWS = 64
DARKEST_DN, BRIGHTEST_DN = 2, 253  # beyond which a pixel is clipped, and offsets do not show
MOST_CLIPPED = 0.25  # of the pixels of a strip's rows
AROUND_ROWS = 17  # that a row's clipped pixels are counted in, so that rows are left out in few blocks
LEAST_UNCLIPPED = 0.7  # of a strip's rows
GAP = 2  # between the numbers of strips that are compared: they do not touch
BANDS = ((0.2, 0.35), (0.35, 0.51))  # of the sampling rate; Nyquist, at 0.5, is within
LEAST_COMMON = 0.2  # of a strip's variance; a smaller share may be of the scene, or chance in strong noise
CHANCE = 3.0  # standard deviations of a correlation of independent profiles, for frames of few rows
BAND_FACTOR = 1.25
"""For the covariances over frequencies: they scatter more than that over rows, and the least of them is too low."""
CLIP = 3.0  # standard deviations that a profile is clipped to before its spectrum
NETWORK = (
    (0, 1), (3, 4), (6, 7), (1, 2), (4, 5), (7, 8), (0, 1), (3, 4), (6, 7), (0, 3), (5, 8), (4, 7), (3, 6), (1, 4),
    (2, 5), (4, 7), (4, 2), (6, 4), (4, 2),
)  # fmt: skip
"""Comparisons that bring the median of nine to the middle (Smith, XCELL 23, 1996)."""


def row_noise_dn(levels: NDArray[np.uint8]) -> float:
    """Standard deviation of the offsets of rows.

    Args:
        levels: (H, W) grey levels, 0..255.

    Returns:
        DN; 0 where the strips have too little in common. NaN where it cannot be measured: fewer than `LEAST_ROWS` rows,
        or `STRIPS` strips of `GROUP` columns, that are not clipped.
    """
    profiles, unclipped = _profiles(levels)
    rows = np.count_nonzero(unclipped, axis=0) > len(unclipped) / 2  # not bars above and below the picture
    neighbours = rows[:-2] & rows[1:-1] & rows[2:]
    if np.count_nonzero(neighbours) < LEAST_ROWS - 4:
        return float("nan")
    strips = np.flatnonzero(unclipped[:, rows].mean(axis=1) >= LEAST_UNCLIPPED).tolist()
    pairs = [pair for pair in combinations(strips, 2) if pair[1] - pair[0] >= GAP]
    if not pairs:
        return float("nan")
    first, second = profiles[[pair[0] for pair in pairs]], profiles[[pair[1] for pair in pairs]]
    over_frequencies = (BAND_FACTOR * covariance for covariance in _over_frequencies(first, second, rows))
    over_second_rows = _over_rows(_every_second(first)[:, neighbours], _every_second(second)[:, neighbours])
    common = min(_over_rows(first[:, rows], second[:, rows]), over_second_rows, *over_frequencies)
    variance = float(np.median(_deviation(profiles[strips][:, rows]) ** 2))
    least = max(LEAST_COMMON, CHANCE / np.sqrt(np.count_nonzero(rows))) * variance
    return float(np.sqrt(common / 6)) if common > max(0.0, least) else 0.0


def column_noise_dn(levels: NDArray[np.uint8]) -> float:
    """Standard deviation of the offsets of columns; see `row_noise_dn`."""
    return row_noise_dn(levels.T)


def _profiles(levels: NDArray[np.uint8]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Second differences (strips, H - 2) of the rows of each strip, DN, and which are of rows that are hardly clipped.

    None (0, 0) where the frame is too small.
    """
    height, width = levels.shape
    side = width // STRIPS
    groups = min(MOST_GROUPS, side // GROUP)
    if not groups or height < LEAST_ROWS:
        return np.empty((0, 0)), np.empty((0, 0), np.bool_)
    groups -= groups > 1 and groups % 2  # so that a group's columns are of one phase of a raw colour mosaic
    count = GROUP * groups
    step = side // count
    columns = np.empty((STRIPS, count, height), np.uint8)
    for strip, pixels in enumerate(columns):
        start = strip * side + (side - (count - 1) * step - 1) // 2
        pixels[:] = levels[:, start : start + (count - 1) * step + 1 : step].T
    whole = columns.astype(np.int16)
    differences = (whole[:, :, 1:] - whole[:, :, :-1]).reshape(STRIPS, GROUP, groups, height - 1)
    # a group's columns lie apart, so that an object covers as much of one as of the others
    profiles = np.diff(_median_of_nine(differences.swapaxes(0, 1)).mean(axis=1), axis=1)
    clipped = np.count_nonzero((columns < DARKEST_DN) | (columns > BRIGHTEST_DN), axis=1) / count
    around = uniform_filter1d(clipped, AROUND_ROWS, axis=1, mode="nearest")
    return profiles, (around <= MOST_CLIPPED)[:, 1:-1]


def _median_of_nine(values: NDArray[np.int16]) -> NDArray[np.int16]:
    """The median over the first axis, of nine."""
    sorting = list(values)
    for low, high in NETWORK:
        sorting[low], sorting[high] = np.minimum(sorting[low], sorting[high]), np.maximum(sorting[low], sorting[high])
    return sorting[GROUP // 2]


def _deviation(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Standard deviation over the last axis, of values about 0, by the median of their magnitudes."""
    return np.asarray(MAD_TO_SIGMA * np.median(np.abs(values), axis=-1))


def _every_second(profiles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Second differences between every second row (pairs, rows - 2), by those (pairs, rows) between all rows."""
    return profiles[:, :-2] + 2 * profiles[:, 1:-1] + profiles[:, 2:]


def _over_rows(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    """Median, over pairs of profiles (pairs, rows), of their covariance over the rows, DN^2."""
    return float(np.median(_deviation(first + second) ** 2 - _deviation(first - second) ** 2) / 4)


def _over_frequencies(
    first: NDArray[np.float64], second: NDArray[np.float64], counted: NDArray[np.bool_]
) -> list[float]:
    """Median, over pairs of profiles (pairs, rows), of their covariance by their spectra, DN^2: one of each band.

    Rows (rows,) that are not counted are set to 0 where they are: what alternates from row to row keeps its phase.
    """
    window = np.hanning(len(counted)) * counted  # a line of the spectrum stays narrow
    spectra = []
    for profiles in (first, second):
        limit = CLIP * _deviation(profiles[:, counted])[:, None]
        spectra.append(np.fft.rfft(np.clip(profiles, -limit, limit) * window, axis=1))
    frequency = np.fft.rfftfreq(len(counted))
    power = (spectra[0] * spectra[1].conj()).real / np.sum(window**2)
    # profiles of independent offsets of variance 1 have a mean power of 6, this response's mean over all frequencies
    power *= 6 / np.maximum((2 - 2 * np.cos(2 * np.pi * frequency)) ** 2, 1e-9)
    bands = [(low <= frequency) & (frequency < high) for low, high in BANDS]
    # the power of noise is distributed exponentially, with a median of ln 2 of its mean
    return [float(np.median(np.median(power[:, band], axis=1)) / np.log(2)) for band in bands]
