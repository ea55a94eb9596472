"""Whether a camera's MTF leaves enough contrast for blur to be stated relative to it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipeline.blur.base import SHARP_FLOOR
from pipeline.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

MOST_EMPTY_FRACTION = 0.5  # of the 16 values of an MTF that may lie at or below the estimators' floor
MOST_EMPTY_FRACTION_FIT = 0.25  # likewise where the pictures are blurred further, to correct the estimator


def refuse_without_contrast(mtf: NDArray[np.floating], subject: str, advice: str, most_empty_fraction: float) -> None:
    """Refuse an MTF that estimates cannot be divided by.

    Args:
        mtf: (2, 8) at `pipeline.camera.mtf.FREQUENCIES`.
        subject: what it is of.
        advice: what else to give.
        most_empty_fraction: of the values that may lie at or below `pipeline.blur.base.SHARP_FLOOR`, beside those
            of the lowest frequency, which never may.

    Raises:
        InputError: it is such an MTF.
    """
    empty = np.asarray(mtf) <= SHARP_FLOOR
    if empty.mean() > most_empty_fraction or empty[:, 0].any():
        raise InputError(
            f"{subject}: no contrast is left (MTF at most {SHARP_FLOOR:g}) at {empty.sum()} of {empty.size} values, so "
            f"that blur relative to them means nothing; {advice}"
        )
