"""Labels and whitelists."""

from __future__ import annotations

import json
import math

import pytest
from data_makers import make_folder, make_kitti, make_sim, make_udacity
from hypothesis import given
from hypothesis import strategies as st

from pipeline import datasets
from pipeline.datasets.folder import Folder, read_box_labels
from pipeline.datasets.frame import Box, Frame
from pipeline.datasets.labels import EMPTY, NO_BOX, NO_ROW, TWICE, BadLabels, tidy
from pipeline.datasets.whitelist import read_whitelist, select
from pipeline.errors import InputError

words = st.text(st.characters(whitelist_categories=("L",)), min_size=1, max_size=8)
labels = st.lists(words, min_size=1, max_size=3).map(" ".join)
coordinates = st.floats(-1e6, 1e6, allow_nan=False).filter(lambda value: not 0 < value < 1)  # no fractions of images
sides = st.lists(coordinates, min_size=2, max_size=2).map(sorted)
boxes = st.builds(
    lambda label, x, y, ignore: Box(label, x[0], y[0], x[1], y[1], ignore, 0.5), labels, sides, sides, st.booleans()
)


def row(box: Box) -> str:
    """A box as a line of the plain layout, its numbers exact."""
    corners = (repr(float(value)).removesuffix(".0") for value in (box.x1, box.y1, box.x2, box.y2))
    return " ".join([box.label, *corners, *(["difficult"] if box.ignore else [])])


@given(st.lists(boxes, max_size=6))
def test_labels_round_trip(tmp_path_factory, found):
    path = tmp_path_factory.mktemp("labels") / "a.txt"
    path.write_text("".join(f"{row(box)}\n" for box in found), encoding="utf-8")
    again = read_box_labels(path)
    keys = ("label", "x1", "y1", "x2", "y2", "ignore")
    assert [[getattr(b, key) for key in keys] for b in again] == [[getattr(b, key) for key in keys] for b in found]


@pytest.mark.parametrize(
    ("box", "inside"),
    [((90, 10, 120, 30), (90, 10, 100, 30)), ((100, 10, 120, 30), None), ((-20, 10, 0, 30), None),
     ((10, 50, 30, 60), None), ((10, -9, 30, 0), None)],
)  # fmt: skip
def test_a_box_that_begins_at_the_border_has_no_part_inside(box, inside):
    assert Box("car", *box).clipped(100, 50) == (None if inside is None else Box("car", *inside))


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("car 1 2 3 4", Box("car", 1, 2, 3, 4)),
        ("car 1 2 3 4 1", Box("car", 1, 2, 3, 4, True)),
        ("car 1 2 3 4 0", Box("car", 1, 2, 3, 4)),
        ("car 1 0 3 1", Box("car", 1, 0, 3, 1)),
        ("traffic light 1 0 3 1", Box("traffic light", 1, 0, 3, 1)),
        ("car 1 2 1 4", Box("car", 1, 2, 1, 4)),  # without area, dropped later
        ("traffic light 1 2 3 4 difficult", Box("traffic light", 1, 2, 3, 4, True)),
        ("7 1 2 3 4", Box("7", 1, 2, 3, 4)),
    ],
)
def test_rows_of_plain_labels(tmp_path, line, expected):
    (tmp_path / "a.txt").write_text(line)
    (result,) = read_box_labels(tmp_path / "a.txt")
    assert result == expected


@pytest.mark.parametrize(
    "line",
    [
        "car 1 2 3", "1 2 3 4", "car 1 2 3 x", "car 1 2 inf 4", "car",
        "car 100 1 2 3 4", "car 0.93 1 2 3 4", "car 1 2 3 4 0.93", "car 1 2 3 4 100", "0 0.9 10 20 30 40",  # a score
        "0 0.5 0.5 0.1 0.2", "car 0.25 0.25 0.75 1",  # fractions of the image
    ],
)  # fmt: skip
def test_rows_that_are_refused(tmp_path, line):
    (tmp_path / "a.txt").write_text("car 1 2 3 4\n" + line)
    with pytest.raises(BadLabels, match=r"a\.txt, line 2"):
        read_box_labels(tmp_path / "a.txt")


def frames_with_box(kind, root, corners):
    """Frames of a dataset, a box of the first of which has other corners, and the file that has them."""
    text = " ".join(map(str, corners))
    if kind == "folder":
        file = make_folder(root, frames=1) / "labels/frame-0.txt"
        file.write_text(f"car 40 130 170 200\ncar {text}\n")
    elif kind == "kitti":
        file = make_kitti(root, frames=1, previous=0) / "training/label_2/000000.txt"
        file.write_text(f"Car 0 0 0 40 130 170 200 {'0 ' * 7}\nDontCare -1 -1 -10 {text} {'-1 ' * 7}\n")
    elif kind == "sim":
        file = make_sim(root, viewpoints=1) / "evaluation/evaluation-0000-3.json"
        rows = [{"label": "car", "box": [40, 130, 170, 200]}, {"label": "car", "box": list(corners)}]
        file.write_text(json.dumps(rows))
    else:
        layout = kind.partition("-")[2]
        file = next(make_udacity(root, 1, layout).rglob("labels.csv"))
        name = next(root.rglob("*.jpg")).name
        row = {"autti": f'{name} {text} 0 "car"', "crowdai": f"{text.replace(' ', ',')},{name},Car,"}[layout]
        file.write_text(f"{row}\n{row}\n")
        return datasets.open_dataset("udacity", "u", root, layout=layout).frames(), file
    return datasets.open_dataset(kind, "d", root).frames(), file


@pytest.mark.parametrize("kind", ["folder", "kitti", "udacity-autti", "udacity-crowdai", "sim"])
@pytest.mark.parametrize(
    ("corners", "wrong"),
    [((200, 30, 60, 90), "x2 < x1"), ((60, 200, 90, 50), "y2 < y1"), ((300, 200, 60, 50), "x2 < x1 and y2 < y1")],
)
def test_a_second_corner_before_the_first_makes_bad_labels(kind, corners, wrong, tmp_path):
    """As of x y width height; a side of exactly 0, as KITTI's regions without one, is dropped and noted."""
    (frame,), file = frames_with_box(kind, tmp_path / "bad", corners)
    assert frame.boxes == () and file.name in frame.defect and ("line 2" in frame.defect or "box 1" in frame.defect)
    assert f"{' '.join(map(str, corners))} has {wrong}; expected corners x1 y1 x2 y2" in frame.defect
    assert "not x y width height" in frame.defect
    (frame,), _ = frames_with_box(kind, tmp_path / "empty", (-1, -1, -1, -1))
    assert frame.defect == "" and EMPTY in frame.notes


def test_a_reader_of_a_third_party_may_not_give_reversed_corners_either(tmp_path):
    class Reversed(Folder):
        def _read(self):
            yield self._frame(self.images / "frame-0.png", [Box("car", 200, 30, 60, 90)])
            yield self._frame(self.images / "frame-1.png", [Box("car", 60, 30, 200, 90)])

    bad, good = Reversed("mine", make_folder(tmp_path)).frames()
    assert bad.boxes == () and "frame-0.png: 200 30 60 90 has x2 < x1" in bad.defect
    assert len(good.boxes) == 1 and good.defect == ""


WRONG_CORNERS = [(math.nan, 0, 9, 9), (0, 0, math.inf, 9), ("1", 0, 9, 9), (None, 0, 9, 9), (9, 0, 1, 9)]


@pytest.mark.parametrize("corners", WRONG_CORNERS)
def test_wrong_corners_of_a_third_partys_reader_name_the_frame(corners, tmp_path):
    class Tidied(Folder):
        def _read(self):
            yield self._frame(self.images / "frame-0.png", [Box("car", *corners)])

    class Plain(Folder):
        def _read(self):
            yield Frame("mine", "frame-1", self.images / "frame-1.png", (Box("car", *corners),))

    (frame,) = Tidied("mine", make_folder(tmp_path)).frames()
    written = " ".join(map(repr, corners))
    assert frame.boxes == () and f"frame-0.png: {written} " in frame.defect and "expected corners" in frame.defect
    with pytest.raises(InputError, match=f"'mine': frame 'frame-1' has a box 'car' with the corners {written}, exp"):
        Plain("mine", tmp_path).frames()


def test_a_byte_order_mark_is_not_part_of_the_first_word(tmp_path):
    (tmp_path / "a.txt").write_text("car 1 2 3 4\n", encoding="utf-8-sig")
    assert read_box_labels(tmp_path / "a.txt") == [Box("car", 1, 2, 3, 4)]
    (tmp_path / "list.txt").write_text("frame-1\n", encoding="utf-8-sig")
    assert read_whitelist(tmp_path / "list.txt") == ["frame-1"]


def test_a_further_column_never_becomes_part_of_the_class(tmp_path):
    (tmp_path / "a.txt").write_text("car 100 10 20 30 40")
    with pytest.raises(BadLabels, match="no further column"):
        read_box_labels(tmp_path / "a.txt")
    (tmp_path / "a.txt").write_text("0 0.5 0.5 0.1 0.2")
    with pytest.raises(BadLabels, match="fractions of the image"):
        read_box_labels(tmp_path / "a.txt")


def test_orphans_duplicates_and_empty_label_files_are_refused_or_noted(tmp_path):
    root = make_folder(tmp_path, frames=4)
    (root / "labels/frame-0.txt").write_text("")
    (root / "labels/frame-1.txt").write_text("car 40 130 170 200\n" * 3)
    (root / "labels/nobody.txt").write_text("car 40 130 170 200\n")
    frames = {frame.name: frame for frame in datasets.open_dataset("folder", "m", root).frames()}
    assert frames["frame-0"].notes == (NO_BOX,)
    assert frames["frame-1"].notes == (TWICE, TWICE) and len(frames["frame-1"].boxes) == 1
    assert "no such picture" in frames["nobody"].defect and not frames["frame-2"].defect
    (root / "labels/._frame-0.txt").write_bytes(b"\0")  # as macOS leaves beside files
    assert datasets.open_dataset("folder", "m", root).frames() == sorted(frames.values(), key=lambda frame: frame.name)


def test_an_empty_label_table_is_refused(tmp_path):
    root = make_udacity(tmp_path, layout="crowdai")
    table = root / "object-detection-crowdai/labels.csv"
    rows = table.read_text().splitlines()
    frames = datasets.open_dataset("udacity", "u", root, layout="crowdai").frames()
    assert [NO_ROW in frame.notes for frame in frames] == [False, False, True]
    table.write_text(rows[0] + "\n")
    with pytest.raises(BadLabels, match="without a row"):
        datasets.open_dataset("udacity", "u", root, layout="crowdai").frames()
    table.write_text("0.1,0.1,0.2,0.2," + ",".join(rows[1].split(",")[4:]) + "\n")
    defects = [frame.defect for frame in datasets.open_dataset("udacity", "u", root, layout="crowdai").frames()]
    assert sum("fractions of the image" in defect for defect in defects) == 1


def test_label_file_that_is_no_text(tmp_path):
    (tmp_path / "a.txt").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BadLabels, match="cannot be read as text"):
        read_box_labels(tmp_path / "a.txt")


@given(st.lists(boxes, max_size=8), st.integers(1, 500), st.integers(1, 500))
def test_tidy_boxes_lie_in_the_image(found, width, height):
    kept, notes = tidy(found, (width, height), None)
    for box in kept:
        assert 0 <= box.x1 < box.x2 <= width
        assert 0 <= box.y1 < box.y2 <= height
    again, more = tidy(kept, (width, height), None)
    assert (again, more) == (kept, ())
    assert len(found) - len(kept) == sum("dropped" in note for note in notes)


def test_whitelist(tmp_path):
    path = tmp_path / "list.txt"
    path.write_text("# the first two\n\nframe-1 \r\nframe-0")
    assert read_whitelist(path) == ["frame-1", "frame-0"]
    frames = datasets.open_dataset("folder", "m", make_folder(tmp_path), whitelist=path).frames()
    assert [f.name for f in frames] == ["frame-0", "frame-1"]
    with pytest.raises(
        InputError, match=r"2 of 3 names are no frames here: frame-7, frame-8; did you mean 'frame-[01]'"
    ):
        select(frames, ["frame-8", "frame-7", "frame-0"])
    path.write_text("frame-0\nframe-0\n")
    with pytest.raises(InputError, match="named more than once: frame-0"):
        read_whitelist(path)
    path.write_text("# nothing\n")
    with pytest.raises(InputError, match="names no frame"):
        read_whitelist(path)
    with pytest.raises(InputError, match="no such whitelist"):
        read_whitelist(tmp_path / "absent.txt")
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(InputError, match="not a text file"):
        read_whitelist(path)
