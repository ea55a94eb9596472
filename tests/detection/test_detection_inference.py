"""Detectors are asked with pixels of their own, and their detections are checked."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pipeline.detection import create
from pipeline.detection.base import Detections, each_image
from pipeline.detection.inference import detections_in
from pipeline.errors import InputError
from pipeline.streams import stream

CAR = np.array(["car"])
RIGHT = Detections.of([[1, 2, 5, 6]], [0.5], ["car"])


class Answering:
    """A detector with one answer."""

    def __init__(self, answer: Any) -> None:
        self.answer = answer

    def detect(self, images: Any) -> Any:
        list(each_image(images))
        return self.answer


def image() -> np.ndarray:
    return stream(1, "inference").random((64, 96)).astype(np.float32)


def with_parts(boxes: Any, score: Any, label: Any = CAR) -> list[Detections]:
    return [Detections(boxes, score, label)]


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        ([], "returned list of 0 for one image, expected a list of 1"),
        ([RIGHT, RIGHT], "returned list of 2 for one image, expected a list of 1"),
        (RIGHT, "returned Detections for one image, expected a list of 1"),
        (None, "returned NoneType for one image"),
        ([(RIGHT.boxes, RIGHT.score, RIGHT.label)], "returned a list of tuple, expected a list of"),
        (with_parts([[1, 1, 5, 5]], [0.5]), r"score is of type list, expected a NumPy array of shape \(M,\)"),
        (with_parts(np.ones((1, 4)), np.ones((1, 1))), r"score is of shape \(1, 1\), expected a NumPy array"),
        (with_parts([[1, 1, 5, 5]], np.ones(1)), r"boxes is of type list, expected a NumPy array of shape \(1, 4\)"),
        (with_parts(np.ones((1, 5)), np.ones(1)), r"boxes has shape \(1, 5\), expected \(1, 4\)"),
        (with_parts(np.ones((2, 4)), np.ones(2)), r"label has shape \(1,\), expected \(2,\)"),
        (with_parts(np.ones((1, 4)), np.ones(1), np.array([2])), "label has the data type int64, expected text"),
        (
            with_parts(np.ones((1, 4)), np.ones(1), np.array([0], object)),
            "label of detection 0 is 0 of type int, expected text",
        ),
        (with_parts(np.ones((2, 4)), np.ones(2), np.array(["car", None], object)), "label of detection 1 is None"),
        (with_parts(np.ones((1, 4)), np.array(["0.5"])), "score has the data type <U3, expected numbers"),
        (with_parts(np.ones((1, 4)), np.array([np.nan])), "score of detection 0 is nan, expected 0 to 1"),
        (with_parts(np.ones((1, 4)), np.array([97.0])), "score of detection 0 is 97, expected 0 to 1"),
        (with_parts(np.ones((1, 4)), np.array([1.001])), "score of detection 0 is 1.001, expected 0 to 1"),
        (with_parts(np.ones((1, 4)), np.array([-0.5])), "score of detection 0 is -0.5, expected 0 to 1"),
        (with_parts(np.array([[1, 1, np.nan, 5]]), np.ones(1)), "the box of detection 0 is 1 1 nan 5, expected finite"),
        (with_parts(np.array([[1, 1, np.inf, 5]]), np.ones(1)), "the box of detection 0 is 1 1 inf 5, expected finite"),
        (with_parts(np.array([[9, 1, 5, 5]]), np.ones(1)), "the box of detection 0 is 9 1 5 5, expected .*x1 <= x2"),
        (with_parts(np.array([[1, 9, 5, 5]]), np.ones(1)), "the box of detection 0 is 1 9 5 5, expected .*y1 <= y2"),
    ],
)
def test_what_is_no_detection_is_refused_by_the_detector_s_name(answer: Any, words: str) -> None:
    with pytest.raises(InputError, match=f"^detector 'mine': {words}"):
        detections_in(Answering(answer), image(), "mine")


def test_a_detector_s_own_refusal_is_named() -> None:
    with pytest.raises(InputError, match="^detector 'mine': images: image 0 spans"):
        detections_in(Answering([RIGHT]), image() + 2, "mine")


def test_numbers_at_the_ends_and_what_rounding_leaves_beyond_pass() -> None:
    boxes = np.array([[3, 3, 3, 3], [-500, 0, 5000, 1], [1000.0001, 2, 1000, 9]], np.float32)
    score = np.array([1.0, 0.0, 1.000003], np.float32)
    result = detections_in(Answering(with_parts(boxes, score, np.array(["car", "x", ""], object))), image(), "mine")
    assert np.array_equal(result.boxes, boxes) and np.array_equal(result.score, score)
    assert result.boxes.dtype == result.score.dtype == np.float64 and list(result.label) == ["car", "x", ""]
    assert len(detections_in(Answering([Detections.none()]), image(), "mine")) == 0


def test_a_detector_that_works_in_place_changes_neither_the_image_nor_earlier_detections() -> None:
    class Reusing:
        """Gamma in place, and one array for all its answers."""

        def __init__(self) -> None:
            self.score = np.zeros(1)

        def detect(self, images: Any) -> list[Detections]:
            (picture,) = each_image(images)
            np.sqrt(picture, out=picture)
            self.score[0] = picture.mean()
            return with_parts(RIGHT.boxes, self.score)

    picture, detector = image(), Reusing()
    first = detections_in(detector, picture, "mine")
    assert np.array_equal(picture, image())
    assert first.score[0] == pytest.approx(np.sqrt(picture).mean())
    detections_in(detector, np.zeros_like(picture), "mine")
    assert first.score[0] > 0


@pytest.mark.parametrize("name", ["compact", "compact_two_stage"])
def test_built_in_detectors_answer_the_same_as_when_asked_themselves(name: str) -> None:
    picture, detector = image(), create(name, score_floor=0.0)
    (expected,) = detector.detect([picture])
    result = detections_in(detector, picture, name)
    assert len(result) > 0
    for part in ("boxes", "score", "label"):
        assert getattr(result, part).tobytes() == getattr(expected, part).tobytes()
