"""What the cell-wise network looks at: fixed statistics of every 8 x 8 px cell.

A learned filter bank finds its way to noise slowly; the answers of known high-pass filters hold it already. All
filters have unit norm, so on white noise each answer has the noise's own standard deviation; how the answers *differ*
distinguishes texture from noise. Noise has the same power at every frequency and scale, texture falls off with
frequency, and an image that was blurred, interpolated or compressed has next to none at the finest.

Per cell: mean square of six 3 x 3 filters, of three of them also on the image halved and quartered (averaged 2 x 2,
scaled so that white noise keeps its size), least and greatest power of its quarters, power in bands of the cell's 8 x 8
discrete cosine transform, share of equal neighbours, mean, spread, extremes, and shares of black and white pixels:
noise that white has clipped is one-sided, and those tell how much was cut.
"""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from pipeline.camera.saturation import BLACK_BELOW_DN, WHITE_ABOVE_DN
from pipeline.noise.maps import CELL_PX

if TYPE_CHECKING:
    import torch

FILTERS = 6
CHANNELS = 45
"""Numbers per cell."""

POWERS = 34
"""How many of them, the first, are logarithms of power."""

MEAN = 38
"""Which of them is the cell's mean, as DN / 128 - 1."""

_POWER_FLOOR = 0.02  # DN squared, under the 1/12 of rounding
_ROOT_HALF_PI = math.sqrt(math.pi / 2)  # standard deviation over mean modulus of a normal distribution


def features(image_dn: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Statistics of every cell.

    Args:
        image_dn: (N, H, W) float32, whole numbers 0..255; H and W multiples of 8.

    Returns:
        statistics: (N, CHANNELS, H / 8, W / 8), of size about one.
        base_dn: (N, H / 8, W / 8), the cell's noise by the difference of two Laplacians (Immerkaer 1996), DN.
    """
    import torch
    import torch.nn.functional as functional

    from pipeline.learning.elementwise import logarithm, square_root

    image = image_dn[:, None]
    filters, bands = _filters().to(image.device), _bands().to(image.device)
    fine = _answers(image, filters)
    modulus = _mean(fine[:, :1].abs(), CELL_PX) * _ROOT_HALF_PI
    equal = _mean((fine[:, 3:4].abs() < 0.5).float(), CELL_PX)
    square = fine.square_()
    quarters = _mean(square[:, :1], CELL_PX // 2)
    power = _mean(square, CELL_PX)
    half = _mean(image, 2) * 2
    half_power = _mean(_answers(half, filters[:3]).square_(), CELL_PX // 2)
    quarter_power = _mean(_answers(_mean(half, 2) * 2, filters[:3]).square_(), CELL_PX // 4)
    cosine = functional.conv2d(image - 128, _cosines().to(image.device), stride=CELL_PX).square_()
    mean, lowest, highest = _mean(image, CELL_PX), _extreme(image, CELL_PX, -1), _extreme(image, CELL_PX, 1)
    white, black = torch.zeros_like(mean), torch.zeros_like(mean)
    if highest.max() >= WHITE_ABOVE_DN:
        white = _mean((image >= WHITE_ABOVE_DN).float(), CELL_PX)
    if lowest.min() <= BLACK_BELOW_DN:
        black = _mean((image <= BLACK_BELOW_DN).float(), CELL_PX)
    base = torch.minimum(square_root(power[:, :1]), modulus[:, :1])
    powers = [power, half_power, quarter_power, _extreme(quarters, 2, -1), _extreme(quarters, 2, 1), modulus**2]
    powers += [functional.conv2d(cosine, bands), cosine[:, 1:].sum(1, keepdim=True) / CELL_PX**2]
    logs = log_power(torch.cat(powers, 1))
    room = logarithm(torch.cat([255 - mean, 255 - lowest, mean, highest], 1) + 0.5) * 0.5 - 1
    levels = torch.cat([mean, lowest, highest], 1) / 128 - 1
    result = torch.cat([logs, room, levels, equal * 2 - 1, white * 2, black * 2, logarithm(base + 0.5)], 1)
    return result, base[:, 0]


def log_power(power_dn2: torch.Tensor) -> torch.Tensor:
    """How powers are shown to the network: half the logarithm, less one."""
    from pipeline.learning.elementwise import logarithm

    return logarithm(power_dn2 + _POWER_FLOOR) * 0.5 - 1


def power(statistics: torch.Tensor) -> torch.Tensor:
    """The powers behind the first `POWERS` channels of statistics (N, CHANNELS, ...), DN squared."""
    return ((statistics[:, :POWERS] + 1) * 2).exp() - _POWER_FLOOR


def _mean(x: torch.Tensor, size: int) -> torch.Tensor:
    """Means of squares of a size; rows are added first, which is two to four times as fast as pooling."""
    return x.unflatten(-2, (-1, size)).sum(-2).unflatten(-1, (-1, size)).sum(-1) / size**2


def _extreme(x: torch.Tensor, size: int, sign: int) -> torch.Tensor:
    """Greatest (sign 1) or least (sign -1) values of squares of a size."""
    if sign > 0:
        return x.unflatten(-2, (-1, size)).amax(-2).unflatten(-1, (-1, size)).amax(-1)
    return x.unflatten(-2, (-1, size)).amin(-2).unflatten(-1, (-1, size)).amin(-1)


def _answers(image: torch.Tensor, filters: torch.Tensor) -> torch.Tensor:
    """Convolution with reflected border: (N, F, H, W)."""
    import torch.nn.functional as functional

    return functional.conv2d(functional.pad(image, (1, 1, 1, 1), mode="reflect"), filters)


@cache
def _filters() -> torch.Tensor:
    """(6, 1, 3, 3): Immerkaer's mask, second and first differences in both directions, Haar's diagonal; unit norm."""
    import torch

    bank = np.zeros((FILTERS, 3, 3))
    bank[0] = np.outer([1, -2, 1], [1, -2, 1])
    bank[1, 1] = bank[2, :, 1] = [1, -2, 1]
    bank[3, 1, 1:] = bank[4, 1:, 1] = [1, -1]
    bank[5, 1:, 1:] = [[1, -1], [-1, 1]]
    bank /= np.sqrt((bank**2).sum(axis=(1, 2), keepdims=True))
    return torch.from_numpy(bank[:, None].astype(np.float32))


@cache
def _cosines() -> torch.Tensor:
    """(64, 1, 8, 8): the orthonormal two-dimensional discrete cosine transform of a cell."""
    import torch
    from scipy.fft import idctn

    unit = np.eye(CELL_PX * CELL_PX).reshape(-1, CELL_PX, CELL_PX)
    return torch.from_numpy(idctn(unit, axes=(1, 2), norm="ortho").astype(np.float32)[:, None])


@cache
def _bands() -> torch.Tensor:
    """(18, 64, 1, 1): averages of transform coefficients by radius and direction (across, along, between)."""
    import torch

    rows, columns = np.divmod(np.arange(CELL_PX * CELL_PX), CELL_PX)
    radius = np.rint(np.hypot(rows, columns)).astype(int)
    across, along = columns > 2 * rows, rows > 2 * columns
    groups = []
    for low, high in ((1, 1), (2, 2), (3, 3), (4, 4), (5, 5), (6, 7)):
        ring = (radius >= low) & (radius <= high)
        groups += [ring & across, ring & along]
        if low > 1:
            groups.append(ring & ~across & ~along)
    groups.append(radius >= 8)
    weights = np.array([group / group.sum() for group in groups], dtype=np.float32)
    return torch.from_numpy(weights[:, :, None, None])
