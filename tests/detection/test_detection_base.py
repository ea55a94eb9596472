"""Contracts of detections and images, suppression, letter box, text files, class maps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline import detection
from pipeline.datasets.frame import Box, Frame
from pipeline.detection.average_precision import evaluate
from pipeline.detection.base import Detections, each_image
from pipeline.detection.classes import CLASS_MAPS, ClassMap
from pipeline.detection.letterbox import letterbox
from pipeline.detection.nms import suppress
from pipeline.errors import InputError
from pipeline.streams import stream


def random_detections(count: int, *key: int) -> Detections:
    draw = stream(5, "boxes", *key)
    corner, size = draw.uniform(0, 200, (count, 2)), draw.uniform(5, 90, (count, 2))
    words = np.array(["car", "traffic light", "person"])
    return Detections.of(np.hstack([corner, corner + size]), draw.random(count), words[draw.integers(0, 3, count)])


def test_detections_check_their_parts() -> None:
    assert len(Detections.none()) == 0
    assert Detections.none().boxes.shape == (0, 4)
    with pytest.raises(InputError, match="2 scores"):
        Detections.of([[0, 0, 1, 1]], [0.5, 0.6], ["car"])
    with pytest.raises(InputError, match="shape"):
        Detections.of([[0, 0, 1]], [0.5], ["car"])
    with pytest.raises(InputError, match="finite"):
        Detections.of([[0, 0, 1, np.nan]], [0.5], ["car"])


def test_the_best_detections_come_first_and_equal_scores_keep_their_order() -> None:
    many = Detections.of([[k, 0, k + 1, 1] for k in range(5)], [0.2, 0.9, 0.5, 0.9, 0.5], ["a", "b", "c", "d", "e"])
    assert list(many.best(3).label) == ["b", "d", "c"]
    assert list(many.best(9).label) == list(many.best().label) == ["b", "d", "c", "e", "a"] and len(many.best(0)) == 0


def test_detections_are_chosen_by_score_and_label() -> None:
    result = Detections.of([[0, 0, 1, 1], [2, 2, 3, 3], [4, 4, 5, 5]], [0.9, 0.5, 0.2], ["car", "person", "car"])
    assert list(result.above(0.5).score) == [0.9, 0.5]
    assert list(result.called("car").score) == [0.9, 0.2]


@pytest.mark.parametrize(
    ("images", "words"),
    [
        ([np.zeros((4, 4), np.uint8)], "image 0 is uint8"),
        ([np.zeros((4, 4)), np.full((4, 4), np.nan)], "image 1 spans nan"),
        ([np.full((4, 4), 2.0)], "spans 2 .. 2"),
        ([np.zeros((3, 4, 4))], "shape"),
        ([np.zeros(4)], "shape"),
        ([np.zeros((0, 4))], "shape"),
        (np.zeros((4, 4)), "use \\[picture\\]"),
        ([np.zeros((4, 4)), np.ma.masked_less(np.zeros((4, 4)), 0.5)], "image 1 is a masked array"),
        (np.ma.masked_less(np.zeros((1, 1, 4, 4)), 0.5), "image 0 is a masked array"),
    ],
)
def test_wrong_images_are_named(images: object, words: str) -> None:
    with pytest.raises(InputError, match=words):
        list(each_image(images))  # type: ignore[arg-type]


def test_images_come_in_many_shapes() -> None:
    import torch

    batch = np.zeros((3, 1, 5, 7), np.float32)
    shapes = [image.shape for image in each_image([batch, batch[0], batch[0, 0], torch.zeros(2, 1, 4, 4)])]
    assert shapes == [(5, 7)] * 5 + [(4, 4)] * 2
    assert len(list(each_image(batch))) == 3
    assert list(each_image([])) == []


def greedy(boxes: np.ndarray, score: np.ndarray, kind: np.ndarray, iou_threshold: float) -> list[int]:
    """Suppression by its definition."""
    kept: list[int] = []
    for index in np.argsort(-score, kind="stable"):
        for other in kept:
            low, high = np.maximum(boxes[index, :2], boxes[other, :2]), np.minimum(boxes[index, 2:], boxes[other, 2:])
            shared = np.prod(np.maximum(high - low, 0.0))
            union = sum(np.prod(boxes[k, 2:] - boxes[k, :2]) for k in (index, other)) - shared
            if kind[index] == kind[other] and shared / union > iou_threshold:
                break
        else:
            kept.append(int(index))
    return kept


@given(count=st.integers(0, 60), key=st.integers(0, 10_000), iou_threshold=st.floats(0.05, 0.95))
def test_suppression_is_greedy_within_classes(count: int, key: int, iou_threshold: float) -> None:
    result = random_detections(count, key)
    kind = stream(6, "kind", key).integers(0, 3, count)
    expected = greedy(result.boxes, result.score, kind, iou_threshold)
    assert suppress(result.boxes, result.score, kind, iou_threshold).tolist() == expected
    assert suppress(result.boxes, result.score, kind, iou_threshold, max_detections=3).tolist() == expected[:3]


def test_suppression_tells_classes_apart_left_of_and_above_zero() -> None:
    boxes = np.array([[900.0, 900, 1000, 1000], [-101, -101, -1, -1], [-100, -101, -1, -1]])
    kept = suppress(boxes, np.array([0.9, 0.8, 0.7]), np.array([0, 1, 1]), 0.5)
    assert kept.tolist() == [0, 1]


@given(
    width=st.integers(20, 400),
    height=st.integers(20, 400),
    canvas=st.tuples(st.integers(2, 12), st.integers(2, 12)),
    centred=st.booleans(),
)
def test_letterbox_takes_boxes_back(width: int, height: int, canvas: tuple[int, int], centred: bool) -> None:
    image = np.full((height, width), 0.25, np.float32)
    fitted, placement = letterbox(image, canvas[0] * 32, canvas[1] * 32, fill=0.75, centred=centred)
    assert fitted.shape == (canvas[1] * 32, canvas[0] * 32)
    inside = np.argwhere(np.isclose(fitted, 0.25))
    (top, left), (bottom, right) = inside.min(axis=0), inside.max(axis=0) + 1
    back = placement.undo(np.array([[left, top, right, bottom]]))
    slack = 1.0 / placement.scale  # the inner size and the margins are whole pixels
    np.testing.assert_allclose(back, [[0, 0, width, height]], atol=slack + 1e-6)
    assert np.isclose(fitted, 0.75).sum() == fitted.size - (bottom - top) * (right - left)


def test_class_maps_say_what_counts() -> None:
    boxes = [
        Box("Car", 0, 0, 50, 40),
        Box("Car", 0, 0, 50, 20),  # too low
        Box("Car", 0, 0, 50, 40, visible_fraction=0.2),  # too hidden
        Box("Car", 0, 0, 50, 40, ignore=True),
        Box("Van", 0, 0, 50, 40),
        Box("Cyclist", 0, 0, 50, 40),
        Box("DontCare", 0, 0, 9, 9, ignore=True),
        Box("Tree", 0, 0, 9, 9),
        Box("Pedestrian", 0, 0, 20, 60),
    ]
    wanted = CLASS_MAPS["kitti"].truth(boxes, min_height_px=25, min_visible_fraction=0.3)
    car, person = wanted.called("car"), wanted.called("person")
    assert list(car.ignore) == [False, True, True, True, True, True]
    assert list(person.ignore) == [True, True, False]
    assert CLASS_MAPS["sim"].truth([]).boxes.shape == (0, 4)


def test_frames_are_judged_by_height_and_visibility() -> None:
    frames = [
        Frame("sim", "a", Path("a.png"), (Box("car", 10, 10, 60, 60, visible_fraction=1.0),)),
        Frame("sim", "b", Path("b.png"), (Box("car", 10, 10, 60, 60, visible_fraction=0.1),)),
        Frame("sim", "c", Path("c.png")),
    ]
    words, two = (
        ClassMap({"car": "car", "person": "person"}),
        Detections.of([[10, 10, 60, 60], [100, 10, 120, 60]], [0.9, 0.8], ["car", "car"]),
    )
    truths = [words.truth(frame.boxes, min_visible_fraction=0.3) for frame in frames]
    result = evaluate([two] * 3, truths, words.classes, generator=stream(0, "bootstrap"))
    car = result["car"]
    assert (car.objects, car.objects_ignored, car.true_positives, car.ignored, car.false_positives) == (1, 1, 1, 1, 4)
    assert car.average_precision == 1.0  # equal scores rank in frame order, and the right one is in the first frame
    assert result["person"].objects == 0
    assert np.isnan(result["person"].average_precision)


def test_unknown_detector_is_named() -> None:
    with pytest.raises(InputError, match="did you mean 'yolox'"):
        detection.create("yolo-x", weights="a.onnx")


def test_a_detector_is_opened_once_for_the_same_options(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[tuple[str, dict[str, str]]] = []

    class Named:
        """Stands for a detector."""

    def create(name: str, **options: str) -> Named:
        opened.append((name, options))
        return Named()

    monkeypatch.setattr(detection, "create", create)
    detection.opened.cache_clear()
    try:
        first = detection.opened("yolox", '{"weights": "a.onnx"}')
        assert detection.opened("yolox", '{"weights": "a.onnx"}') is first
        assert detection.opened("yolox", '{"weights": "b.onnx"}') is not first
        assert opened == [("yolox", {"weights": "a.onnx"}), ("yolox", {"weights": "b.onnx"})]
    finally:
        detection.opened.cache_clear()
