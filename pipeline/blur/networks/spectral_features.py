"""What the spectral network sees of a patch: log power spectra, because blur multiplies spectra.

    log |D(f)|^2 = log |I(f)|^2 + 2 log |H(f)|  (+ noise),

so a kernel adds the same pattern to the log spectrum of any content. Three maps of 64 x 32 values over the half plane
of frequencies (vertical from -1/2, horizontal from 0, cycles per pixel):

* the Hann periodogram of the whole patch, averaged over 3 x 3 bins: fine ripples of long kernels;
* mean and minimum over the log periodograms of nine 64 px blocks: what all parts of the patch have in common.

Beside them the spectrum along and near each axis at full resolution (the MTF is asked for along the axes), and four
numbers: mean, contrast, share of white and of black pixels.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import torch

PATCH_PX = 192
BLOCK_PX = 64
BINS = PATCH_PX // 2 + 1
STRIPS = ((0, 2), (3, 9), (10, 24))  # bins from the axis, inclusive, that a profile averages
MAPS = 3
NUMBERS = 4
VECTOR_LENGTH = 2 * len(STRIPS) * BINS + NUMBERS
POWER_FLOOR = 0.02  # DN^2, well below the power of rounding to 8 bit (1/12)
LOG_SCALE = 0.25


@lru_cache(maxsize=4)
def _window(size_px: int) -> torch.Tensor:
    """Two-dimensional periodic Hann window of mean square 1."""
    import torch

    profile = torch.hann_window(size_px, periodic=True, dtype=torch.float32) / 0.375**0.5
    return profile[:, None] * profile[None]


def features(patches_dn: torch.Tensor, block_px: int = BLOCK_PX) -> tuple[torch.Tensor, torch.Tensor]:
    """Maps and vector of each patch.

    Args:
        patches_dn: (N, 192, 192) float32, 0..255.
        block_px: B, side of the blocks, 64 or 96; the maps are as fine as a block's spectrum.

    Returns:
        maps: (N, 3, B, B / 2).
        vector: (N, VECTOR_LENGTH): horizontal and vertical profile of each strip (97 bins each), then mean, log
            contrast, share of white and of black pixels.
    """
    import torch

    mean = patches_dn.mean((1, 2), keepdim=True)
    centred = patches_dn - mean
    window = _window(PATCH_PX).to(centred.device)
    power = _power(torch.fft.rfft2(centred * window), PATCH_PX)  # rows 0 .. 95, -96 .. -1; columns 0 .. 96
    local = _block_spectra(patches_dn, block_px)
    maps = torch.stack([_averaged(power, block_px), local.mean(1), local.amin(1)], dim=1) * LOG_SCALE
    numbers = torch.stack(
        [
            mean[:, 0, 0] / 255,
            (_deviation(centred) + 0.1).log() * 0.3,
            # As numbers at once: from booleans they take four times as long.
            torch.ge(patches_dn, 254, out=torch.empty_like(patches_dn)).mean((1, 2)),
            torch.le(patches_dn, 1, out=torch.empty_like(patches_dn)).mean((1, 2)),
        ],
        dim=1,
    )
    return maps, torch.cat([_profiles((power + POWER_FLOOR).log() * LOG_SCALE), numbers], dim=1)


def _averaged(power: torch.Tensor, block_px: int) -> torch.Tensor:
    """Log power of the whole patch, averaged over 3 x 3 bins about each frequency of a block's spectrum.

    Args:
        power: (N, 192, 97), rows 0 .. 95, -96 .. -1.
        block_px: B; every second (96) or third bin (64) is one of its frequencies.

    Returns:
        (N, B, B / 2), vertical frequencies from -1/2.
    """
    import torch
    import torch.nn.functional as functional

    step = PATCH_PX // block_px
    # Rows from -97 and columns from -1, so that the bins averaged are centred on multiples of the step.
    rolled = torch.roll(power, PATCH_PX // 2 + 1, 1)
    left = torch.roll(power[:, :, 1:2].flip(1), PATCH_PX // 2 + 2, 1)  # a real image's spectrum: P(-x, y) = P(x, -y)
    wide = torch.cat([left, rolled[:, :, : BINS + 1 - step]], dim=2)
    wide = torch.cat([wide, wide[:, : 3 - step]], dim=1)
    return (functional.avg_pool2d(wide[:, None], 3, step)[:, 0] + POWER_FLOOR).log()


def _block_spectra(patches_dn: torch.Tensor, block_px: int) -> torch.Tensor:
    """Log power of each block of a patch: (N, blocks, B, B / 2), vertical frequencies from -1/2."""
    import torch

    blocks = patches_dn.unfold(1, block_px, block_px).unfold(2, block_px, block_px)
    blocks = blocks.reshape(len(patches_dn), -1, block_px, block_px)
    blocks = blocks - blocks.mean((-1, -2), keepdim=True)
    log_power = (_power(torch.fft.rfft2(blocks * _window(block_px).to(blocks.device)), block_px) + POWER_FLOOR).log()
    return torch.roll(log_power, block_px // 2, 2)[..., : block_px // 2]


def _deviation(patches: torch.Tensor) -> torch.Tensor:
    """Standard deviation of each patch; sums in double precision, as `torch.std` has them, at a fifth of its time."""
    from pipeline.learning.elementwise import square_root

    wide, count = patches.flatten(1).double(), patches[0].numel()
    squares = wide.square().sum(1) - wide.sum(1).square() / count
    return square_root(squares.clamp_min(0) / (count - 1)).to(patches.dtype)


def _power(spectrum: torch.Tensor, size_px: int) -> torch.Tensor:
    """Squared modulus per pixel."""
    return (spectrum.real.square() + spectrum.imag.square()) / size_px**2


def _profiles(log_power: torch.Tensor) -> torch.Tensor:
    """Mean log power in strips along the axes: (N, 6 * 97) from (N, 192, 97)."""
    import torch

    upper = log_power[:, :BINS]
    lower = torch.cat([log_power[:, :1], log_power[:, PATCH_PX // 2 :].flip(1)], dim=1)  # rows 0, -1 .. -96
    results = []
    for low, high in STRIPS:
        strip = slice(low, high + 1)
        results.append(0.5 * (upper[:, strip].mean(1) + lower[:, strip].mean(1)))
        results.append(0.5 * (upper[:, :, strip].mean(2) + lower[:, :, strip].mean(2)))
    return torch.cat(results, dim=1)


def mirrored(maps: torch.Tensor) -> torch.Tensor:
    """Maps of the patch's mirror image, whose MTF is the same: vertical frequencies change sign.

    The vector of a mirror image is the patch's own (up to the window, which is symmetric to half a pixel).
    """
    import torch

    return torch.roll(maps.flip(2), 1, 2)
