"""Datasets with defects in labels or layout, each as a function that makes one in a folder."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from data_makers import make_folder, make_kitti, make_sim, make_udacity

KITTI_LINE = "Car 0.00 0 1.55 60.00 120.00 170.00 190.00 1.5 1.6 3.9 1.0 1.7 20.0 0.1"
TEXTS: dict[str, bytes] = {
    "binary": bytes(range(128, 256)),
    "word": b"car",
    "words": b"car a b c d",
    "three_numbers": b"car 1 2 3",
    "nan": b"car nan 2 30 40",
    "infinite": b"car 1 2 inf 40",
    "fractions": b"car 0.5 0.5 0.25 0.25",
    "further_column": b"car 1 2 30 40 0.87",
    "commas": b"car,1,2,30,40",
    "json": b'{"car": [1, 2, 30, 40]}',
    "xml": b"<annotation><object>car</object></annotation>",
    "no_class": b"1 2 30 40",
    "semicolons": b"car;1;2;30;40",
    "null_bytes": b"\0\0\0\0",
    "utf_16": "car 1 2 30 40".encode("utf-16"),
}


def _folder(content: bytes) -> Callable[[Path], object]:
    def make(root: Path) -> None:
        make_folder(root, frames=1)
        (root / "labels/frame-0.txt").write_bytes(content)

    return make


def _kitti(content: bytes) -> Callable[[Path], object]:
    def make(root: Path) -> None:
        make_kitti(root, frames=1, previous=0)
        (root / "training/label_2/000000.txt").write_bytes(content)

    return make


def _udacity(layout: str, content: bytes) -> Callable[[Path], object]:
    def make(root: Path) -> None:
        make_udacity(root, frames=1, layout=layout)
        next(root.rglob("labels.csv")).write_bytes(content)

    return make


def _sim(content: object) -> Callable[[Path], object]:
    def make(root: Path) -> None:
        make_sim(root, viewpoints=1)
        for path in root.rglob("*.json"):
            path.write_bytes(content if isinstance(content, bytes) else json.dumps(content).encode())

    return make


def _without(make: Callable[[Path], object], pattern: str) -> Callable[[Path], object]:
    """A dataset without the files of a pattern."""

    def made(root: Path) -> None:
        make(root)
        for path in root.rglob(pattern):
            path.unlink()

    return made


SIM_BOX = {"label": "car", "box": [1, 2, 30, 40], "visible_fraction": 1.0}
SIM: dict[str, object] = {
    "binary": bytes(range(128, 256)),
    "empty": b"",
    "deep": b"[" * 100_000,
    "number": 3,
    "no_boxes": {"frames": []},
    "boxes_text": {"boxes": "car"},
    "box_number": {"boxes": [1]},
    "box_null": {"boxes": [None]},
    "box_without_label": {"boxes": [{"box": [1, 2, 3, 4]}]},
    "corners_text": {"boxes": [{**SIM_BOX, "box": "1234"}]},
    "corners_three": {"boxes": [{**SIM_BOX, "box": [1, 2, 3]}]},
    "corners_null": {"boxes": [{**SIM_BOX, "box": [1, 2, None, 4]}]},
    "corners_nested": {"boxes": [{**SIM_BOX, "box": [[1], 2, 3, 4]}]},
    "corners_nan": b'{"boxes": [{"label": "car", "box": [1, 2, NaN, 4]}]}',
    "fraction_text": {"boxes": [{**SIM_BOX, "visible_fraction": "all"}]},
    "fraction_list": {"boxes": [{**SIM_BOX, "visible_fraction": [1]}]},
}
DATASETS: dict[str, tuple[str, Callable[[Path], object]]] = {
    **{f"folder_{name}": ("folder", _folder(content)) for name, content in TEXTS.items()},
    **{f"kitti_{name}": ("kitti", _kitti(content)) for name, content in TEXTS.items()},
    **{f"udacity_{name}": ("udacity", _udacity("autti", content)) for name, content in TEXTS.items()},
    **{f"sim_{name}": ("sim", _sim(content)) for name, content in SIM.items()},
    "kitti_sixteen_fields": ("kitti", _kitti(f"{KITTI_LINE} 0.9 1".encode())),
    "kitti_text_field": ("kitti", _kitti(KITTI_LINE.replace("60.00", "left").encode())),
    "kitti_no_labels": ("kitti", _without(lambda root: make_kitti(root, 1, 0), "*.txt")),
    "kitti_no_pictures": ("kitti", _without(lambda root: make_kitti(root, 1, 0), "*.png")),
    "folder_no_labels": ("folder", _without(lambda root: make_folder(root, 1), "*.txt")),
    "folder_no_pictures": ("folder", _without(lambda root: make_folder(root, 1), "*.png")),
    "udacity_empty": ("udacity", _udacity("autti", b"")),
    "udacity_quote": ("udacity", _udacity("autti", b'a.jpg 1 2 30 40 0 "car')),
    "udacity_orphan": ("udacity", _udacity("autti", b'a.jpg 1 2 30 40 0 "car"')),
    "udacity_no_table": ("udacity", _without(lambda root: make_udacity(root, 1, "autti"), "labels.csv")),
    "udacity_no_pictures": ("udacity", _without(lambda root: make_udacity(root, 2, "autti"), "*.jpg")),
    "sim_no_labels": ("sim", _without(lambda root: make_sim(root, 1), "*.json")),
    "sim_no_pictures": ("sim", _without(lambda root: make_sim(root, 1), "*.png")),
    "sim_other_layout": ("sim", lambda root: make_kitti(root, 1, 0)),
    "kitti_other_layout": ("kitti", lambda root: make_sim(root, 1)),
    "udacity_other_layout": ("udacity", lambda root: make_kitti(root, 1, 0)),
    "unknown_kind": ("kiti", lambda root: make_kitti(root, 1, 0)),
    "absent": ("kitti", lambda root: None),
    "file": ("folder", lambda root: root.write_text("x")),
}
"""Name -> kind of dataset and the function that makes it at a path."""
