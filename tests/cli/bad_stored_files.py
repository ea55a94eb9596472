"""Stored results that were damaged or edited: calibrations, surfaces, metrics and weights, each as a function."""

from __future__ import annotations

import io
import json
import pickle
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from control_makers import performance

MTF = [[0.9] * 8, [0.8] * 8]
HASHES = {"weights": "of the estimator"}  # replaced by those of the released weights, unless a case has others
CAMERA = {
    "name": "mine", "kind": "sharp frames", "blur_estimator": "spectral", "weights_sha256": HASHES,
    "size_px": [208, 224], "frames": 3, "sharp_mtf": MTF, "fit": None, "version": "0",
}  # fmt: skip
DEEP = "[" * 100_000
HEADER = "{'descr': '<f8', 'fortran_order': False, 'shape': "


def _text(content: str) -> Callable[[Path], object]:
    return lambda path: path.write_text(content)


def _json(content: Any) -> Callable[[Path], object]:
    return _text(json.dumps(content))


JSON: dict[str, Callable[[Path], object]] = {
    "empty": _text(""),
    "binary": lambda path: path.write_bytes(bytes(range(256))),
    "cut": _text(json.dumps(CAMERA)[:70]),
    "deep": _text(DEEP),
    "no_json": _text("mtf: 0.5\n"),
    "folder": lambda path: path.mkdir(),
    "long_number": _text('{"name": 1' + "0" * 5000 + "}"),
}
"""Content of a JSON file that cannot be read at all."""

CAMERAS: dict[str, Callable[[Path], object]] = {
    **JSON,
    "list": _json([]),
    "text": _json("camera"),
    "null": _json(None),
    "no_keys": _json({}),
    "unknown_key": _json({**CAMERA, "colour": 1}),
    "no_size": _json({**CAMERA, "size_px": None}),
    "text_size": _json({**CAMERA, "size_px": "ab"}),
    "one_size": _json({**CAMERA, "size_px": [208]}),
    "unknown_kind": _json({**CAMERA, "kind": "guess"}),
    "kind_number": _json({**CAMERA, "kind": 3}),
    "kind_list": _json({**CAMERA, "kind": ["edge chart"]}),
    "no_mtf": _json({**CAMERA, "sharp_mtf": None}),
    "mtf_text": _json({**CAMERA, "sharp_mtf": "sharp"}),
    "mtf_shape": _json({**CAMERA, "sharp_mtf": [0.5]}),
    "mtf_ragged": _json({**CAMERA, "sharp_mtf": [[0.5] * 8, [0.5]]}),
    "mtf_zero": _json({**CAMERA, "sharp_mtf": [[0.0] * 8] * 2}),
    "mtf_nan": _text(json.dumps({**CAMERA, "sharp_mtf": [[float("nan")] * 8] * 2})),
    "mtf_percent": _json({**CAMERA, "sharp_mtf": [[90.0] * 8] * 2}),
    "mtf_infinite": _text(json.dumps({**CAMERA, "sharp_mtf": [[float("inf")] * 8] * 2})),
    "unsharp_fraction": _json({**CAMERA, "unsharp": 0.5}),
    "mtf_object": _json({**CAMERA, "sharp_mtf": {"a": 1}}),
    "both": _json({**CAMERA, "fit": {}}),
    "fit_empty": _json({**CAMERA, "kind": "fit", "sharp_mtf": None, "fit": {}}),
    "fit_text": _json({**CAMERA, "kind": "fit", "sharp_mtf": None, "fit": "x"}),
    "fit_list": _json({**CAMERA, "kind": "fit", "sharp_mtf": None, "fit": [1]}),
    "estimator_number": _json({**CAMERA, "blur_estimator": 4}),
    "estimator_other": _json({**CAMERA, "blur_estimator": "pmp"}),
    "weights_other": _json({**CAMERA, "weights_sha256": {"a": "b"}}),
    "weights_text": _json({**CAMERA, "weights_sha256": "none"}),
}
"""A stored calibration that ``--camera`` must refuse."""


def _archive(**arrays: np.ndarray) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        with path.open("wb") as file:
            np.savez_compressed(file, **arrays)

    return write


def _archive_cut(share: float) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        _archive(ap=np.random.default_rng(0).random((50, 50)), sigma_dn=np.arange(9.0))(path)
        path.write_bytes(path.read_bytes()[: int(path.stat().st_size * share)])

    return write


def _archive_with(name: str, content: bytes) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr(name, content)

    return write


def _npy(header: str, content: bytes = b"") -> bytes:
    text = header.encode() + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text + content


def _pickled(path: Path) -> None:
    stream = io.BytesIO()
    np.save(stream, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    _archive_with("ap.npy", stream.getvalue())(path)


ARCHIVES: dict[str, Callable[[Path], object]] = {
    "empty": lambda path: path.write_bytes(b""),
    "text": _text("sigma,ap\n1,2\n"),
    "zeros": lambda path: path.write_bytes(bytes(1000)),
    "folder": lambda path: path.mkdir(),
    "cut": _archive_cut(0.5),
    "cut_index": _archive_cut(0.98),
    "no_arrays": _archive(),
    "other_arrays": _archive(x=np.zeros(3), y=np.ones((2, 2))),
    "one_array": lambda path: path.write_bytes(_npy(f"{HEADER}(1,), }}", bytes(8))),
    "pickle": lambda path: path.write_bytes(pickle.dumps({"a": 1})),
    "pickled_array": _pickled,
    "no_npy": _archive_with("ap.npy", b"hello"),
    "no_npy_name": _archive_with("ap.txt", b"hello"),
    "header_cut": _archive_with("ap.npy", b"\x93NUMPY\x01\x00\xff\xff{"),
    "header_wrong": _archive_with("ap.npy", _npy("{'descr': 'zz', 'fortran_order': False, 'shape': (1,), }")),
    "header_code": _archive_with("ap.npy", _npy("__import__('os').getcwd()")),
    "header_huge": _archive_with("ap.npy", _npy(f"{HEADER}(99999999999999,), }}", bytes(8))),
    "header_negative": _archive_with("ap.npy", _npy(f"{HEADER}(-1, 3), }}", bytes(8))),
    "version": _archive_with("ap.npy", b"\x93NUMPY\x09\x00" + bytes(50)),
}
"""A file that stands for a stored surface of average precision and holds none."""


def _edited(name: str, change: Callable[[np.ndarray], np.ndarray | None]) -> Callable[[Path], None]:
    """A sound surface for control one of whose arrays is changed, or left out where the change gives None."""

    def write(path: Path) -> None:
        performance().save(path)
        arrays = dict(np.load(path))
        changed = change(arrays.pop(name))
        _archive(**arrays, **({} if changed is None else {name: changed}))(path)

    return write


EDITED: dict[str, Callable[[Path], object]] = {
    f"{name}_{kind}": _edited(name, change)
    for name in (
        "reference", "calibration", "longest_px", "frequency_index", "level", "cells_count", "cells_sigma_dn",
        "cells_mtf", "cells_ap_percent", "cells_draws", "cells_sigma_bins_dn", "cells_mtf_bins", "cells_left_out",
    )
    for kind, change in {
        "absent": lambda values: None,
        "text": lambda values: np.full(values.shape, "x"),
        "nan": lambda values: np.full(values.shape, np.nan),
        "shape": lambda values: np.ones((3, 4, 5, 2)),
        "none": lambda values: np.zeros(0),
        "minus": lambda values: np.full(values.shape, -7.0),
    }.items()
    if (name, kind) not in (("cells_left_out", "minus"), ("cells_draws", "nan"))
}  # fmt: skip
"""A surface for control that was edited: each array absent, or of other values, shape or type."""


def _safetensors(header: Any, content: bytes = b"") -> Callable[[Path], object]:
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    return lambda path: path.write_bytes(struct.pack("<Q", len(text)) + text + content)


def _tensors(values: float, **header: Any) -> Callable[[Path], object]:
    tensor = {"a": {"dtype": "F32", "shape": [2], "data_offsets": [0, 8]}}
    metadata = {"__metadata__": {"pipeline": json.dumps(header)}} if header else {}
    return _safetensors({**metadata, **tensor}, np.array([values] * 2, np.float32).tobytes())


WEIGHTS: dict[str, Callable[[Path], object]] = {
    "empty": lambda path: path.write_bytes(b""),
    "text": _text("weights"),
    "zeros": lambda path: path.write_bytes(bytes(4000)),
    "folder": lambda path: path.mkdir(),
    "absent": lambda path: None,
    "header_cut": lambda path: path.write_bytes(struct.pack("<Q", 5000) + b'{"a":'),
    "header_no_json": _safetensors(b"no json at all"),
    "header_huge": lambda path: path.write_bytes(struct.pack("<Q", 2**62) + b"{}"),
    "header_list": _safetensors([]),
    "no_tensors": _safetensors({}),
    "content_cut": _safetensors({"a": {"dtype": "F32", "shape": [9], "data_offsets": [0, 36]}}, bytes(4)),
    "no_header": _tensors(1.0),
    "header_text": lambda path: _safetensors({"__metadata__": {"pipeline": "spectral"}})(path),
    "header_deep": _safetensors({"__metadata__": {"pipeline": DEEP}}),
    "other_network": _tensors(1.0, architecture="something-else-1"),
    "no_architecture": _tensors(1.0, step=4),
    "other_tensors": _tensors(1.0, architecture="mtf-spectral-2", released=True),
    "nan": _tensors(float("nan"), architecture="mtf-spectral-2"),
    "huge": _tensors(1e30, architecture="mtf-spectral-2"),
    "pickle": lambda path: path.write_bytes(pickle.dumps({"a": 1})),
}
"""A file that stands for the released weights of the blur network."""
