"""Length of linear motion blur from an estimated MTF, and the MTF it leaves.

Along one axis, motion of L pixels multiplies the MTF by ``|sinc(L f)|``, f in cycles per pixel. With the MTF of the
camera's sharp frames as reference, L is the length whose curve is nearest (least squares over the eight frequencies).
A direction between the axes shows its projections on both: L = hypot(L_h, L_v). Exact for a long line along an axis.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.camera.mtf import FREQUENCIES
from pipeline.control.observation import Estimate
from pipeline.errors import InputError

Floats = NDArray[np.float64]

CYCLES_PER_PX = np.asarray(FREQUENCIES, dtype=np.float64) / 2.0
LONGEST_PX = 45.0
_LENGTHS_PX = np.arange(0.0, LONGEST_PX + 0.125, 0.25)
_CURVES = np.abs(np.sinc(_LENGTHS_PX[:, None] * CYCLES_PER_PX))
_LEAST_REFERENCE = 0.05


class MotionLength(NamedTuple):
    """Length of the motion blur in pixels with its interval, and its direction, 0..90 degrees from horizontal."""

    value_px: float
    low_px: float
    high_px: float
    direction_deg: float


def motion_length(mtf: Estimate, reference: ArrayLike) -> MotionLength:
    """Motion that explains the loss of contrast against the reference.

    Args:
        mtf: (2, 8) estimated system MTF with interval, horizontal and vertical.
        reference: (2, 8) MTF of the camera's sharp frames.

    Raises:
        InputError: the reference is not (2, 8) or not above 0.05.
    """
    sharp = np.asarray(reference, dtype=np.float64)
    if sharp.shape != (2, len(CYCLES_PER_PX)) or not (np.isfinite(sharp) & (sharp > _LEAST_REFERENCE)).all():
        raise InputError(
            f"reference MTF: expected (2, {len(CYCLES_PER_PX)}) numbers above {_LEAST_REFERENCE}; estimate it on sharp "
            "frames of this camera"
        )
    axes = _axes(mtf.value, sharp)
    low = high = float(np.hypot(*axes))
    if np.isfinite(mtf.low).all() and np.isfinite(mtf.high).all():
        low, high = float(np.hypot(*_axes(mtf.high, sharp))), float(np.hypot(*_axes(mtf.low, sharp)))
    value = float(np.hypot(*axes))
    direction = float(np.degrees(np.arctan2(axes[1], axes[0])))
    return MotionLength(value, min(low, value), max(high, value), direction)


def _axes(mtf: Floats, reference: Floats) -> Floats:
    """(2,) lengths along both axes."""
    ratio = np.clip(np.asarray(mtf, dtype=np.float64) / reference, 0.0, 1.0)
    distance = (reference[:, None] ** 2 * (_CURVES[None] - ratio[:, None]) ** 2).sum(axis=2)
    return _LENGTHS_PX[np.argmin(distance, axis=1)]


def motion_mtf(length_px: ArrayLike, reference: ArrayLike, frequency_index: int, direction_deg: float = 0.0) -> Floats:
    """Mean of horizontal and vertical MTF at one frequency behind linear motion.

    Args:
        length_px: (...) lengths, at least 0 px.
        reference: (2, 8) MTF without motion.
        frequency_index: which of the eight frequencies.
        direction_deg: of the motion.

    Returns:
        (...) MTF in 0..1.
    """
    sharp = np.asarray(reference, dtype=np.float64)[:, frequency_index]
    turn = np.deg2rad(direction_deg)
    lengths = np.asarray(length_px, dtype=np.float64)[..., None] * np.abs([np.cos(turn), np.sin(turn)])
    return (sharp * np.abs(np.sinc(lengths * CYCLES_PER_PX[frequency_index]))).mean(axis=-1)
