"""Traces of a codec that quantises transform blocks: coefficients that vanish on the block grid more often than off it.

JPEG, MPEG-4 and Motion JPEG quantise the DCT of 8 x 8 px blocks, H.264 that of 4 x 4 px. A coefficient below half a
quantiser step comes back as zero, and only in blocks that lie on the codec's grid. With f the fraction of middle and
high frequencies below 0.5 DN, in blocks on the grid and in blocks off it, shifted by 2 px in both directions (half a
block of 4 px, a quarter of one of 8 px),

    excess = ln(f_on / f_off)

is 0 for every picture that was not quantised, whatever it shows and however noisy it is: shifted blocks see the same
picture. Deblocking filters weaken the excess, they do not remove it. A picture that was scaled or averaged after
coding has none.

The grid may begin anywhere. For 4 px all 16 phases are tried; for 8 px the four that contain the best of these, and
the patch's upper left corner, where the grid lies if the patch was cut at a multiple of 8 px.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

Float = NDArray[np.float32]
Grey = NDArray[np.uint8]

VANISHED_DN = 0.5
LEAST_PX = 24
PRIOR = 3.0  # vanished coefficients added to both counts, so that no logarithm is of 0
LEAST_EXCESS = 0.1
STANDARD_ERRORS = 1.0
"""Of the excess, beyond `LEAST_EXCESS`."""

SUSPECTED_ERRORS = 2.0
"""Standard errors that both excesses exceed where a codec is suspected."""

_LINES = {4: np.uint32, 8: np.uint64}
"""Numbers that hold the pixels of a block's line."""

INDEPENDENT = 1000.0  # observations in a patch of 128 px; coefficients of one block vanish together


@dataclass(frozen=True)
class BlockQuantisation:
    """Traces of quantised blocks in a patch.

    Attributes:
        excess_4: of vanished coefficients on the best grid of 4 x 4 px blocks.
        excess_8: likewise of 8 x 8 px.
        vanished_4, vanished_8: fraction of vanished coefficients on those grids.
        present: whether one excess is larger than chance gives (`present`).
    """

    excess_4: float
    excess_8: float
    vanished_4: float
    vanished_8: float
    present: bool

    @property
    def numbers(self) -> tuple[float, float, float, float]:
        """Excesses and fractions, 4 px before 8 px."""
        return self.excess_4, self.excess_8, self.vanished_4, self.vanished_8


def block_quantisation(patch_dn: Float | Grey) -> BlockQuantisation:
    """Traces of quantised blocks.

    Args:
        patch_dn: (H, W) whole grey levels 0..255, sides of at least 24 px.
    """
    picture = np.ascontiguousarray(patch_dn, dtype=np.uint8)
    by_phase = _phases_of_4(picture)
    best = np.unravel_index(int(by_phase.argmax()), by_phase.shape)
    top, left = int(best[0]), int(best[1])
    on_4, off_4 = float(by_phase[top, left]), float(by_phase[(top + 2) % 4, (left + 2) % 4])
    corners = {(top + down, left + right) for down in (0, 4) for right in (0, 4)} | {(0, 0)}
    on_8, corner = max((_vanished_8(picture, y, x), (y, x)) for y, x in sorted(corners))
    off_8 = _vanished_8(picture, (corner[0] + 2) % 8, (corner[1] + 2) % 8)
    excess_4, excess_8 = float(np.log(on_4 / off_4)), float(np.log(on_8 / off_8))
    numbers = np.array([[excess_4, excess_8, on_4, on_8]])
    return BlockQuantisation(excess_4, excess_8, on_4, on_8, bool(present(numbers, picture.size)[0]))


def at_corner(patch_dn: Float | Grey) -> bool:
    """Whether blocks are quantised on a grid that begins at the patch's upper left corner; faster than searching it.

    Args:
        patch_dn: as for `block_quantisation`.
    """
    picture = np.ascontiguousarray(patch_dn, dtype=np.uint8)
    on, off = ((_vanished_4(picture, start, start), _vanished_8(picture, start, start)) for start in (0, 2))
    numbers = np.array([[np.log(on[0] / off[0]), np.log(on[1] / off[1]), *on]])
    return bool(present(numbers, picture.size)[0])


def present(numbers: NDArray[np.floating], pixels: int) -> NDArray[np.bool_]:
    """Whether one excess of a patch is larger than chance gives.

    Args:
        numbers: (N, 4) as `BlockQuantisation.numbers`.
        pixels: of a patch.

    Returns:
        (N,).
    """
    return np.asarray((numbers[:, :2] > LEAST_EXCESS + STANDARD_ERRORS * _deviation(numbers, pixels)).any(axis=1))


def suspected(numbers: NDArray[np.floating], pixels: int) -> NDArray[np.bool_]:
    """Whether both excesses of a patch are larger than chance mostly gives: weak traces, as H.264 leaves them.

    Args:
        numbers: (N, 4) as `BlockQuantisation.numbers`.
        pixels: of a patch.

    Returns:
        (N,).
    """
    return np.asarray((numbers[:, :2] > SUSPECTED_ERRORS * _deviation(numbers, pixels)).all(axis=1))


def _deviation(numbers: NDArray[np.floating], pixels: int) -> NDArray[np.floating]:
    """Standard errors of both excesses (N, 2)."""
    vanished = np.maximum(numbers[:, 2:], 1e-6)
    return np.asarray(np.sqrt(2 * (1 - vanished) / (vanished * INDEPENDENT * pixels / 128**2)))


@lru_cache(maxsize=2)
def _transform(side: int) -> Float:
    """(side^2, coefficients): the two-dimensional DCT-II of a block to its middle and high frequencies."""
    index, line = np.arange(side), dct(np.eye(side), axis=0, norm="ortho")
    whole = np.einsum("ui,vj->ijuv", line, line).reshape(side**2, side, side)
    return np.ascontiguousarray(whole[:, np.add.outer(index, index) > side // 2], dtype=np.float32)


def _fraction(windows: Float, side: int) -> float:
    """Fraction of vanished coefficients of blocks as rows (n, side^2)."""
    coefficients = windows @ _transform(side)
    vanished = np.count_nonzero(np.abs(coefficients, out=coefficients) < VANISHED_DN)
    return float((vanished + PRIOR) / (coefficients.size + 2 * PRIOR))


def _phases_of_4(picture: Grey) -> NDArray[np.float64]:
    """(4, 4) fraction of vanished coefficients of 4 x 4 blocks by the grid's first row and column."""
    return np.array([[_vanished_4(picture, y, x) for x in range(4)] for y in range(4)])


def _vanished_4(picture: Grey, top: int, left: int) -> float:
    return _fraction(_blocks(picture, 4, top, left), 4)


def _vanished_8(picture: Grey, top: int, left: int) -> float:
    return _fraction(_blocks(picture, 8, top, left), 8)


def _blocks(picture: Grey, side: int, top: int, left: int) -> Float:
    """Blocks as rows (n, side^2); a line of a block is copied at once, as one number of 4 or 8 bytes."""
    rows, columns = (picture.shape[0] - top) // side, (picture.shape[1] - left) // side
    line, pixel = picture.strides
    lines = np.ndarray(
        (rows, columns, side), _LINES[side], picture, top * line + left * pixel, (side * line, side * pixel, line)
    )
    return np.ascontiguousarray(lines).view(np.uint8).reshape(-1, side**2).astype(np.float32)
