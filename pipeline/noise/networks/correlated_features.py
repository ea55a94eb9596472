"""Statistics of a patch from which noise is estimated that is correlated between pixels.

Windows of 4 x 4 pixels, neighbours 1, 2, 3, 4 or 6 pixels apart, are sorted by their variance. In the flattest ones the
picture holds little but noise, and the eigenvalues of the windows' covariance describe it: all alike where noise is
white (Chen et al. 2015), spread where it is correlated. Wider spacing sees noise as if it were whiter.

    per spacing (5) and fraction of the flattest windows (10, 30, 60, 100 %): six eigenvalues, log of the square root
    spacing 1, per fraction: correlation at six lags
    per band of brightness (5): noise of its flattest tenth of windows relative to the patch's, and how common it is
    compression: step over the 8 x 8 px grid and vanished DCT coefficients
    fractions of black and of white pixels
    quantised transform blocks of 4 and 8 px: excess and fraction of vanished coefficients (`block_quantisation`)

A saturated pixel has lost its noise, so windows with more than one are left out while enough others remain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

from pipeline.noise.base import WHITE_DN
from pipeline.noise.block_quantisation import block_quantisation

Float = NDArray[np.float32]
Grey = NDArray[np.uint8]

SIDE = 4
SPACINGS_PX = (1, 2, 3, 4, 6)
STEPS_PX = (2, 2, 3, 3, 3)  # between windows, per spacing
FLATTEST = (0.1, 0.3, 0.6, 1.0)
RANKS = (0, 1, 3, 6, 10, 14)  # of the 15 eigenvalues beside the mean's
LAGS = ((0, 1), (1, 0), (1, 1), (0, 2), (2, 0), (2, 2))
BANDS = 5
LEAST_WINDOWS = 200
_AVERAGE = np.full(SIDE**2, 1 / SIDE**2, np.float32)
_SUM = np.ones(SIDE**2, np.float32)
_EVERY_BYTE = np.uint64(0x0101010101010101)
LEAST_PX = 48
CELL_PX = 8
LARGEST_STEP_DN = 12
POWER_FLOOR_DN2 = 0.02

COUNT = len(SPACINGS_PX) * len(FLATTEST) * len(RANKS) + len(FLATTEST) * len(LAGS) + 2 * BANDS + 9 + 2 + 4
REFERENCE = (SPACINGS_PX.index(2) * len(FLATTEST) + 2) * len(RANKS) + 1
"""Index of the statistic that answers are relative to: the second-least eigenvalue, spacing 2, flattest 60 %."""
LAG_START = len(SPACINGS_PX) * len(FLATTEST) * len(RANKS)
GRID_START = COUNT - 15
QUANTISED_START = COUNT - 4


@dataclass(frozen=True)
class Windows:
    """Windows of a patch.

    Attributes:
        values: (n, 16) grey levels about each window's mean, DN.
        means: (n,) DN.
        power: (n,) sum of the squared values, DN squared.
        complete: whether none was left out for saturated pixels.
    """

    values: Float
    means: Float
    power: Float
    complete: bool


class FlatAreas(NamedTuple):
    """The flattest windows of a patch.

    Attributes:
        deviation_dn: of their pixels about each window's mean, in the flattest tenth of windows, DN.
        adjacent: correlation of pixels next to each other there, mean over rows and columns, -1 to 1; 0.3 to 0.8 behind
            a camera's processing.
        diagonal: that of pixels that touch at a corner, in the flattest three tenths: of fewer it is less certain.
    """

    deviation_dn: float
    adjacent: float
    diagonal: float


@dataclass(frozen=True)
class Moments:
    """What `statistics_of` needs of a patch.

    Attributes:
        covariances: (spacings, fractions, 16, 16) of its flattest windows, DN squared.
        others: (COUNT - LAG_STOP,) the statistics that do not depend on them.
    """

    covariances: NDArray[np.float64]
    others: NDArray[np.float64]


def statistics(patch_dn: Float) -> Float:
    """All statistics of a patch.

    Args:
        patch_dn: (H, W) whole grey levels 0..255, sides of at least 48 px.

    Returns:
        (COUNT,) float32.
    """
    return statistics_of([moments(patch_dn)])[0]


def moments(patch_dn: Float | Grey, fine: Windows | None = None) -> Moments:
    """What is measured of each patch; many are turned into statistics at once.

    Args:
        patch_dn: (H, W) whole grey levels 0..255, sides of at least 48 px.
        fine: its windows of adjacent pixels where they are known already, see `fine_windows`.
    """
    picture = np.ascontiguousarray(patch_dn, dtype=np.uint8)
    saturated = _is_saturated(picture)
    products = np.empty((len(SPACINGS_PX), len(FLATTEST), SIDE**2, SIDE**2), np.float32)
    ends = np.empty((len(SPACINGS_PX), len(FLATTEST)), int)
    bands: NDArray[np.float64] | None = None
    for index, (spacing, step) in enumerate(zip(SPACINGS_PX, STEPS_PX, strict=True)):
        windows = fine if spacing == 1 and fine is not None else _windows(picture, spacing, step, saturated)
        count, begin = len(windows.values), 0
        ends[index] = [max(int(fraction * count), 1) for fraction in FLATTEST]
        # Numbers that are not negative have the order of their bits, which are compared faster.
        order = np.argpartition(windows.power.view(np.int32), ends[index, :-1] - 1)
        values = windows.values.take(order, axis=0)
        for number, end in enumerate(ends[index]):
            part = values[begin:end]
            np.matmul(part.T, part, out=products[index, number])
            begin = end
        if spacing == 2:
            bands = _bands(windows.power / np.float32(SIDE**2), windows.means)
    assert bands is not None
    covariances = products.astype(np.float64).cumsum(axis=1)
    covariances /= ends[:, :, None, None]
    clipped = [np.count_nonzero(picture <= 1) / picture.size, np.count_nonzero(picture >= WHITE_DN - 1) / picture.size]
    others = [*bands, *compression(picture), *clipped, *block_quantisation(picture).numbers]
    return Moments(covariances, np.array(others))


def statistics_of(patches: Sequence[Moments]) -> Float:
    """All statistics of patches: (N, COUNT)."""
    if not patches:
        return np.empty((0, COUNT), np.float32)
    covariances = np.stack([patch.covariances for patch in patches])
    values = np.maximum(np.linalg.eigvalsh(covariances)[..., 1:], 0)[..., RANKS]  # the mean has no variance
    deviations = 0.5 * np.log(values + POWER_FLOOR_DN2).reshape(len(patches), -1)
    lags = _lags(covariances[:, 0].reshape(-1, SIDE**2, SIDE**2), len(LAGS)).reshape(len(patches), -1)
    others = np.stack([patch.others for patch in patches])
    return np.concatenate([deviations, lags, others], axis=1, dtype=np.float32, casting="same_kind")


def fine_windows(patch_dn: Float | Grey) -> Windows:
    """Windows of adjacent pixels, for `flat_areas`, `principal_noise_dn` and `moments` of the same patch."""
    picture = np.ascontiguousarray(patch_dn, dtype=np.uint8)
    return _windows(picture, SPACINGS_PX[0], STEPS_PX[0], _is_saturated(picture))


def flat_areas(patch_dn: Float | Grey, fine: Windows | None = None) -> FlatAreas:
    """How pixels vary in flat windows of a patch. White noise has correlations of -1/15, for the mean is taken off.

    Texture and edges that no flat area is free of raise them, that of adjacent pixels most.

    Args:
        patch_dn: (H, W) whole grey levels 0..255.
        fine: its windows of adjacent pixels where they are known already, see `fine_windows`.
    """
    windows = fine_windows(patch_dn) if fine is None else fine
    few, more = (max(int(fraction * len(windows.values)), 1) for fraction in FLATTEST[:2])
    flattest = np.argpartition(windows.power, more)[:more]  # with two ranks at once it takes five times as long
    flattest = flattest[np.argpartition(windows.power[flattest], few)]
    flat = windows.values.take(flattest, axis=0)
    products = flat[:few].T @ flat[:few]
    adjacent, _, power = products.ravel() / few @ _adjacent_diagonal_power()
    products += flat[few:].T @ flat[few:]
    _, diagonal, wider_power = products.ravel() / more @ _adjacent_diagonal_power()
    floor = POWER_FLOOR_DN2
    return FlatAreas(float(np.sqrt(power)), adjacent / (power + floor), diagonal / (wider_power + floor))


@lru_cache(maxsize=1)
def _adjacent_diagonal_power() -> NDArray[np.float64]:
    """(256, 3): turns windows' covariance into the mean of adjacent pixels, that of diagonal ones, and the power."""
    weights = np.zeros((SIDE**2, SIDE**2, 3))
    (*adjacent, diagonal), itself = _lag_pairs()[:3], np.arange(SIDE**2)
    for column, pairs in enumerate((adjacent, [diagonal], [(itself, itself)])):
        for first, second in pairs:
            weights[first, second, column] = 1 / (len(first) * len(pairs))
    return weights.reshape(-1, 3)


def principal_noise_dn(patch_dn: Float | Grey, fine: Windows | None = None) -> float:
    """White noise of a patch by principal components: the root of the least eigenvalue of all windows' covariance, DN.

    It is the root mean square over the patch, however the noise goes with brightness and also where it is clipped.
    Texture adds to it where it has all spatial frequencies; of correlated noise it is a part (Pyatykh et al. 2013).

    Args:
        patch_dn: (H, W) whole grey levels 0..255.
        fine: its windows of adjacent pixels where they are known already, see `fine_windows`.
    """
    if fine is not None and fine.complete:
        values = fine.values
    else:
        picture = np.ascontiguousarray(patch_dn, dtype=np.uint8)
        values, _ = _about_mean(_pixels(picture, SPACINGS_PX[0], STEPS_PX[0]))
    covariance = (values.T @ values / len(values)).astype(np.float64)
    return float(np.sqrt(max(np.linalg.eigvalsh(covariance)[1], 0.0)))  # the mean, first, has no variance


def anisotropy(statistics: Float) -> Float:
    """How much more grain is correlated along rows than along columns.

    Args:
        statistics: (N, COUNT).

    Returns:
        (N,) difference of the lag-1 correlations of the flattest 30 % of windows, -2 to 2.
    """
    first = LAG_START + FLATTEST.index(0.3) * len(LAGS)
    return statistics[:, first + LAGS.index((0, 1))] - statistics[:, first + LAGS.index((1, 0))]


def _is_saturated(picture: Grey) -> bool:
    return bool(picture.min() <= 1 or picture.max() >= WHITE_DN - 1)


def _windows(picture: Grey, spacing: int, step: int, saturated: bool) -> Windows:
    """Windows of a picture; those with more than one saturated pixel are left out if `saturated`."""
    pixels, complete = _pixels(picture, spacing, step), True
    if saturated:
        black_or_white = ((pixels <= 1) | (pixels >= WHITE_DN - 1)).view(np.uint64)
        halves = (black_or_white * _EVERY_BYTE) >> np.uint64(56)  # how many bytes are 1, in the uppermost
        kept = halves[:, 0] + halves[:, 1] <= 1
        if LEAST_WINDOWS < np.count_nonzero(kept) < len(kept):
            pixels, complete = pixels.take(np.flatnonzero(kept), axis=0), False
    values, means = _about_mean(pixels)
    return Windows(values, means, np.square(values) @ _SUM, complete)


def _about_mean(pixels: Grey) -> tuple[Float, Float]:
    """Grey levels of windows about each one's mean, (n, 16), and the means, (n,), DN."""
    values = pixels.astype(np.float32)
    means = values @ _AVERAGE
    values -= means[:, None]
    return values, means


def _pixels(picture: Grey, spacing: int, step: int) -> Grey:
    """The pixels of windows as rows, (n, 16); the four of a window's line are copied at once, as one number."""
    if spacing % step == 0:  # they lie closer together in the picture of every step-th pixel
        picture, spacing, step = np.ascontiguousarray(picture[::step, ::step]), spacing // step, 1
    down, right = ((side - (SIDE - 1) * spacing - 1) // step + 1 for side in picture.shape)
    if spacing == 1:
        lines, pitch, apart = picture, picture.shape[1], step
    else:
        lines, apart = np.empty((len(picture), right, SIDE), np.uint8), SIDE
        for number in range(SIDE):
            lines[:, :, number] = picture[:, number * spacing :][:, : (right - 1) * step + 1 : step]
        pitch = right * SIDE
    fours = np.ndarray((down, right, SIDE), np.uint32, lines, 0, (pitch * step, apart, pitch * spacing))
    return np.ascontiguousarray(fours).view(np.uint8).reshape(-1, SIDE**2)


@lru_cache(maxsize=1)
def _lag_pairs() -> tuple[tuple[NDArray[Any], NDArray[Any]], ...]:
    """For each lag: the indices of the window's pixels that are that far apart."""
    position = np.arange(SIDE**2).reshape(SIDE, SIDE)
    pairs = []
    for down, right in LAGS:
        first = position[: SIDE - down, : SIDE - right]
        pairs.append((first.ravel(), position[down:, right:].ravel()))
    return tuple(pairs)


def _lags(covariances: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Correlations at the first lags, per covariance (M, 16, 16): (M, count).

    The mean of 16 correlated pixels was taken off each window, which lowers all correlations alike; the network knows
    such windows only.
    """
    power = np.trace(covariances, axis1=1, axis2=2) / SIDE**2 + POWER_FLOOR_DN2
    columns = [covariances[:, first, second].mean(axis=1) / power for first, second in _lag_pairs()[:count]]
    return np.stack(columns, axis=1)


def _bands(variance: Float, means: Float) -> NDArray[np.float64]:
    """Noise by brightness: log of the relative deviation of the flattest tenth, and the share of windows, per band."""
    overall = _flattest_tenth(variance)
    band = np.minimum((means * (BANDS / (WHITE_DN + 1))).astype(np.uint8), BANDS - 1)
    ratios, shares = np.zeros(BANDS), np.zeros(BANDS)
    for number, count in enumerate(np.bincount(band, minlength=BANDS).tolist()):
        shares[number] = count / len(variance)
        if LEAST_WINDOWS // 4 <= count < len(variance):
            inside = variance[band == number]
            ratios[number] = 0.5 * np.log((_flattest_tenth(inside) + POWER_FLOOR_DN2) / (overall + POWER_FLOOR_DN2))
    return np.concatenate([ratios, shares])


def _flattest_tenth(variance: Float) -> float:
    """Mean of the least tenth of numbers (n,)."""
    count = max(len(variance) // 10, 1)
    return float(np.partition(variance, count - 1)[:count].mean())


@lru_cache(maxsize=1)
def _dct_matrix() -> Float:
    """(8, 8): the orthonormal discrete cosine transform of eight pixels."""
    return np.asarray(dct(np.eye(CELL_PX), axis=0, norm="ortho"), dtype=np.float32)


@lru_cache(maxsize=1)
def _frequencies() -> tuple[NDArray[np.intp], ...]:
    """Indices of the DCT coefficients of a block in three ranges of frequency."""
    order = np.add.outer(np.arange(CELL_PX), np.arange(CELL_PX)).ravel()
    return tuple(np.flatnonzero((order >= low) & (order <= high)) for low, high in ((2, 4), (5, 8), (9, 14)))


def compression(patch_dn: Float | Grey) -> NDArray[np.float64]:
    """Traces of block coding.

    Args:
        patch_dn: (H, W) whole grey levels 0..255, at least 24 px each.

    Returns:
        (9,): per direction (columns, then rows) the log of the mean step over the strongest grid line relative to the
        median line, the same of the second-strongest, and how many fewer steps vanish there; then the fraction of DCT
        coefficients below 1 DN in three ranges of frequency, blocks aligned to that grid.
    """
    picture = np.ascontiguousarray(patch_dn, dtype=np.uint8)
    numbers, starts = [], []
    for axis in (1, 0):
        steps = cv2.absdiff(picture[:, 1:], picture[:, :-1]) if axis == 1 else cv2.absdiff(picture[1:], picture[:-1])
        size = picture.size / picture.shape[axis] * (steps.shape[axis] // CELL_PX)
        mean, equal = (
            _by_phase(values, axis) / size
            for values in (np.minimum(steps, LARGEST_STEP_DN), (steps == 0).view(np.uint8))
        )
        mean = mean + 0.02
        ranked, equals = np.sort(mean), np.sort(equal)
        strongest = int(mean.argmax())
        starts.append((strongest + 1) % CELL_PX)
        numbers += [np.log(ranked[-1] / ranked[3]), np.log(ranked[-2] / ranked[3]), equals[3] - equal[strongest]]
    left, top = starts
    rows, columns = ((side - start) // CELL_PX for side, start in zip(picture.shape, (top, left), strict=True))
    blocks = picture[top : top + rows * CELL_PX, left : left + columns * CELL_PX].astype(np.float32)
    matrix = _dct_matrix()
    coefficients = matrix @ blocks.reshape(rows, CELL_PX, columns * CELL_PX)
    coefficients = coefficients.reshape(rows, CELL_PX, columns, CELL_PX).transpose(0, 2, 1, 3) @ matrix.T
    small = (np.abs(coefficients, out=coefficients) < 1).view(np.uint8).reshape(rows, -1)
    count = np.add.reduce(small, axis=0, dtype=np.uint16).reshape(columns, -1).sum(axis=0)
    vanished = count / (rows * columns)
    numbers += [vanished[indices].mean() for indices in _frequencies()]
    return np.array(numbers)


def _by_phase(steps: Grey, axis: int) -> Float:
    """Sums (8,) of steps along an axis, by their position modulo 8 px."""
    sums = cv2.reduce(steps, 1 - axis, cv2.REDUCE_SUM, dtype=cv2.CV_32S).ravel()
    return sums[: len(sums) // CELL_PX * CELL_PX].reshape(-1, CELL_PX).sum(axis=0).astype(np.float32)
