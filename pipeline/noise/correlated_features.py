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

from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.noise.base import WHITE_DN
from pipeline.noise.block_quantisation import block_quantisation

Float = NDArray[np.float32]

SIDE = 4
SPACINGS_PX = (1, 2, 3, 4, 6)
STEPS_PX = (2, 2, 3, 3, 3)  # between windows, per spacing
FLATTEST = (0.1, 0.3, 0.6, 1.0)
RANKS = (0, 1, 3, 6, 10, 14)  # of the 15 eigenvalues beside the mean's
LAGS = ((0, 1), (1, 0), (1, 1), (0, 2), (2, 0), (2, 2))
BANDS = 5
LEAST_WINDOWS = 200
_AVERAGE = np.full(SIDE**2, 1 / SIDE**2, np.float32)
LEAST_PX = 48
CELL_PX = 8
POWER_FLOOR_DN2 = 0.02

COUNT = len(SPACINGS_PX) * len(FLATTEST) * len(RANKS) + len(FLATTEST) * len(LAGS) + 2 * BANDS + 9 + 2 + 4
REFERENCE = (SPACINGS_PX.index(2) * len(FLATTEST) + 2) * len(RANKS) + 1
"""Index of the statistic that answers are relative to: the second-least eigenvalue, spacing 2, flattest 60 %."""
LAG_START = len(SPACINGS_PX) * len(FLATTEST) * len(RANKS)
GRID_START = COUNT - 15
QUANTISED_START = COUNT - 4


def statistics(patch_dn: Float) -> Float:
    """All statistics of a patch.

    Args:
        patch_dn: (H, W) whole grey levels 0..255, sides of at least 48 px.

    Returns:
        (COUNT,) float32.
    """
    picture = np.ascontiguousarray(patch_dn, dtype=np.float32)
    covariances = np.empty((len(SPACINGS_PX), len(FLATTEST), SIDE**2, SIDE**2))
    bands: NDArray[np.float64] | None = None
    for index, spacing in enumerate(SPACINGS_PX):
        windows, means = _windows(picture, spacing, STEPS_PX[index])
        variance = np.einsum("ij,ij->i", windows, windows)
        count = len(windows)
        ends = [max(int(fraction * count), 1) for fraction in FLATTEST]
        order = np.argpartition(variance, [end - 1 for end in ends[:-1]])
        total, begin = np.zeros((SIDE**2, SIDE**2)), 0
        for number, end in enumerate(ends):
            part = windows.take(order[begin:end], axis=0)
            total = total + part.T @ part
            covariances[index, number], begin = total / end, end
        if spacing == 2:
            bands = _bands(variance / SIDE**2, means)
    assert bands is not None
    values = np.maximum(np.linalg.eigvalsh(covariances)[..., 1:], 0)[..., RANKS]  # the mean has no variance
    parts = [0.5 * np.log(values + POWER_FLOOR_DN2).ravel(), _lags(covariances[0]), bands, compression(picture)]
    clipped = [(picture <= 1).mean(), (picture >= WHITE_DN - 1).mean()]
    return np.concatenate([*parts, clipped, block_quantisation(picture).numbers]).astype(np.float32)


def whiteness(patch_dn: Float) -> float:
    """Lag-1 correlation of the flattest tenth of a patch: 0 for white noise, 0.3 to 0.8 behind a camera's processing.

    Args:
        patch_dn: (H, W) whole grey levels 0..255.

    Returns:
        mean over both directions, -1 to 1; texture and edges that no flat area is free of raise it.
    """
    windows, _ = _windows(np.ascontiguousarray(patch_dn, dtype=np.float32), 1, STEPS_PX[0])
    variance = np.einsum("ij,ij->i", windows, windows)
    flat = windows[np.argpartition(variance, len(windows) // 10)[: max(len(windows) // 10, 1)]]
    return float(_lags((flat.T @ flat / len(flat))[None].astype(np.float64))[:2].mean())


def _windows(picture: Float, spacing: int, step: int) -> tuple[Float, Float]:
    """Windows as rows (n, 16) about their means, and the means (n,)."""
    if spacing == step:  # they lie side by side in the picture of every step-th pixel
        picture, spacing, step = np.ascontiguousarray(picture[::step, ::step]), 1, 1
    reach = (SIDE - 1) * spacing
    down, right = ((side - reach - 1) // step + 1 for side in picture.shape)
    if spacing == 1:  # the four pixels of a window's line are copied at once, as one number of 16 bytes
        line, pixel = picture.strides
        fours = np.ndarray((down, right, SIDE), np.complex128, picture, 0, (line * step, pixel * step, line))
        windows = np.ascontiguousarray(fours).view(np.float32).reshape(-1, SIDE**2)
    else:
        apart = np.empty((down, right, SIDE**2), np.float32)
        for number, pixels in enumerate(_shifted(picture, spacing, step, down, right)):
            apart[:, :, number] = pixels
        windows = apart.reshape(-1, SIDE**2)
    if picture.min() <= 1 or picture.max() >= WHITE_DN - 1:
        saturated = ((picture <= 1) | (picture >= WHITE_DN - 1)).view(np.uint8)
        count = sum(_shifted(saturated, spacing, step, down, right), np.zeros((down, right), np.uint8))
        kept = (count <= 1).ravel()
        if kept.sum() > LEAST_WINDOWS:
            windows = windows[kept]
    means = windows @ _AVERAGE
    windows -= means[:, None]
    return windows, means


def _shifted(picture: NDArray[Any], spacing: int, step: int, down: int, right: int) -> Iterator[NDArray[Any]]:
    """For each of a window's pixels: that pixel of all windows, (down, right)."""
    rows, columns = (slice(0, (count - 1) * step + 1, step) for count in (down, right))
    for top in range(0, SIDE * spacing, spacing):
        for left in range(0, SIDE * spacing, spacing):
            yield picture[top:, left:][rows, columns]


@lru_cache(maxsize=1)
def _lag_pairs() -> tuple[tuple[NDArray[Any], NDArray[Any]], ...]:
    """For each lag: the indices of the window's pixels that are that far apart."""
    position = np.arange(SIDE**2).reshape(SIDE, SIDE)
    pairs = []
    for down, right in LAGS:
        first = position[: SIDE - down, : SIDE - right]
        pairs.append((first.ravel(), position[down:, right:].ravel()))
    return tuple(pairs)


def _lags(covariances: NDArray[np.float64]) -> NDArray[np.float64]:
    """Correlations at the lags, per covariance (M, 16, 16): (M * 6,).

    The mean of 16 correlated pixels was taken off each window, which lowers all correlations alike; the network knows
    such windows only.
    """
    power = np.trace(covariances, axis1=1, axis2=2) / SIDE**2 + POWER_FLOOR_DN2
    columns = [covariances[:, first, second].mean(axis=1) / power for first, second in _lag_pairs()]
    return np.stack(columns, axis=1).ravel()


def _bands(variance: Float, means: Float) -> NDArray[np.float64]:
    """Noise by brightness: log of the relative deviation of the flattest tenth, and the share of windows, per band."""
    overall = _flattest(variance)
    band = np.minimum((means * (BANDS / (WHITE_DN + 1))).astype(int), BANDS - 1)
    ratios, shares = np.zeros(BANDS), np.zeros(BANDS)
    for number in range(BANDS):
        inside = variance[band == number]
        shares[number] = len(inside) / len(variance)
        if len(inside) >= LEAST_WINDOWS // 4:
            ratios[number] = 0.5 * np.log((_flattest(inside) + POWER_FLOOR_DN2) / (overall + POWER_FLOOR_DN2))
    return np.concatenate([ratios, shares])


def _flattest(variance: Float) -> float:
    count = max(len(variance) // 10, 1)
    return float(np.partition(variance, count - 1)[:count].mean())


@lru_cache(maxsize=1)
def _dct_matrix() -> Float:
    position = np.arange(CELL_PX)
    matrix = np.cos(np.pi * (2 * position[None] + 1) * position[:, None] / (2 * CELL_PX)) * np.sqrt(2 / CELL_PX)
    matrix[0] /= np.sqrt(2)
    return matrix.astype(np.float32)


def compression(picture: Float) -> NDArray[np.float64]:
    """Traces of block coding.

    Args:
        picture: (H, W) DN, at least 24 px each.

    Returns:
        (9,): per direction (columns, then rows) the log of the mean step over the strongest grid line relative to the
        median line, the same of the second-strongest, and how many fewer steps vanish there; then the fraction of DCT
        coefficients below 1 DN in three ranges of frequency, blocks aligned to that grid.
    """
    numbers, starts = [], []
    for axis in (1, 0):
        steps = np.abs(np.diff(picture, axis=axis))
        steps = steps if axis == 1 else steps.T
        usable = steps.shape[1] // CELL_PX * CELL_PX
        # Sums over lines first, as one product, then over the lines of equal phase.
        lines = np.ones(len(steps), np.float32)
        mean = (lines @ np.minimum(steps[:, :usable], 12)).reshape(-1, CELL_PX).sum(axis=0)
        equal = (lines @ (steps[:, :usable] < 0.5).astype(np.float32)).reshape(-1, CELL_PX).sum(axis=0)
        size = len(steps) * usable / CELL_PX
        mean, equal = mean / size + 0.02, equal / size
        ranked, equals = np.sort(mean), np.sort(equal)
        strongest = int(mean.argmax())
        starts.append((strongest + 1) % CELL_PX)
        numbers += [np.log(ranked[-1] / ranked[3]), np.log(ranked[-2] / ranked[3]), equals[3] - equal[strongest]]
    left, top = starts
    rows, columns = ((side - start) // CELL_PX for side, start in zip(picture.shape, (top, left), strict=True))
    blocks = picture[top : top + rows * CELL_PX, left : left + columns * CELL_PX]
    blocks = blocks.reshape(rows, CELL_PX, columns, CELL_PX).transpose(0, 2, 1, 3)
    matrix = _dct_matrix()
    coefficients = np.abs(matrix @ blocks @ matrix.T)
    small = (coefficients < 1).reshape(-1, CELL_PX, CELL_PX).mean(axis=0)
    order = np.add.outer(np.arange(CELL_PX), np.arange(CELL_PX))
    numbers += [small[(order >= low) & (order <= high)].mean() for low, high in ((2, 4), (5, 8), (9, 14))]
    return np.array(numbers)
