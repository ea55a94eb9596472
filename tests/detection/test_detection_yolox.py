"""YOLOX: a tiny network made here whose answer is known, the real one on real frames, and files that are no YOLOX."""

from __future__ import annotations

import pickle
from pathlib import Path

import cv2
import numpy as np
import pytest
from yolox_makers import LABELS, tiny_yolox

from pipeline import detection
from pipeline.datasets.frame import Frame
from pipeline.datasets.kitti import Kitti
from pipeline.detection import coco
from pipeline.detection.average_precision import evaluate
from pipeline.detection.classes import CLASS_MAPS
from pipeline.detection.yolox import decode
from pipeline.errors import InputError
from pipeline.streams import stream


def test_one_bright_cell_is_one_box(tmp_path: Path) -> None:
    detector = detection.create("yolox", weights=tiny_yolox(tmp_path / "t.onnx"), labels=LABELS, score_floor=0.5)
    image = np.zeros((64, 64), np.float32)
    image[16:24, 40:48] = 0.8
    selected = detector.detect([image])[0]
    assert list(selected.label) == ["car"]
    np.testing.assert_allclose(selected.boxes, [[40, 16, 48, 24]], atol=1e-5)
    np.testing.assert_allclose(selected.score, [0.8], atol=1e-5)


def test_boxes_come_back_from_a_scaled_and_padded_canvas(tmp_path: Path) -> None:
    """Twice the size, top left: a square of 4 px covers one cell of the canvas. The margin (114) stays outside."""
    detector = detection.create("yolox", weights=tiny_yolox(tmp_path / "t.onnx"), labels=LABELS, score_floor=0.6)
    image = np.zeros((20, 32), np.float32)
    image[7:13, 11:17] = 1.0
    selected = detector.detect([image])[0]
    np.testing.assert_allclose(selected.boxes, [[12, 8, 16, 12]], atol=1e-5)


def test_the_margin_is_filled_with_114(tmp_path: Path) -> None:
    """White fills the upper 40 of 64 rows: the lower cell of 32 px is a quarter white and three quarters margin."""
    detector = detection.create("yolox", weights=tiny_yolox(tmp_path / "t.onnx"), labels=LABELS, score_floor=0.5)
    score = detector.detect([np.ones((20, 32), np.float32)])[0].score
    assert np.abs(score - (0.25 + 0.75 * 114 / 255)).min() < 1e-4


@pytest.mark.parametrize("size", [64, "side"])
def test_input_size_follows_the_request(tmp_path: Path, size: int | str) -> None:
    """A file with a fixed size is rewritten, one with an open size is used as it is; both give the same."""
    path = tiny_yolox(tmp_path / "t.onnx", size)
    detector = detection.create("yolox", weights=path, labels=LABELS, score_floor=0.5, input_px=160)
    image = np.zeros((96, 160), np.float32)
    image[88:96, 152:160] = 1.0
    np.testing.assert_allclose(detector.detect([image])[0].boxes, [[152, 88, 160, 96]], atol=1e-5)
    assert detector.canvas_px(160, 96) == (160, 96)  # type: ignore[attr-defined]
    assert detector.canvas_px(1242, 375) == (160, 64)  # type: ignore[attr-defined]
    both = detection.create("yolox", weights=path, labels=LABELS, score_floor=0.5, input_px=[160, 96])
    np.testing.assert_allclose(both.detect([image])[0].boxes, [[152, 88, 160, 96]], atol=1e-5)


def test_many_images_keep_their_order_and_nothing_is_nothing(tmp_path: Path) -> None:
    detector = detection.create("yolox", weights=tiny_yolox(tmp_path / "t.onnx"), labels=LABELS, score_floor=0.5)
    batch = np.zeros((3, 1, 64, 64), np.float32)
    batch[1, 0, :8, :8] = 1.0
    assert [len(item) for item in detector.detect([batch, batch[1, 0]])] == [0, 1, 0, 1]
    assert detector.detect([]) == []


def test_the_number_of_boxes_is_limited_best_first(tmp_path: Path) -> None:
    path = tiny_yolox(tmp_path / "t.onnx")
    image = stream(1, "image").random((64, 64)).astype(np.float32)
    selected = detection.create("yolox", weights=path, labels=LABELS, max_detections=5).detect([image])[0]
    every = detection.create("yolox", weights=path, labels=LABELS).detect([image])[0]
    assert len(selected) == 5 < len(every)
    np.testing.assert_array_equal(selected.score, every.score[:5])
    assert np.all(np.diff(every.score) <= 0)


def test_survives_the_way_to_another_process(tmp_path: Path) -> None:
    detector = detection.create("yolox", weights=tiny_yolox(tmp_path / "t.onnx"), labels=LABELS, score_floor=0.5)
    image = np.ones((64, 64), np.float32)
    again = pickle.loads(pickle.dumps(detector))
    np.testing.assert_array_equal(again.detect([image])[0].boxes, detector.detect([image])[0].boxes)


def test_files_that_are_no_yolox_are_named(tmp_path: Path) -> None:
    good = tiny_yolox(tmp_path / "good.onnx")
    with pytest.raises(InputError, match="no such model file"):
        detection.create("yolox", weights=tmp_path / "absent.onnx")
    (tmp_path / "broken.onnx").write_bytes(good.read_bytes()[:200])
    with pytest.raises(InputError, match=r"broken\.onnx: not an ONNX network"):
        detection.create("yolox", weights=tmp_path / "broken.onnx")
    (tmp_path / "empty.onnx").write_bytes(b"")
    with pytest.raises(InputError, match=r"empty\.onnx"):
        detection.create("yolox", weights=tmp_path / "empty.onnx")
    with pytest.raises(InputError, match="not a YOLOX of 80 classes"):
        detection.create("yolox", weights=good)
    with pytest.raises(InputError, match="SHA-256"):
        detection.create("yolox", weights=good, labels=LABELS, sha256="0" * 64)
    with pytest.raises(InputError, match="give input_px"):
        detection.create("yolox", weights=tiny_yolox(tmp_path / "open.onnx", "side"), labels=LABELS)


@pytest.mark.parametrize(
    "option",
    [
        {"input_px": 16}, {"input_px": (100, 64)}, {"input_px": (64, 64, 64)}, {"score_floor": 2.0},
        {"iou_threshold": -0.1}, {"max_detections": 0}, {"threads": 0}, {"input_size": 3},
    ],
)  # fmt: skip
def test_options_out_of_range_are_named(tmp_path: Path, option: dict[str, object]) -> None:
    with pytest.raises(InputError, match=next(iter(option))):
        detection.create("yolox", weights=tiny_yolox(tmp_path / "t.onnx"), labels=LABELS, **option)


def test_rewriting_without_onnx_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    detector = detection.create("yolox", weights=tiny_yolox(tmp_path / "t.onnx"), labels=LABELS, input_px=96)
    monkeypatch.setitem(__import__("sys").modules, "onnx", None)
    with pytest.raises(InputError, match="pip install onnx"):
        detector.detect([np.zeros((96, 96), np.float32)])


def test_cells_are_numbered_row_by_row_from_the_finest_grid() -> None:
    zero = np.zeros((4, 4), np.float32)
    cells = np.array([0, 1, 8, 8 * 4])  # canvas 64 x 32: 8 x 4 cells of 8 px, then 4 x 2 of 16 px
    boxes = decode(zero, cells, 64, 32)
    centres = (boxes[:, :2] + boxes[:, 2:]) / 2
    np.testing.assert_allclose(centres, [[0, 0], [8, 0], [0, 8], [0, 0]])
    np.testing.assert_allclose(boxes[:, 2] - boxes[:, 0], [8, 8, 8, 16])


def test_names_are_cocos() -> None:
    assert len(coco.NAMES) == len(set(coco.NAMES)) == 80
    assert (coco.NAMES[0], coco.NAMES[2], coco.NAMES[9], coco.NAMES[79]) == (
        "person", "car", "traffic light", "toothbrush",
    )  # fmt: skip


@pytest.fixture
def kitti(shared: Path) -> list[Frame]:
    return Kitti("kitti", shared / "realdata" / "kitti").frames()


@pytest.fixture
def nano(shared: Path) -> Path:
    path = shared / "weights" / "yolox_nano.onnx"
    if not path.is_file():
        pytest.skip("reference data absent: ../shared/weights/yolox_nano.onnx")
    return path


@pytest.mark.shared
def test_equals_another_runtime_and_a_plain_decoder(nano: Path, kitti: list[Frame]) -> None:
    """The network in OpenCV, decoded cell by cell in plain Python."""
    image = kitti[0].image()
    selected = detection.create("yolox", weights=nano, score_floor=0.3).detect([image])[0]
    scale = 416 / image.shape[1]
    canvas = np.full((416, 416), 114, np.float32)
    inner = cv2.resize(image * 255, (416, round(image.shape[0] * scale)))
    canvas[: len(inner)] = inner
    network = cv2.dnn.readNetFromONNX(str(nano))
    network.setInput(np.repeat(canvas[None, None], 3, axis=1))
    rows = iter(network.forward()[0])
    expected = []
    for stride in (8, 16, 32):
        for y in range(416 // stride):
            for x in range(416 // stride):
                row = next(rows)
                kind = int(np.argmax(row[5:]))
                if row[4] * row[5 + kind] >= 0.3:
                    cx, cy = (row[0] + x) * stride, (row[1] + y) * stride
                    w, h = np.exp(row[2]) * stride, np.exp(row[3]) * stride
                    box = np.array([cx - w / 2, cy - h / 2, cx + w / 2, cy + h / 2]) / scale
                    expected.append((float(row[4] * row[5 + kind]), coco.NAMES[kind], box))
    assert len(selected) > 0
    for box, score, label in zip(selected.boxes, selected.score, selected.label, strict=True):
        same = [entry for entry in expected if entry[1] == label and abs(entry[0] - score) < 1e-3]
        limits = [image.shape[1], image.shape[0]] * 2
        assert any(np.abs(np.clip(entry[2], 0, limits) - box).max() < 0.1 for entry in same)
    assert max(entry[0] for entry in expected) == pytest.approx(selected.score[0], abs=1e-3)


@pytest.mark.shared
def test_finds_the_cars_of_real_streets(nano: Path, kitti: list[Frame]) -> None:
    """16 grey KITTI frames at 1280 px: measured car 92.8 %, person 76.2 % (10 people); bar for cars 80 %."""
    detector = detection.create("yolox", weights=nano, input_px=1280)
    words = CLASS_MAPS["kitti"]
    truths = [words.truth(frame.boxes, min_height_px=25) for frame in kitti]
    results = [detector.detect([frame.image()])[0] for frame in kitti]
    result = evaluate(results, truths, words.classes, generator=stream(0, "bootstrap"))
    assert result["car"].objects == 17
    assert result["car"].average_precision > 0.85
    assert result["car"].low <= result["car"].average_precision <= result["car"].high
    assert result["person"].average_precision > 0.6


@pytest.mark.shared
def test_another_network_is_not_mistaken_for_a_yolox(shared: Path) -> None:
    with pytest.raises(InputError, match="not a YOLOX"):
        detection.create("yolox", weights=shared / "weights" / "nanodet_m.onnx")
