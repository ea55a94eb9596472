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
        overlap: intersection over union above which the weaker box of a class is dropped, [0, 1].
        most: boxes kept per image at most.
    """

    score_floor: float
    overlap: float
    most: int

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
            return likely[np.argsort(-score[likely], kind="stable")][: self.most]
        return likely[suppress(boxes[likely], score[likely], kind[likely], self.overlap, self.most)]


FULL = Limits(score_floor=0.01, overlap=0.5, most=300)
"""Nearly everything is kept: average precision needs the curve to its end; thin out later with `Detections.above`."""


def limits(
    mode: Mode,
    paper: Limits,
    score_floor: float | None = None,
    overlap: float | None = None,
    most: int | None = None,
    full: Limits = FULL,
) -> Limits:
    """The limits of a mode, each replaced where one is given.

    Args:
        mode: ``"full"`` or ``"paper"``.
        paper: the limits the paper used.
        score_floor: instead of the mode's, [0, 1].
        overlap: instead of the mode's, [0, 1].
        most: instead of the mode's, at least 1.
        full: the limits of the other mode.

    Raises:
        InputError: an unknown mode, or a limit out of range.
    """
    if mode not in MODES:
        raise InputError(f"mode: expected one of {', '.join(MODES)}, not {mode!r}; {did_you_mean(str(mode), MODES)}")
    for name, value in (("score_floor", score_floor), ("overlap", overlap)):
        if value is not None and not 0.0 <= value <= 1.0:
            raise InputError(f"{name}: expected a number in [0, 1], not {value!r}")
    if most is not None and most < 1:
        raise InputError(f"most: expected at least 1, not {most!r}")
    base = paper if mode == "paper" else full
    return Limits(
        score_floor=base.score_floor if score_floor is None else score_floor,
        overlap=base.overlap if overlap is None else overlap,
        most=base.most if most is None else most,
    )


def eight_bit(image: NDArray[np.float32]) -> NDArray[np.uint8]:
    """The image as an 8-bit file would hold it: (H, W) in [0, 1] to 0..255, rounded."""
    return np.rint(np.clip(image, 0.0, 1.0) * 255.0).astype(np.uint8)
