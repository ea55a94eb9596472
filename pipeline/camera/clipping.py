"""Transitions between two grey levels, as of an edge or of a ray of a star, that the 8-bit range cuts off.

A transition has lost its end where the mean grey level v still changes steeply while the fraction s of saturated pixels
sets in (`pipeline.camera.saturation`),

    clipping = sum |ds| |dv| / max |dv|

over neighbouring bins of position, |dv| a mean of three. White of exactly 255 DN, which the transition approaches
slowly, gives less than 0.08 for an edge, and does no harm. A Gaussian transition cut off at 98 % of its height gives
0.11 to 0.24, the sharper the more, at 95 % 0.16 to 0.33. Without the lost end a camera looks sharper than it is.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.camera.saturation import BLACK_BELOW_DN, WHITE_ABOVE_DN
from pipeline.errors import InputError

ENDS = ("black", "white")
"""Ends of the 8-bit range."""

_MENDS = {"black": "expose longer, or raise the black level", "white": "expose less"}


def saturated_at(image: NDArray[np.floating], end: str) -> NDArray[np.bool_]:
    """Which pixels are saturated at one end of the range.

    Args:
        image: any shape, grey levels in [0, 1].
        end: one of `ENDS`.

    Returns:
        bool, same shape.
    """
    return image <= BLACK_BELOW_DN / FULL_SCALE_DN if end == "black" else image >= WHITE_ABOVE_DN / FULL_SCALE_DN


def clipping(levels: NDArray[np.float64], saturated: NDArray[np.float64]) -> float:
    """How steep transitions are where saturation sets in; see the module.

    Args:
        levels: (N,) mean grey level of bins of position, N >= 4, any unit.
        saturated: (N,) fraction of saturated pixels of each bin, [0, 1].

    Returns:
        0 where nothing is saturated or transitions end before it; at most about 1 per transition.
    """
    slopes = np.convolve(np.abs(np.diff(levels)), np.full(3, 1 / 3), mode="same")
    steepest = float(slopes.max())
    return float((np.abs(np.diff(saturated)) * slopes).sum() / steepest) if steepest > 0 else 0.0


def refuse_clipped(subject: str, clippings: Sequence[float], most: float) -> None:
    """Refuse what is clipped.

    Args:
        subject: what to call it in the error.
        clippings: (2,) `clipping` at each of `ENDS`.
        most: that is accepted.

    Raises:
        InputError: one of them exceeds ``most``; names the end and how to expose.
    """
    ends = [end for end, value in zip(ENDS, clippings, strict=True) if value > most]
    if ends:
        mend = _MENDS[ends[0]] if len(ends) == 1 else "use a chart of less contrast"
        raise InputError(f"{subject}: clipped at {' and '.join(ends)}, which changes its MTF; {mend}")
