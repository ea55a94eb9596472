"""Readers: each original layout to frames and boxes, on made folders."""

from __future__ import annotations

import json
import math
import shutil

import pytest
from data_makers import make_folder, make_kitti, make_sim, make_udacity, picture, write

from pipeline import datasets
from pipeline.datasets.dataset import DataAbsent
from pipeline.datasets.frame import Box
from pipeline.datasets.labels import CLIPPED, EMPTY, NO_BOX, OUTSIDE, UNKNOWN
from pipeline.datasets.photos import PHOTOGRAPHS
from pipeline.errors import InputError

REST = "1.5 1.6 3.9 1.0 1.7 20.0 0.1"


def corners(box):
    return box.x1, box.y1, box.x2, box.y2


def test_kitti(tmp_path):
    frames = datasets.open_dataset("kitti", "kitti", make_kitti(tmp_path)).frames()
    assert [frame.name for frame in frames] == ["000000", "000001", "000002"]
    frame = frames[0]
    assert frame.image().shape == (320, 448)
    assert (frame.split, frame.defect, frame.notes) == ("training", "", ())
    assert [path.stem for path in frame.previous] == ["000000_03", "000000_02", "000000_01"]  # oldest first
    assert [(box.label, box.ignore) for box in frame.boxes] == [
        ("Car", False),
        ("Pedestrian", False),
        ("Car", True),  # 20 px high
        ("DontCare", True),
    ]
    assert corners(frame.boxes[0]) == (60, 120, 170, 190)
    assert math.isnan(frame.boxes[0].visible_fraction)


@pytest.mark.parametrize(
    ("line", "ignored"),
    [
        (f"Car 0.50 0 0 10 100 60 125 {REST}", False),  # exactly 25 px, exactly half truncated
        (f"Car 0.00 0 0 10 100 60 124.9 {REST}", True),
        (f"Car 0.51 0 0 10 100 60 190 {REST}", True),
        (f"Car 0.34 3 0 10 100 60 130.5 {REST}", False),  # occlusion does not matter
        (f"Pedestrian 0.9 0 0 10 100 60 110 {REST}", False),  # the rule is about cars
        (f"Misc 0 0 0 10 100 60 190 {REST}", True),
        (f"Tram 0 0 0 10 100 60 190 {REST}", False),
    ],
)
def test_kitti_rule_of_usable_objects(tmp_path, line, ignored):
    root = make_kitti(tmp_path, frames=1)
    (root / "training" / "label_2" / "000000.txt").write_text(line + "\n")
    (box,) = datasets.open_dataset("kitti", "k", root).frames()[0].boxes
    assert box.ignore is ignored


def test_kitti_boxes_are_clipped_dropped_and_noted(tmp_path):
    root = make_kitti(tmp_path, frames=1)
    lines = [
        f"Car 0 0 0 400 280 470.5 330 {REST}",
        f"Car 0 0 0 460 10 500 60 {REST}",
        f"Car 0 0 0 50 10 50 60 {REST}",
        f"Spaceship 0 0 0 50 10 90 60 {REST}",
    ]
    (root / "training" / "label_2" / "000000.txt").write_text("\n".join(lines))
    (frame,) = datasets.open_dataset("kitti", "k", root).frames()
    assert [(*corners(box), box.ignore) for box in frame.boxes] == [(400, 280, 448, 320, False), (50, 10, 90, 60, True)]
    assert frame.notes == (CLIPPED, OUTSIDE, EMPTY, UNKNOWN)


def test_kitti_height_rule_uses_the_height_before_clipping(tmp_path):
    root = make_kitti(tmp_path, frames=1)
    (root / "training" / "label_2" / "000000.txt").write_text(f"Car 0 0 0 10 300 60 330 {REST}\n")
    (box,) = datasets.open_dataset("kitti", "k", root).frames()[0].boxes
    assert (box.height_px, box.ignore) == (20, False)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("Car 0 0 0 1 2 3\n", "line 1: 7 fields, expected 15"),
        (f"\nCar 0 0 0 1 x 3 4 {REST}\n", "line 2: 'x' is not a number"),
        (f"Car 0 0 0 1 nan 3 4 {REST}\n", "'nan' is not a number"),
        (None, "missing label file"),
    ],
)
def test_kitti_broken_labels_mark_the_frame(tmp_path, text, reason):
    root = make_kitti(tmp_path, frames=2)
    path = root / "training" / "label_2" / "000001.txt"
    path.unlink() if text is None else path.write_text(text)
    good, bad = datasets.open_dataset("kitti", "k", root).frames()
    assert good.defect == ""
    assert reason in bad.defect
    assert "000001.txt" in bad.defect
    assert bad.boxes == ()


def test_kitti_pictures_that_are_absent_and_label_files_without_a_box_are_reported(tmp_path):
    root = make_kitti(tmp_path, frames=3)
    (root / "training/image_2/000001.png").unlink()
    (root / "training/label_2/000002.txt").write_text("")
    first, absent, empty = datasets.open_dataset("kitti", "k", root).frames()
    assert (first.defect, first.notes) == ("", ())
    assert (absent.name, absent.defect) == ("000001", f"{absent.path}: labelled, but there is no such picture")
    assert (empty.defect, empty.notes, empty.boxes) == ("", (NO_BOX,), ())


def test_kitti_gap_in_previous_frames(tmp_path):
    root = make_kitti(tmp_path, frames=1)
    (root / "training" / "prev_2" / "000000_02.png").unlink()
    (frame,) = datasets.open_dataset("kitti", "k", root).frames()
    assert [path.stem for path in frame.previous] == ["000000_01"]


def test_kitti_previous_frames_may_be_of_any_format_that_is_read(tmp_path):
    root = make_kitti(tmp_path, frames=2)
    before = root / "training" / "prev_2"
    for old, new in (("000000_01.png", "000000_01.jpg"), ("000000_02.png", "000000_02.PNG")):
        (before / old).rename(before / new)
    (before / "000001_01.png").rename(before / "000001_01.txt")  # no picture
    frames = datasets.open_dataset("kitti", "k", root).frames()
    assert [path.name for path in frames[0].previous] == ["000000_03.png", "000000_02.PNG", "000000_01.jpg"]
    assert frames[1].previous == ()
    shutil.copy(before / "000000_02.PNG", before / "000000_02.bmp")
    with pytest.raises(InputError, match="two pictures are called '000000_02' in .*prev_2"):
        datasets.open_dataset("kitti", "k", root).frames()


def test_udacity_layouts_agree(tmp_path):
    root = make_udacity(tmp_path)
    autti = datasets.open_dataset("udacity", "u", root).frames()
    crowdai = datasets.open_dataset("udacity", "u", root, layout="crowdai").frames()
    assert [(f.name, f.boxes) for f in autti] == [(f.name, f.boxes) for f in crowdai]
    assert [len(f.boxes) for f in autti] == [2, 2, 0]
    assert [box.label for box in autti[0].boxes] == ["car", "truck"]
    assert [len(f.previous) for f in autti] == [0, 1, 2]
    assert autti[2].previous == (autti[0].path, autti[1].path)
    assert all(f.defect == "" for f in autti)


def test_udacity_opens_at_the_inner_folder_too(tmp_path):
    root = make_udacity(tmp_path, layout="autti")
    assert len(datasets.open_dataset("udacity", "u", root / "object-dataset").frames()) == 3
    with pytest.raises(DataAbsent, match=r"object-detection-crowdai/labels.csv"):
        datasets.open_dataset("udacity", "u", root, layout="crowdai")


def test_udacity_gaps_in_time(tmp_path):
    root = make_udacity(tmp_path)
    frames = datasets.open_dataset("udacity", "u", root, max_gap_s=0.4).frames()
    assert [len(f.previous) for f in frames] == [0, 0, 0]


def test_udacity_traffic_lights_have_an_attribute(tmp_path):
    root = make_udacity(tmp_path, layout="autti")
    file = "1478020193690486111.jpg"
    (root / "object-dataset" / "labels.csv").write_text(f'{file} 1 2 30 40 1 "trafficLight" "Red"\n')
    assert datasets.open_dataset("udacity", "u", root).frames()[0].boxes == (Box("trafficlight", 1, 2, 30, 40),)


def test_udacity_header_of_the_old_copies_is_not_believed(tmp_path):
    root = make_udacity(tmp_path, layout="crowdai")
    labels = root / "object-detection-crowdai" / "labels.csv"
    before = datasets.open_dataset("udacity", "u", root, layout="crowdai").frames()
    labels.write_text(labels.read_text().replace("xmin,ymin,xmax,ymax", "xmin,xmax,ymin,ymax"))
    assert datasets.open_dataset("udacity", "u", root, layout="crowdai").frames() == before


def test_udacity_pictures_may_have_another_suffix_than_in_the_table(tmp_path):
    root = make_udacity(tmp_path, layout="autti")
    before = datasets.open_dataset("udacity", "u", root).frames()
    for path in (root / "object-dataset").glob("*.jpg"):
        path.rename(path.with_suffix(".png"))
    frames = datasets.open_dataset("udacity", "u", root).frames()
    assert [(f.name, f.boxes, f.defect, f.notes) for f in frames] == [
        (f.name, f.boxes, f.defect, f.notes) for f in before
    ]
    write(frames[0].path.with_suffix(".tif"), picture("a"))
    with pytest.raises(InputError, match="two pictures are called"):
        datasets.open_dataset("udacity", "u", root).frames()


def test_udacity_bad_lines(tmp_path):
    root = make_udacity(tmp_path, layout="autti")
    labels = root / "object-dataset" / "labels.csv"
    text = labels.read_text()
    labels.write_text(text + '1478020193690486111.jpg 1 2 three 4 0 "car"\n9.jpg 1 2 3 4 0 "car"\n')
    frames = {f.name: f for f in datasets.open_dataset("udacity", "u", root).frames()}
    assert "line 5: 'three' is not a number" in frames["1478020193690486111"].defect
    assert "no such picture" in frames["9"].defect
    assert sum(f.defect == "" for f in frames.values()) == 2
    labels.write_text("1.jpg 1 2 3 4\n")
    with pytest.raises(InputError, match=r"labels.csv, line 1: 5 fields.*autti"):
        datasets.open_dataset("udacity", "u", root).frames()
    labels.write_text('1.jpg 1 2 3 4 0 "car\n')
    with pytest.raises(InputError, match="No closing quotation"):
        datasets.open_dataset("udacity", "u", root).frames()


def test_folder(tmp_path):
    dataset = datasets.open_dataset("folder", "mine", make_folder(tmp_path))
    frames = dataset.frames()
    assert dataset.labelled
    assert [f.name for f in frames] == ["frame-0", "frame-1", "frame-2"]
    assert frames[1].boxes == (Box("car", 70, 130, 200, 200), Box("traffic light", 300, 40, 320, 90, True))
    (tmp_path / "labels" / "frame-0.txt").unlink()
    (tmp_path / "labels" / "frame-1.txt").write_text("")
    frames = dataset.frames()
    assert "missing label file" in frames[0].defect
    assert (frames[1].boxes, frames[1].defect) == ((), "")


def test_folder_without_labels_or_sub_folder(tmp_path):
    write(tmp_path / "b.JPG", picture("b"))
    write(tmp_path / "a.png", picture("a"))
    write(tmp_path / ".hidden.png", picture("a"))
    (tmp_path / "notes.txt").write_text("no picture")
    dataset = datasets.open_dataset("folder", "mine", tmp_path)
    assert not dataset.labelled
    assert [(f.name, f.boxes, f.defect) for f in dataset.frames()] == [("a", (), ""), ("b", (), "")]
    write(tmp_path / "a.tif", picture("a"))
    with pytest.raises(InputError, match="two pictures are called 'a'"):
        dataset.frames()


def test_sim(tmp_path):
    root = make_sim(tmp_path)
    frames = datasets.open_dataset("sim", "sim", root).frames()
    assert [f.name for f in frames] == ["evaluation-0000-3", "evaluation-0001-3"]
    assert [path.stem[-1] for path in frames[0].previous] == ["0", "1", "2"]
    assert frames[0].split == "evaluation"
    assert [(b.label, b.ignore, b.visible_fraction) for b in frames[0].boxes] == [
        ("car", False, 1.0),
        ("person", False, 0.9),
        ("car", True, 0.1),
    ]
    every = datasets.open_dataset("sim", "sim", root, moments="all").frames()
    assert [len(f.previous) for f in every] == [0, 1, 2, 3, 0, 1, 2, 3]
    lenient = datasets.open_dataset("sim", "sim", root, min_visible_fraction=0.0, min_height_px=0.0).frames()
    assert not any(b.ignore for b in lenient[0].boxes)


def test_sim_moments_follow_each_other_by_number(tmp_path):
    root = make_sim(tmp_path, viewpoints=1) / "evaluation"
    for suffix in ("png", "json"):
        (root / f"evaluation-0000-3.{suffix}").rename(root / f"evaluation-0000-10.{suffix}")
    (last,) = datasets.open_dataset("sim", "sim", tmp_path).frames()
    assert last.name == "evaluation-0000-10" and [path.stem[-1] for path in last.previous] == ["0", "1", "2"]


def test_sim_labels_as_a_bare_list_and_broken_ones(tmp_path):
    root = make_sim(tmp_path, viewpoints=1)
    path = root / "evaluation" / "evaluation-0000-3.json"
    good = datasets.open_dataset("sim", "sim", root).frames()
    content = json.loads(path.read_text())["boxes"]
    path.write_text(json.dumps(content))
    assert datasets.open_dataset("sim", "sim", root).frames() == good
    for text, reason in [
        ("{", "not valid JSON"),
        ('{"boxes": 3}', "expected a list of boxes"),
        ('[{"label": "car", "box": [1, 2, 3]}]', "box 0: expected label, box"),
        ('[{"label": "car", "box": [1, 2, 3, null]}]', "box 0"),
        ("[5]", "box 0: expected label"),
    ]:
        path.write_text(text)
        (frame,) = datasets.open_dataset("sim", "sim", root).frames()
        assert reason in frame.defect, text
    shutil.rmtree(root / "evaluation")
    with pytest.raises(DataAbsent, match="dvc repro render_sim"):
        datasets.open_dataset("sim", "sim", root)


def test_sim_refuses_other_names(tmp_path):
    write(tmp_path / "train" / "picture.png", picture("a"))
    with pytest.raises(InputError, match="expected a name like evaluation-0003-2.png"):
        datasets.open_dataset("sim", "sim", tmp_path, split="train").frames()


def test_photos_are_there_and_sharp_sized():
    dataset = datasets.open_dataset("photos", "photos")
    frames = dataset.frames()
    assert len(frames) == len(PHOTOGRAPHS) == 9
    assert not dataset.labelled
    for frame in frames:
        assert min(frame.image().shape) >= 192


def test_photos_are_checked(tmp_path):
    with pytest.raises(DataAbsent, match=r"astronaut.png. The photographs come with the package scikit-image"):
        datasets.open_dataset("photos", "photos", tmp_path).frames()
    write(tmp_path / "astronaut.png", picture("a"))
    with pytest.raises(InputError, match="SHA-256 differs"):
        datasets.open_dataset("photos", "photos", tmp_path).frames()


@pytest.mark.parametrize(
    ("kind", "where"),
    [("kitti", "cvlibs.net"), ("udacity", "github.com/udacity"), ("folder", "Any folder"), ("sim", "dvc repro")],
)
def test_absent_data_says_where_to_get_it(tmp_path, kind, where):
    with pytest.raises(DataAbsent) as caught:
        datasets.open_dataset(kind, "mine", tmp_path / "absent").frames()
    message = str(caught.value)
    assert where in message
    assert "datasets.mine.root" in message
    assert "\n" not in message


def test_parts_that_are_absent(tmp_path):
    (tmp_path / "training" / "image_2").mkdir(parents=True)
    with pytest.raises(DataAbsent, match="training/label_2"):
        datasets.open_dataset("kitti", "k", tmp_path).frames()
    (tmp_path / "training" / "label_2").mkdir()
    with pytest.raises(InputError, match="no pictures in"):
        datasets.open_dataset("kitti", "k", tmp_path).frames()


def test_wrong_options(tmp_path):
    root = make_udacity(tmp_path, frames=1)
    cases = [
        (("kity", "k", root), {}, "did you mean 'kitti'"),
        (("udacity", "u", root), {"layuot": "autti"}, r"datasets.u.layuot: unknown option.*layout"),
        (("udacity", "u", root), {"layout": "voc"}, r"datasets.u.layout='voc'"),
        (("udacity", "u", root), {"limit": 0}, r"datasets.u.limit=0: expected at least 1"),
        (("udacity", "u", None), {}, r"datasets.u.root is not set"),
        (("folder", "", root), {}, "needs a name"),
        (("sim", "s", root), {"moments": "first"}, r"datasets.s.moments='first'"),
    ]
    for arguments, options, message in cases:
        with pytest.raises(InputError, match=message):
            datasets.open_dataset(*arguments, **options)


def test_limit_is_spread_evenly_and_whitelist_comes_first(tmp_path):
    root = make_folder(tmp_path / "data", frames=7, labels=False)
    names = [f.name for f in datasets.open_dataset("folder", "m", root, limit=3).frames()]
    assert names == ["frame-0", "frame-2", "frame-4"]
    assert len(datasets.open_dataset("folder", "m", root, limit=50).frames()) == 7
    whitelist = tmp_path / "list.txt"
    whitelist.write_text("frame-5\nframe-6\n")
    names = [f.name for f in datasets.open_dataset("folder", "m", root, whitelist=whitelist, limit=1).frames()]
    assert names == ["frame-5"]
