"""Small ONNX networks in the exact form of published detectors, whose answer follows from the picture.

Every cell of the finest grid answers for its first anchor: the box is the cell, the objectness its mean grey in [0, 1],
the class is 2 (COCO's car) with certainty. All other anchors and grids say nothing.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

STRIDES = (8, 16, 32)
CAR = 2


def onnx() -> Any:
    """The package onnx, or a skip."""
    return pytest.importorskip("onnx")


def save(path: Path, nodes: list[Any], constants: dict[str, np.ndarray], inputs: Any, outputs: Any) -> Path:
    """Write a graph; inputs and outputs are name -> (shape, element type) with 1 for float32 and 7 for int64."""
    package = onnx()
    helper = package.helper
    infos = [
        [helper.make_tensor_value_info(name, kind, list(shape)) for name, (shape, kind) in entries.items()]
        for entries in (inputs, outputs)
    ]
    tensors = [package.numpy_helper.from_array(value, name) for name, value in constants.items()]
    graph = helper.make_graph(nodes, "tiny", *infos, tensors)
    opsets = [helper.make_opsetid("", 13), helper.make_opsetid("TRT", 1)]
    package.save(helper.make_model(graph, opset_imports=opsets, ir_version=8), str(path))
    return path


def cells_of(
    stride: int, classes: int, box: np.ndarray, certain: float, silent: float
) -> tuple[np.ndarray, np.ndarray]:
    """Weights and bias of a convolution that gives 3 * (5 + classes) numbers for each cell.

    Args:
        stride: of the grid.
        classes: how many.
        box: (3, 4) first four numbers of each anchor.
        certain: number that stands for certainty of the class.
        silent: number that stands for no objectness; the finest grid's first anchor adds the mean grey.
    """
    columns = 5 + classes
    weight = np.zeros((3 * columns, 3, stride, stride), np.float32)
    bias = np.full((3, columns), silent, np.float32)
    bias[:, :4] = box
    bias[:, 5 + CAR] = certain
    if stride == STRIDES[0]:
        weight[4] = 1.0 / (3 * stride * stride)
        bias[0, 4] = 0.0
    return weight, bias.reshape(-1)


def grids(
    classes: int, boxes: dict[int, np.ndarray], certain: float, silent: float
) -> tuple[list[Any], dict[str, np.ndarray]]:
    """Nodes from ``planar`` (1, 3, H, W) to ``c8``, ``c16``, ``c32`` (1, 3 * columns, g, g), with their constants."""
    nodes, constants = [], {}
    for stride in STRIDES:
        constants[f"w{stride}"], constants[f"b{stride}"] = cells_of(stride, classes, boxes[stride], certain, silent)
        names = ["planar", f"w{stride}", f"b{stride}"]
        nodes.append(onnx().helper.make_node("Conv", names, [f"c{stride}"], strides=[stride] * 2))
    return nodes, constants


def bright(height_px: int, width_px: int, box: tuple[int, int, int, int], value: float = 1.0) -> np.ndarray:
    """A black picture with one bright box x1 y1 x2 y2."""
    image = np.zeros((height_px, width_px), np.float32)
    image[box[1] : box[3], box[0] : box[2]] = value
    return image
