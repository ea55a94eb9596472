"""The hashes that stages behind an index depend on: an edit of a picture, an earlier one or a label changes them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.datasets.content import content_of
from pipeline.datasets.frame import Box, Frame


@pytest.fixture
def frame(tmp_path: Path) -> Frame:
    for name in ("now", "before", "long_before"):
        (tmp_path / f"{name}.png").write_bytes(name.encode())
    previous = (tmp_path / "long_before.png", tmp_path / "before.png")
    box = Box("car", 10.0, 20.0, 30.5, 40.0, visible_fraction=0.5)
    return Frame("drives", "000001", tmp_path / "now.png", (box,), previous)


def test_same_content_gives_the_same_hashes(frame: Frame) -> None:
    assert content_of([frame]) == content_of([replace(frame)])
    assert set(content_of([frame])["000001"]) == {"picture", "previous", "labels"}


@pytest.mark.parametrize(
    "change",
    [{"label": "van"}, {"x2": 31.0}, {"ignore": True}, {"visible_fraction": 0.25}, {"visible_fraction": float("nan")}],
)
def test_any_field_of_a_box_counts(frame: Frame, change: dict) -> None:
    changed = replace(frame, boxes=(replace(frame.boxes[0], **change),))
    before, after = content_of([frame])["000001"], content_of([changed])["000001"]
    assert before["labels"] != after["labels"] and before["picture"] == after["picture"]


def test_pictures_and_earlier_pictures_count(frame: Frame) -> None:
    before = content_of([frame])["000001"]
    frame.previous[1].write_bytes(b"other")
    middle = content_of([frame])["000001"]
    frame.path.write_bytes(b"other")
    after = content_of([frame])["000001"]
    assert before["previous"][0] == middle["previous"][0] and before["previous"][1] != middle["previous"][1]
    assert before["picture"] == middle["picture"] != after["picture"]


def test_numbers_of_numpy_and_absent_files_are_taken(frame: Frame) -> None:
    corners: list[Any] = [np.float32(10.0), np.float32(10.5)]  # as a third party's reader may give them
    boxes = [replace(frame.boxes[0], x1=corner) for corner in corners]
    first = content_of([replace(frame, boxes=(boxes[0],))])["000001"]
    frame.previous[0].unlink()
    second = content_of([replace(frame, boxes=(boxes[1],))])["000001"]
    assert first["labels"] != second["labels"]
    assert second["previous"][0] == "not readable: No such file or directory"
