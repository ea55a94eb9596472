"""Average precision expected at a noise and a motion blur: the measured surface as a controller asks it.

The surface (`pipeline.curves.surface`) is over estimated noise and MTF; here its MTF axis is reached through the length
of linear motion, at a frequency low enough that the MTF falls steadily up to 31 px. It is tabulated once, so that a
decision costs microseconds. What was not measured is refused (NaN), but for noise below the least measured, which
counts as that.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.control.motion import motion_mtf
from pipeline.curves.cells import Cells
from pipeline.curves.surface import Surface
from pipeline.errors import InputError
from pipeline.store import read_arrays, write_arrays

Floats = NDArray[np.float64]

SIGMA_STEP_DN = 1.0
MOTION_STEP_PX = 0.5
_EDGE = 1e-9


class Expected(NamedTuple):
    """(...) average precision in percent and the ends of its 95 % interval; NaN where refused."""

    ap_percent: Floats
    low: Floats
    high: Floats


class Performance:
    """A surface over noise and motion length.

    Args:
        surface: measured over noise and the MTF at ``frequency_index`` (mean of H and V).
        reference: (2, 8) MTF of the camera's sharp frames.
        frequency_index: which of the eight frequencies the surface's MTF axis is at.
        longest_px: longest motion measured.

    Raises:
        InputError: a frequency index out of range.
    """

    def __init__(self, surface: Surface, reference: ArrayLike, frequency_index: int, longest_px: float) -> None:
        if not 0 <= frequency_index < 8:
            raise InputError(f"frequency_index is one of 0..7, got {frequency_index!r}")
        self.surface, self.frequency_index, self.longest_px = surface, frequency_index, float(longest_px)
        self.reference = np.asarray(reference, dtype=np.float64)
        known = surface.cells.count > 0
        self.least_sigma_dn = float(np.nanmax(np.where(known[0], surface.cells.sigma_dn[0], np.nan)))
        most = float(np.nanmax(surface.cells.sigma_dn))
        self._sigmas = np.append(np.arange(self.least_sigma_dn, most, SIGMA_STEP_DN), most)
        self._motions = np.append(np.arange(0.0, self.longest_px, MOTION_STEP_PX), self.longest_px)
        mtf = motion_mtf(self._motions, self.reference, frequency_index)
        answer = surface.query(self._sigmas[:, None], mtf[None])
        self._table = np.stack([answer.ap_percent, answer.low, answer.high])

    @property
    def most_sigma_dn(self) -> float:
        """Strongest noise measured, DN."""
        return float(self._sigmas[-1])

    def expected(self, sigma_dn: ArrayLike, motion_px: ArrayLike) -> Expected:
        """Average precision at noise and motion, bilinear between tabulated points.

        Args:
            sigma_dn: (...) noise, DN.
            motion_px: (...) length of motion blur, px.
        """
        sigma, motion = np.broadcast_arrays(np.asarray(sigma_dn, float), np.asarray(motion_px, float))
        noise = np.maximum(sigma, self.least_sigma_dn)
        inside = (noise <= self._sigmas[-1] + _EDGE) & (motion >= 0.0) & (motion <= self.longest_px + _EDGE)
        row, down = _position(np.where(inside, noise, self._sigmas[0]), self._sigmas)
        column, right = _position(np.where(inside, motion, 0.0), self._motions)
        parts = []
        for table in self._table:
            upper = table[row, column] * (1 - right) + _next(table[row, column + 1], right)
            lower = table[row + 1, column] * (1 - right) + _next(table[row + 1, column + 1], right)
            parts.append(np.where(inside, np.where(down > _EDGE, upper * (1 - down) + lower * down, upper), np.nan))
        return Expected(*parts)

    def excess(self, sigma_dn: ArrayLike, motion_px: ArrayLike) -> Floats:
        """How far a condition lies outside of the measured region, in fractions of its extent; 0 inside."""
        noise = np.maximum(np.asarray(sigma_dn, float) / self.most_sigma_dn - 1.0, 0.0)
        return np.asarray(noise + np.maximum(np.asarray(motion_px, float) / self.longest_px - 1.0, 0.0))

    def save(self, path: str | Path) -> None:
        """Write surface, reference and axis as ``.npz``."""
        cells = {f"cells_{name}": np.asarray(value) for name, value in vars(self.surface.cells).items()}
        axis = {"frequency_index": np.asarray(self.frequency_index), "longest_px": np.asarray(self.longest_px)}
        write_arrays(path, reference=self.reference, **axis, **cells)

    @classmethod
    def load(cls, path: str | Path) -> Performance:
        """Read what `save` wrote.

        Raises:
            InputError: the file is missing, broken or of another kind.
        """
        arrays = read_arrays(path)
        try:
            cells = {name: arrays[f"cells_{name}"] for name in Cells.__dataclass_fields__}
            left_out = int(cells.pop("left_out"))
            surface = Surface(Cells(**cells, left_out=left_out))
            return cls(surface, arrays["reference"], int(arrays["frequency_index"]), float(arrays["longest_px"]))
        except KeyError as error:
            raise InputError(
                f"{path}: array {error} is missing; expected a surface for control as the stage control_surface "
                "writes it"
            ) from None


def _position(values: Floats, knots: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Index of the knot below each value, and the fraction of the way to the next."""
    index = np.clip(np.searchsorted(knots, values, side="right") - 1, 0, len(knots) - 2)
    return index, np.clip((values - knots[index]) / (knots[index + 1] - knots[index]), 0.0, 1.0)


def _next(values: Floats, share: Floats) -> Floats:
    """Values times share; a neighbour that counts nothing does not carry its NaN over."""
    return np.where(share > _EDGE, values * share, 0.0)
