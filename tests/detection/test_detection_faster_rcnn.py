"""Faster R-CNN: a small network in the form of the Model Zoo's file, whose boxes are known."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest
from detection_makers import bright, onnx, save
from PIL import Image

from pipeline import detection
from pipeline.detection.faster_rcnn import NAMES, FasterRcnn
from pipeline.errors import InputError

MEAN_DN = (102.9801 + 115.9465 + 122.7717) / 3


def tiny_faster_rcnn(path: Path, label: int = 3) -> Path:
    """One image (3, height, width) to boxes (N, 4), labels (N,) int64, scores (N,).

    The first box lies 40 px right of and 80 px below the brightest pixel's column and row, which are its corner; its
    score is that pixel's grey. The second has the same corner, class 1 and a score of 0.3, the third class 0.
    """
    node = onnx().helper.make_node
    constants = {
        "mean": np.float32(MEAN_DN),
        "full": np.float32(255.0),
        "extent": np.array([[0, 0, 40, 80], [0, 0, 20, 20], [0, 0, 9, 9]], np.float32),
        "all_labels": np.array([label, 1, 0]),
        "others": np.array([0.3, 0.9], np.float32),
        "flat": np.array([-1]),
    }
    nodes = [
        node("ReduceMean", ["image"], ["centred"], axes=[0], keepdims=0),
        node("Add", ["centred", "mean"], ["grey"]),
        node("ReduceMax", ["grey"], ["columns"], axes=[0], keepdims=0),
        node("ReduceMax", ["grey"], ["rows"], axes=[1], keepdims=0),
        node("ArgMax", ["columns"], ["x"], axis=0, keepdims=1),
        node("ArgMax", ["rows"], ["y"], axis=0, keepdims=1),
        node("Concat", ["x", "y", "x", "y"], ["corner_int"], axis=0),
        node("Cast", ["corner_int"], ["corner"], to=1),
        node("Add", ["extent", "corner"], ["6379"]),
        node("ReduceMax", ["grey"], ["best_dn"], keepdims=0),
        node("Div", ["best_dn", "full"], ["best"]),
        node("Reshape", ["best", "flat"], ["best1"]),
        node("Concat", ["best1", "others"], ["6383"], axis=0),
        node("Identity", ["all_labels"], ["6381"]),
    ]
    inputs = {"image": ((3, "height", "width"), 1)}
    outputs = {"6379": (("nbox", 4), 1), "6381": (("nbox",), 7), "6383": (("nbox",), 1)}
    return save(path, nodes, constants, inputs, outputs)


@pytest.fixture(scope="module")
def network(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tiny_faster_rcnn(tmp_path_factory.mktemp("faster_rcnn") / "FasterRCNN-10.onnx")


def test_boxes_are_divided_by_the_scale(network: Path) -> None:
    """400 px become 800: the corner (100, 200) lies at (200, 400), its box is 40 x 80 px there, 20 x 40 here."""
    image = bright(400, 600, (100, 200, 104, 204), 0.9)
    selected = detection.create("faster_rcnn", weights=network).detect([image])[0]
    assert list(selected.label) == ["car", "person"]
    np.testing.assert_allclose(selected.score, [0.9, 0.3], atol=0.01)
    np.testing.assert_allclose(selected.boxes[0], [100, 200, 120, 240], atol=1.0)  # bilinear smears the corner
    np.testing.assert_allclose(selected.boxes[0, 2:] - selected.boxes[0, :2], [20, 40], atol=1e-4)


def test_paper_mode_keeps_scores_from_one_half_and_cuts_corners(network: Path) -> None:
    image = bright(375, 500, (101, 203, 105, 207), 0.9)
    selected = detection.create("faster_rcnn", weights=network, mode="paper").detect([image])[0]
    assert list(selected.label) == ["car"]
    np.testing.assert_array_equal(selected.boxes, np.trunc(selected.boxes))
    weak = detection.create("faster_rcnn", weights=network, mode="paper").detect([image * np.float32(0.5)])[0]
    assert len(weak) == 0


def test_full_mode_clips_to_the_image_and_the_paper_does_not(network: Path) -> None:
    image = bright(800, 800, (790, 790, 794, 794))
    full = detection.create("faster_rcnn", weights=network, score_floor=0.5).detect([image])[0].boxes[0]
    paper = detection.create("faster_rcnn", weights=network, mode="paper").detect([image])[0].boxes[0]
    assert full[2] == full[3] == 800
    np.testing.assert_allclose(paper, [790, 790, 830, 870], atol=1)


def test_the_input_is_the_published_preprocessing(network: Path) -> None:
    """Eight-bit grey in three channels: Pillow, blue green red, minus the means, zeros to multiples of 32."""
    dn = np.random.Generator(np.random.Philox(3)).integers(0, 256, size=(375, 1242), dtype=np.uint8)
    picture = Image.fromarray(np.repeat(dn[..., None], 3, axis=2))
    ratio = 800.0 / min(picture.size)
    picture = picture.resize((int(ratio * 1242), int(ratio * 375)), Image.Resampling.BILINEAR)
    expected = np.array(picture)[:, :, [2, 1, 0]].astype("float32").transpose(2, 0, 1)
    for channel, mean in enumerate([102.9801, 115.9465, 122.7717]):
        expected[channel] -= mean
    tensor, scale = FasterRcnn(network, mode="paper").prepare(dn.astype(np.float32) / np.float32(255))
    assert scale == ratio
    assert tensor.shape == (3, 800, 2656)  # the authors' 2649 px, padded
    np.testing.assert_allclose(tensor[:, :800, : expected.shape[2]], expected, atol=1e-4)
    assert not tensor[:, :, expected.shape[2] :].any()
    floats, _ = FasterRcnn(network).prepare(dn.astype(np.float32) / np.float32(255))
    assert 0 < np.abs(floats - tensor).max() < 1.5  # rounding of an 8-bit resize


def test_the_longer_side_can_be_limited(network: Path) -> None:
    image = bright(375, 1242, (600, 200, 606, 206), 0.9)
    detector = detection.create("faster_rcnn", weights=network, longest_px=1333)
    tensor, scale = detector.prepare(image)
    assert tensor.shape == (3, 416, 1344) and scale == pytest.approx(1333 / 1242)
    np.testing.assert_allclose(detector.detect([image])[0].boxes[0, :2], [600, 200], atol=2.0)


def test_names_begin_with_the_background() -> None:
    assert len(NAMES) == 81 and NAMES[0] == "__background__" and NAMES[3] == "car"


def test_survives_the_way_to_another_process(network: Path) -> None:
    detector = detection.create("faster_rcnn", weights=network, shortest_px=64)
    image = bright(64, 96, (30, 30, 34, 34))
    again = pickle.loads(pickle.dumps(detector)).detect([image])[0]
    np.testing.assert_array_equal(again.boxes, detector.detect([image])[0].boxes)


def test_files_that_are_no_faster_rcnn_are_named(tmp_path: Path, network: Path) -> None:
    with pytest.raises(InputError, match="no such model file"):
        detection.create("faster_rcnn", weights=tmp_path / "absent.onnx")
    with pytest.raises(InputError, match="SHA-256"):
        detection.create("faster_rcnn", weights=network, sha256="0" * 64)
    node = onnx().helper.make_node("Identity", ["image"], ["output"])
    for name, shape, words in (
        ("batch", (1, 3, 64, 64), "expected one of"),
        ("plain", (3, 64, 64), "expected boxes"),
    ):
        wrong = save(tmp_path / f"{name}.onnx", [node], {}, {"image": (shape, 1)}, {"output": (shape, 1)})
        with pytest.raises(InputError, match=f"{words}.*not the Faster R-CNN"):
            detection.create("faster_rcnn", weights=wrong)
    (tmp_path / "broken.onnx").write_bytes(network.read_bytes()[:100])
    with pytest.raises(InputError, match=r"broken\.onnx: not an ONNX network"):
        detection.create("faster_rcnn", weights=tmp_path / "broken.onnx")
    with pytest.raises(InputError, match="class number 99, but 81 labels"):
        detector = detection.create("faster_rcnn", weights=tiny_faster_rcnn(tmp_path / "far.onnx", label=99))
        detector.detect([bright(800, 800, (10, 10, 12, 12))])


@pytest.mark.parametrize(
    "option",
    [
        {"mode": "fast"},
        {"score_floor": 1.5},
        {"max_detections": 0},
        {"threads": 0},
        {"shortest_px": 8},
        {"longest_px": 100},
    ],
)
def test_options_out_of_range_are_named(network: Path, option: dict[str, object]) -> None:
    with pytest.raises(InputError, match=next(iter(option))):
        detection.create("faster_rcnn", weights=network, **option)
