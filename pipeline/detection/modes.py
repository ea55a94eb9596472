"""Working points of a detector: low thresholds that keep whole precision-recall curves, or those of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.detection.nms import suppress
from pipeline.errors import InputError, did_you_mean

Mode = Literal["full", "paper"]
MODES: tuple[Mode, ...] = ("full", "paper")


@dataclass(frozen=True)
class Limits:
    """Which boxes a detector keeps.

    Attributes:
        score_floor: boxes below this score are dropped, [0, 1].
        iou_threshold: intersection over union above which the weaker box of a class is dropped, [0, 1].
        max_detections: boxes kept per image at most.
    """

    score_floor: float
    iou_threshold: float
    max_detections: int

    def select(
        self,
        boxes: NDArray[np.floating],
        score: NDArray[np.floating],
        kind: NDArray[np.integer],
        *,
        above: bool = False,
        suppressed: bool = False,
    ) -> NDArray[np.intp]:
        """Which candidates are kept: those with an area in the image and score enough, the weaker of two alike dropped.

        Args:
            boxes: (M, 4) x1 y1 x2 y2, clipped to the image; those wholly in the margin have no area.
            score: (M,) in [0, 1].
            kind: (M,) class numbers.
            above: a score must exceed `score_floor`; else equal it at least.
            suppressed: the network has suppressed boxes already, only the strongest are kept.

        Returns:
            indices of the kept ones, strongest first.
        """
        real = (boxes[:, 2] > boxes[:, 0]) & (boxes[:, 3] > boxes[:, 1])
        likely = np.flatnonzero(real & (score > self.score_floor if above else score >= self.score_floor))
        if suppressed:
            return likely[np.argsort(-score[likely], kind="stable")][: self.max_detections]
        return likely[suppress(boxes[likely], score[likely], kind[likely], self.iou_threshold, self.max_detections)]


FULL = Limits(score_floor=0.01, iou_threshold=0.5, max_detections=300)
"""Nearly everything is kept: average precision needs the curve to its end; thin out later with `Detections.above`."""


def limits(
    mode: Mode,
    paper: Limits,
    score_floor: float | None = None,
    iou_threshold: float | None = None,
    max_detections: int | None = None,
    full: Limits = FULL,
) -> Limits:
    """The limits of a mode, each replaced where one is given.

    Args:
        mode: ``"full"`` or ``"paper"``.
        paper: the limits the paper used.
        score_floor: instead of the mode's, [0, 1].
        iou_threshold: instead of the mode's, [0, 1].
        max_detections: instead of the mode's, at least 1.
        full: the limits of the other mode.

    Raises:
        InputError: an unknown mode, or a limit out of range.
    """
    if mode not in MODES:
        raise InputError(f"mode: expected one of {', '.join(MODES)}, not {mode!r}; {did_you_mean(str(mode), MODES)}")
    for name, value in (("score_floor", score_floor), ("iou_threshold", iou_threshold)):
        if value is not None and not 0.0 <= value <= 1.0:
            raise InputError(f"{name}: expected a number in [0, 1], not {value!r}")
    if max_detections is not None and max_detections < 1:
        raise InputError(f"max_detections: expected at least 1, not {max_detections!r}")
    base = paper if mode == "paper" else full
    return Limits(
        score_floor=base.score_floor if score_floor is None else score_floor,
        iou_threshold=base.iou_threshold if iou_threshold is None else iou_threshold,
        max_detections=base.max_detections if max_detections is None else max_detections,
    )
