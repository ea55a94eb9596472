"""YOLOv4: a small network in the form of the Model Zoo's file, whose boxes are known."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from detection_makers import STRIDES, bright, grids, onnx, save

from pipeline import detection
from pipeline.detection.yolov4 import ANCHORS_PX, canvas_of, decode
from pipeline.errors import InputError

EVERY = {"score_floor": 0.6, "iou_threshold": 0.5}


def tiny_yolov4(path: Path, side: int = 416, classes: int = 80, maps: int = 3, grown: float = 1.0) -> Path:
    """Input (batch, side, side, 3), outputs (batch, g, g, 3, 5 + classes) as in the Model Zoo's file.

    A box is its cell, grown by a factor.
    """
    node = onnx().helper.make_node
    boxes = {
        stride: np.concatenate([np.zeros((3, 2)), np.log(grown * stride / ANCHORS_PX[level])], axis=1)
        for level, stride in enumerate(STRIDES)
    }
    nodes, constants = grids(classes, boxes, certain=1.0, silent=0.0)
    nodes.insert(0, node("Transpose", ["input_1:0"], ["planar"], perm=[0, 3, 1, 2]))
    outputs = {}
    for level, stride in enumerate(STRIDES[:maps]):
        cells, name = side // stride, f"Identity_{level}:0"
        constants[f"s{stride}"] = np.array([-1, cells, cells, 3, 5 + classes])
        nodes.append(node("Transpose", [f"c{stride}"], [f"t{stride}"], perm=[0, 2, 3, 1]))
        nodes.append(node("Reshape", [f"t{stride}", f"s{stride}"], [name]))
        outputs[name] = (("n", "h", "w", 3, 5 + classes), 1)
    return save(path, nodes, constants, {"input_1:0": (("batch", side, side, 3), 1)}, outputs)


@pytest.fixture(scope="module")
def network(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tiny_yolov4(tmp_path_factory.mktemp("yolov4") / "yolov4.onnx")


def test_a_bright_cell_is_a_box_back_in_the_image(network: Path) -> None:
    """832 x 416 px: half the size on the canvas, 104 px down; 16 px of the image are one cell."""
    selected = detection.create("yolov4", weights=network, **EVERY).detect([bright(416, 832, (160, 80, 176, 96), 0.8)])[
        0
    ]
    assert list(selected.label) == ["car"]
    np.testing.assert_allclose(selected.boxes, [[160, 80, 176, 96]], atol=1e-4)
    np.testing.assert_allclose(selected.score, [0.8], atol=1e-5)


def test_the_margin_is_128_and_a_box_wholly_in_it_is_none(network: Path) -> None:
    """The half-bright margin scores 0.502 and must not be reported; a cell half in it has the mean of both."""
    detector = detection.create("yolov4", weights=network, mode="paper")
    assert len(detector.detect([np.zeros((416, 832), np.float32)])[0]) == 0
    image = np.zeros((408, 832), np.float32)  # 204 rows on the canvas from row 106: cells 104..112 are 1/4 margin
    image[:16] = 1.0
    scores = detection.create("yolov4", weights=network, score_floor=0.6).detect([image])[0].score
    assert np.abs(scores - (0.25 * 128 / 255 + 0.75)).min() < 1e-4


def test_paper_mode_cuts_corners_and_clips_to_the_last_pixel(network: Path) -> None:
    """Boxes that reach the right border end at 414 of 415 px, where the full mode ends them at 415."""
    image = np.zeros((203, 415), np.float32)
    image[:, 400:] = 1.0
    paper = detection.create("yolov4", weights=network, mode="paper").detect([image])[0]
    assert len(paper) > 0
    np.testing.assert_array_equal(paper.boxes, np.trunc(paper.boxes))
    assert paper.boxes[:, 2].max() == 414 and paper.boxes[:, 3].max() <= 202
    full = detection.create("yolov4", weights=network, score_floor=0.5).detect([image])[0]
    assert full.boxes[:, 2].max() == 415


def test_paper_mode_keeps_scores_above_one_half(network: Path) -> None:
    image = np.zeros((416, 416), np.float32)
    image[80:88, 80:88], image[160:168, 160:168] = 126 / 255, 130 / 255
    selected = detection.create("yolov4", weights=network, mode="paper").detect([image])[0]
    np.testing.assert_allclose(selected.boxes, [[160, 160, 168, 168]], atol=1)  # cut, so 159.99 is 159
    np.testing.assert_allclose(selected.score, [130 / 255], atol=1e-5)
    assert len(detection.create("yolov4", weights=network).detect([image])[0]) == 2


def test_paper_mode_suppresses_at_an_overlap_of_0213(tmp_path: Path) -> None:
    """Boxes of 16 px on neighbouring cells of 8 px share a third of their union."""
    wide = tiny_yolov4(tmp_path / "wide.onnx", grown=2.0)
    image = bright(416, 416, (80, 80, 96, 88))
    assert len(detection.create("yolov4", weights=wide, mode="paper").detect([image])[0]) == 1
    assert len(detection.create("yolov4", weights=wide, mode="paper", iou_threshold=0.34).detect([image])[0]) == 2
    assert len(detection.create("yolov4", weights=wide).detect([image])[0]) == 2


def test_a_picture_of_any_shape_is_placed_as_the_authors_place_it() -> None:
    """Sizes rounded down, integer margins on the way in, un-rounded on the way back."""
    image = (np.arange(375 * 1242, dtype=np.uint32) % 251).astype(np.uint8).reshape(375, 1242)
    canvas, placement = canvas_of(image, 416, unrounded=True)
    ratio = min(416 / 1242, 416 / 375)
    width, height = int(ratio * 1242), int(ratio * 375)
    assert (width, height) == (416, 125)
    expected = np.full((416, 416), 128.0)
    top, left = (416 - height) // 2, (416 - width) // 2
    expected[top : top + height, left : left + width] = cv2.resize(image, (width, height))
    np.testing.assert_array_equal(canvas, expected)
    assert placement.y_px == (416 - ratio * 375) / 2 != top
    assert canvas_of(image, 416, unrounded=False)[1].y_px == top


def test_decoding_equals_the_published_formula() -> None:
    raw = np.random.Generator(np.random.Philox(1)).normal(size=(3 * (16 + 4 + 1), 4))
    boxes = decode(raw, 32)
    sigmoid = lambda t: 1 / (1 + np.exp(-t))  # noqa: E731
    row = 0
    anchors = [12, 16, 19, 36, 40, 28, 36, 75, 76, 55, 72, 146, 142, 110, 192, 243, 459, 401]
    for level, (stride, s) in enumerate(zip((8, 16, 32), (1.2, 1.1, 1.05), strict=True)):
        for y in range(32 // stride):
            for x in range(32 // stride):
                for a in range(3):
                    tx, ty, tw, th = raw[row]
                    cx = (sigmoid(tx) * s - 0.5 * (s - 1) + x) * stride
                    cy = (sigmoid(ty) * s - 0.5 * (s - 1) + y) * stride
                    w, h = (np.exp(t) * anchors[6 * level + 2 * a + i] for i, t in enumerate((tw, th)))
                    np.testing.assert_allclose(boxes[row], [cx - w / 2, cy - h / 2, cx + w / 2, cy + h / 2])
                    row += 1
    assert row == len(raw)


def test_files_that_are_no_yolov4_are_named(tmp_path: Path, network: Path) -> None:
    with pytest.raises(InputError, match="no such model file"):
        detection.create("yolov4", weights=tmp_path / "absent.onnx")
    with pytest.raises(InputError, match="not a YOLOv4 of 3 classes"):
        detection.create("yolov4", weights=network, labels=["a", "b", "c"])
    with pytest.raises(InputError, match="not a YOLOv4 of 80 classes"):
        detection.create("yolov4", weights=tiny_yolov4(tmp_path / "two.onnx", side=64, maps=2))
    planar = onnx().helper.make_node("Identity", ["image"], ["output"])
    shape = ((1, 3, 416, 416), 1)
    nchw = save(tmp_path / "nchw.onnx", [planar], {}, {"image": shape}, {"output": shape})
    with pytest.raises(InputError, match=r"expected an input of \(1, side, side, 3\)"):
        detection.create("yolov4", weights=nchw)


@pytest.mark.parametrize(
    "option", [{"mode": "papers"}, {"score_floor": -1.0}, {"iou_threshold": 2.0}, {"max_detections": 0}, {"threads": 0}]
)
def test_options_out_of_range_are_named(network: Path, option: dict[str, object]) -> None:
    with pytest.raises(InputError, match=next(iter(option))):
        detection.create("yolov4", weights=network, **option)
