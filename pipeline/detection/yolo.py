"""What the YOLO networks share: strides and anchors of their maps, and the class and score of a row.

Each row of an output is (centre, size, objectness, classes); score = objectness * best class.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

STRIDES = (8, 16, 32)
"""Pixels of the canvas per cell, finest map first."""
ANCHORS_PX = np.array(
    [[[12, 16], [19, 36], [40, 28]], [[36, 75], [76, 55], [72, 146]], [[142, 110], [192, 243], [459, 401]]], dtype=float
)
"""(stride, anchor, width and height) in pixels of the canvas; of YOLOv4 and YOLOv7."""


def scored(rows: NDArray[Any]) -> tuple[NDArray[np.intp], NDArray[Any]]:
    """Best class and score of each row.

    Args:
        rows: (M, 5 + classes); objectness in column 4, classes from column 5, both in [0, 1].

    Returns:
        class numbers (M,) and scores (M,) in [0, 1].
    """
    kind = np.argmax(rows[:, 5:], axis=1)
    return kind, rows[:, 4] * rows[np.arange(len(rows)), 5 + kind]
