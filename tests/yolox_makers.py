"""A tiny network in YOLOX's form, for tests of the detector and of sweeps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

LABELS = ["person", "car", "bicycle"]


def tiny_yolox(path: Path, size: int | str = 64, classes: int = 3) -> Path:
    """A network in YOLOX's form: each cell's objectness is its mean grey / 255, its class is 1, its box is the cell."""
    onnx = pytest.importorskip("onnx")
    helper, array = onnx.helper, onnx.numpy_helper.from_array
    columns = 5 + classes
    nodes, constants, parts = [], [array(np.array([1, columns, -1]), "rows")], []
    for stride in (8, 16, 32):
        weight = np.zeros((columns, 3, stride, stride), np.float32)
        weight[4] = 1.0 / (255.0 * 3 * stride * stride)
        bias = np.zeros(columns, np.float32)
        bias[:2], bias[6] = 0.5, 1.0
        constants += [array(weight, f"w{stride}"), array(bias, f"b{stride}")]
        nodes += [
            helper.make_node(
                "Conv", ["images", f"w{stride}", f"b{stride}"], [f"c{stride}"], strides=[stride] * 2,
            ),
            helper.make_node("Reshape", [f"c{stride}", "rows"], [f"r{stride}"]),
        ]  # fmt: skip
        parts.append(f"r{stride}")
    nodes += [
        helper.make_node("Concat", parts, ["all"], axis=2),
        helper.make_node("Transpose", ["all"], ["output"], perm=[0, 2, 1]),
    ]
    cells = sum((size // stride) ** 2 for stride in (8, 16, 32)) if isinstance(size, int) else "cells"
    graph = helper.make_graph(
        nodes,
        "tiny",
        [helper.make_tensor_value_info("images", 1, [1, 3, size, size])],
        [helper.make_tensor_value_info("output", 1, [1, cells, columns])],
        constants,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    onnx.save(model, str(path))
    return path


def weights_apart(folder: Path) -> Path:
    """`tiny_yolox` as tiny.onnx, whose weights lie in tiny.onnx.data."""
    onnx = pytest.importorskip("onnx")
    path = tiny_yolox(folder / "tiny.onnx")
    model = onnx.load(str(path))
    onnx.save(model, str(path), save_as_external_data=True, location="tiny.onnx.data", size_threshold=0)
    return path
