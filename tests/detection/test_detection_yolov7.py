"""YOLOv7: small networks in the forms of the official export, whose boxes are known, and forms that are refused."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from detection_makers import STRIDES, bright, grids, onnx, save

from pipeline import detection
from pipeline.detection.yolov4 import ANCHORS_PX
from pipeline.detection.yolov7 import decode
from pipeline.errors import InputError

Form = Literal["grid", "grid_and_maps", "maps", "end2end", "tensorrt"]
CLASSES = 80
COLUMNS = 5 + CLASSES


def tiny_yolov7(path: Path, form: Form, size: tuple[int, int] = (640, 640), open_size: bool = False) -> Path:
    """A network (1, 3, H, W) with the outputs of one form of export; see `detection_makers` for what it finds."""
    node = onnx().helper.make_node
    height, width = size
    raw = form == "maps"
    boxes = {}
    for level, stride in enumerate(STRIDES):
        half = np.sqrt(stride / ANCHORS_PX[level]) / 2  # (2 t)^2 anchor = stride
        boxes[stride] = (
            np.concatenate([np.zeros((3, 2)), np.log(half / (1 - half))], axis=1) if raw else np.zeros((3, 4))
        )
    nodes, constants = grids(CLASSES, boxes, certain=40.0 if raw else 1.0, silent=-40.0 if raw else 0.0)
    nodes.insert(0, node("Identity", ["images"], ["planar"]))
    outputs: dict[str, Any] = {}
    places = []
    for stride in STRIDES:
        rows, columns = height // stride, width // stride
        constants[f"s{stride}"] = np.array([1, 3, COLUMNS, rows, columns])
        nodes.append(node("Reshape", [f"c{stride}", f"s{stride}"], [f"m{stride}"]))
        nodes.append(node("Transpose", [f"m{stride}"], [f"map{stride}"], perm=[0, 1, 3, 4, 2]))
        y, x = np.mgrid[:rows, :columns]
        position = np.zeros((3, rows, columns, COLUMNS), np.float32)
        position[..., 0], position[..., 1] = (x + 0.5) * stride, (y + 0.5) * stride
        position[..., 2:4] = stride
        places.append(position.reshape(-1, COLUMNS))
        if form in ("maps", "grid_and_maps"):
            outputs[f"map{stride}"] = ((1, 3, rows, columns, COLUMNS), 1)
    if not raw:
        constants["rows"] = np.array([1, -1, COLUMNS])
        constants["places"] = np.concatenate(places)[None]
        nodes += [node("Reshape", [f"map{stride}", "rows"], [f"rows{stride}"]) for stride in STRIDES]
        nodes.append(node("Concat", [f"rows{stride}" for stride in STRIDES], ["found"], axis=1))
        nodes.append(node("Add", ["found", "places"], ["output"]))
    if form in ("grid", "grid_and_maps"):
        cells = len(constants["places"][0])
        outputs = {"output": ((1, cells, COLUMNS), 1), **outputs}
    elif form == "end2end":
        nodes, constants = _suppressed(nodes, constants)
        outputs = {"suppressed": (("boxes", 7), 1)}
    elif form == "tensorrt":
        names = ["num_dets", "det_boxes", "det_scores", "det_classes"]
        nodes.append(node("EfficientNMS_TRT", ["output"], names, domain="TRT"))
        outputs = dict.fromkeys(names, ((1, 100), 7))
    sides = ("height", "width") if open_size else (height, width)
    return save(path, nodes, constants, {"images": ((1, 3, *sides), 1)}, outputs)


def _suppressed(nodes: list[Any], constants: dict[str, np.ndarray]) -> tuple[list[Any], dict[str, np.ndarray]]:
    """The best two rows as image number, corners, class and score; score = objectness, as the class is certain."""
    node = onnx().helper.make_node
    corners = np.zeros((COLUMNS, 7), np.float32)  # image, x1, y1, x2, y2, class, score from a decoded row
    corners[0, [1, 3]] = corners[1, [2, 4]] = 1.0
    corners[2, 1] = corners[3, 2] = -0.5
    corners[2, 3] = corners[3, 4] = 0.5
    corners[4, 6] = 1.0
    corners[7, 5] = 2.0  # column of class 2
    constants |= {"objectness": np.array(4), "two": np.array([2]), "flat": np.array([-1]), "corners": corners}
    constants["rows2"] = np.array([2, COLUMNS])
    nodes += [
        node("Gather", ["output", "objectness"], ["scores"], axis=2),
        node("TopK", ["scores", "two"], ["best", "which"], axis=1),
        node("Reshape", ["which", "flat"], ["indices"]),
        node("Gather", ["output", "indices"], ["picked"], axis=1),
        node("Reshape", ["picked", "rows2"], ["picked2"]),
        node("MatMul", ["picked2", "corners"], ["suppressed"]),
    ]
    return nodes, constants


@pytest.mark.parametrize("form", ["grid", "grid_and_maps", "end2end"])
def test_a_bright_cell_is_a_box_back_in_the_image(tmp_path: Path, form: Form) -> None:
    """1280 x 720 px: half the size on the canvas of 640 x 640, 140 px down; 16 px of the image are one cell."""
    detector = detection.create("yolov7", weights=tiny_yolov7(tmp_path / "t.onnx", form), score_floor=0.6)
    selected = detector.detect([bright(720, 1280, (160, 88, 176, 104), 0.8)])[0]
    assert list(selected.label) == ["car"]
    np.testing.assert_allclose(selected.boxes, [[160, 88, 176, 104]], atol=1e-3)
    np.testing.assert_allclose(selected.score, [0.8], atol=1e-5)


def test_raw_maps_are_decoded(tmp_path: Path) -> None:
    """Logits: a mean grey of 0.8 is a score of sigmoid(0.8)."""
    detector = detection.create("yolov7", weights=tiny_yolov7(tmp_path / "t.onnx", "maps"), score_floor=0.68)
    selected = detector.detect([bright(720, 1280, (160, 88, 176, 104), 0.8)])[0]
    np.testing.assert_allclose(selected.boxes, [[160, 88, 176, 104]], atol=1e-3)
    np.testing.assert_allclose(selected.score, [1 / (1 + np.exp(-0.8))], atol=1e-5)
    assert list(selected.label) == ["car"]


def test_decoding_equals_the_published_formula() -> None:
    raw = np.random.Generator(np.random.Philox(2)).normal(size=(1, 3, 2, 4, 9)).astype(np.float32)
    rows = decode(raw, 1)
    t = 1 / (1 + np.exp(-raw.astype(float)))
    for a, y, x in np.ndindex(3, 2, 4):
        row, one = rows[(a * 2 + y) * 4 + x], t[0, a, y, x]
        np.testing.assert_allclose(row[0], (2 * one[0] - 0.5 + x) * 16)
        np.testing.assert_allclose(row[1], (2 * one[1] - 0.5 + y) * 16)
        np.testing.assert_allclose(row[2:4], (2 * one[2:4]) ** 2 * [[36, 75], [76, 55], [72, 146]][a])
        np.testing.assert_allclose(row[4:], one[4:])


def test_the_margin_is_114_and_centred(tmp_path: Path) -> None:
    """White 640 x 636 px: 2 px of margin above, so that the first row of cells is a quarter margin."""
    detector = detection.create("yolov7", weights=tiny_yolov7(tmp_path / "t.onnx", "grid"), max_detections=10_000)
    score = detector.detect([np.ones((636, 640), np.float32)])[0].score
    assert np.count_nonzero(np.abs(score - (0.75 + 0.25 * 114 / 255)) < 1e-4) == 160


def test_paper_mode_has_the_exports_thresholds(tmp_path: Path) -> None:
    detector = detection.create("yolov7", weights=tiny_yolov7(tmp_path / "t.onnx", "grid"), mode="paper")
    assert (detector.limits.score_floor, detector.limits.iou_threshold, detector.limits.max_detections) == (
        0.35,
        0.65,
        100,
    )
    image = bright(640, 640, (80, 80, 88, 88), 0.34)
    assert len(detector.detect([image])[0]) == 0
    image[160:168, 160:168] = 0.36
    np.testing.assert_allclose(detector.detect([image])[0].boxes, [[160, 160, 168, 168]], atol=1e-3)


def test_an_oblong_and_an_open_input(tmp_path: Path) -> None:
    image = bright(96, 160, (152, 88, 160, 96))
    oblong = tiny_yolov7(tmp_path / "oblong.onnx", "grid", (96, 160))
    unfixed = tiny_yolov7(tmp_path / "open.onnx", "grid", (96, 160), open_size=True)
    for options in ({"weights": oblong}, {"weights": unfixed, "input_px": [160, 96]}):
        selected = detection.create("yolov7", score_floor=0.5, **options).detect([image])[0]
        np.testing.assert_allclose(selected.boxes, [[152, 88, 160, 96]], atol=1e-3)
    with pytest.raises(InputError, match="give input_px"):
        detection.create("yolov7", weights=unfixed)
    with pytest.raises(InputError, match="fixed to 160 x 96 px"):
        detection.create("yolov7", weights=oblong, input_px=(320, 320))
    for wrong in ([100, 96], [96], 640):
        with pytest.raises(InputError, match="input_px"):
            detection.create("yolov7", weights=unfixed, input_px=wrong)


def test_survives_the_way_to_another_process(tmp_path: Path) -> None:
    detector = detection.create("yolov7", weights=tiny_yolov7(tmp_path / "t.onnx", "grid", (64, 64)))
    image = bright(64, 64, (8, 8, 16, 16))
    again = pickle.loads(pickle.dumps(detector)).detect([image])[0]
    np.testing.assert_array_equal(again.boxes, detector.detect([image])[0].boxes)


def test_other_forms_are_refused_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="exported for TensorRT.*--max-wh") as raised:
        detection.create("yolov7", weights=tiny_yolov7(tmp_path / "trt.onnx", "tensorrt", (64, 64)))
    assert "\n" not in str(raised.value)
    with pytest.raises(InputError, match="not a YOLOv7 of 3 classes"):
        detection.create("yolov7", weights=tiny_yolov7(tmp_path / "g.onnx", "grid", (64, 64)), labels=["a", "b", "c"])
    node = onnx().helper.make_node("Identity", ["images"], ["output"])
    shape = ((1, 3, 64, 64), 1)
    same = save(tmp_path / "same.onnx", [node], {}, {"images": shape}, {"output": shape})
    with pytest.raises(InputError, match="outputs of shape.*64 x 64 px"):
        detection.create("yolov7", weights=same)
    with pytest.raises(InputError, match="no such model file"):
        detection.create("yolov7", weights=tmp_path / "absent.onnx")


def test_a_class_without_a_label_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="class number 2, but 2 labels"):
        detection.create("yolov7", weights=tiny_yolov7(tmp_path / "t.onnx", "end2end", (64, 64)), labels=["a", "b"])
