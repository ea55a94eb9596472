"""How detectors are asked: each gets pixels of its own, and its detections are checked before they are counted.

A detector of a third party that works in place must not spoil the frame that the monitor or the next noise level takes,
and a score that is no number would rank the right box last.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.answers import ROUNDING, WrongAnswer, check_array
from pipeline.detection.base import Detections, Detector
from pipeline.errors import InputError

SCORE_SLACK = 1e-4
"""By which a score may leave 0 to 1: a network's float32 sums do by several millionths."""


def detections_in(detector: Detector, image: NDArray[np.floating], name: str) -> Detections:
    """Detections in one image.

    Args:
        detector: built-in, or a third party's.
        image: (H, W) in [0, 1]; it stays as it is.
        name: of the detector in messages, that of its registry.

    Returns:
        what it detected, in arrays of their own and in the detector's order.

    Raises:
        InputError: the detector refuses the image, or does not return a list of one `Detections` with finite boxes,
            x1 <= x2 and y1 <= y2, scores in 0 to 1 and labels that are text.
    """
    try:
        return _checked(detector.detect([image.copy()]))
    except InputError as error:
        raise InputError(f"detector '{name}': {error}") from error


def _checked(answered: object) -> Detections:
    if not isinstance(answered, list) or len(answered) != 1:
        held = f" of {len(answered)}" if isinstance(answered, list) else ""
        kind = f"{type(answered).__name__}{held}"
        raise WrongAnswer(f"returned {kind} for one image, expected a list of 1 pipeline.detection.base.Detections")
    (detected,) = answered
    if not isinstance(detected, Detections):
        kind = type(detected).__name__
        raise WrongAnswer(f"returned a list of {kind}, expected a list of pipeline.detection.base.Detections")
    boxes, score, label = detected.boxes, detected.score, detected.label
    if not isinstance(score, np.ndarray) or score.ndim != 1:
        kind = f"of shape {score.shape}" if isinstance(score, np.ndarray) else f"of type {type(score).__name__}"
        raise WrongAnswer(f"score is {kind}, expected a NumPy array of shape (M,); Detections.of() makes it")
    count = len(score)
    check_array("score", score, (count,))
    check_array("boxes", boxes, (count, 4))
    check_array("label", label, (count,), "OU")
    for number, word in enumerate(label):  # an array of objects may hold class numbers, which no class is called
        if not isinstance(word, str):
            raise WrongAnswer(f"label of detection {number} is {word!r} of type {type(word).__name__}, expected text")
    _check_each("score", score, (score >= -SCORE_SLACK) & (score <= 1.0 + SCORE_SLACK), "0 to 1")
    _check_each("the box", boxes, np.isfinite(boxes).all(axis=1), "finite x1 y1 x2 y2")
    ordered = boxes[:, 2:] - boxes[:, :2] >= -ROUNDING * (1.0 + np.abs(boxes[:, :2]))
    _check_each("the box", boxes, ordered.all(axis=1), "x1 y1 x2 y2 with x1 <= x2 and y1 <= y2")
    return Detections(np.array(boxes, dtype=np.float64), np.array(score, dtype=np.float64), label.astype(np.str_))


def _check_each(name: str, values: NDArray[np.floating], right: ArrayLike, expected: str) -> None:
    if not np.all(right):
        first = int(np.argmin(right))
        numbers = " ".join(f"{value:.7g}" for value in np.atleast_1d(values[first]))
        raise WrongAnswer(f"{name} of detection {first} is {numbers}, expected {expected}")
